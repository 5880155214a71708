"""Calibrate a robot with a measured table, and what comes of it: the verdict, the corrected robot, their files."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import pandas as pd

from calibration.report.corrected_robot import as_toml, handed_on, law_handed_on
from calibration.report.path_error import PathError
from calibration.report.report import write_report
from calibration.statistics.excluded import count_of_rows, summary_of_excluded
from calibration.swimmer.measured_table import PROTOCOLS, Measurements, read_measurements
from calibration.verdict.record import verdict_record
from calibration.verdict.verdict import Verdict
from common.arrays import Flags
from common.files import files_together, write_text
from common.notebook import Shown, given_axes
from sim.knowledge import CalibrationKnowledge
from sim.model.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FILES = ("verdict.json", "report.html", "corrected.toml")


@dataclass(frozen=True, repr=False)
class RobotVerdict(Shown, Verdict):
    """What a measured table says about a robot: a `Verdict` with the robot, its runs, and the corrected robot.

    Example:
        >>> from softflagella import calibrate
        >>> verdict = calibrate("runs.csv", "robot.toml")  # doctest: +SKIP
        >>> verdict.corrected.effects  # doctest: +SKIP
        {'end_over_end_drag': 4.9}
    """

    robot: Robot  # as it was given
    table: str  # name of the table
    paths: tuple[PathError, ...] = ()  # the error on paths, where it was asked for

    @property
    def corrected(self) -> Robot:
        """The robot with fitted coefficients, nuisance parameters and effects, or with the law that describes."""
        return self._handed_on[0]

    @property
    def knowledge(self) -> CalibrationKnowledge:
        """Covariance of what was fitted, and the current in the tank; for `softflagella.plan`."""
        return self._handed_on[1]

    @cached_property
    def _handed_on(self) -> tuple[Robot, CalibrationKnowledge]:
        if self.law and self.described:
            return law_handed_on(self.robot, self.law.kept[0], self.split.kept)
        return handed_on(self.robot, self.final_refit)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the residual of each output, before and after, over the noise of a run.

        Args:
            ax: default: axes of a new figure.
        """
        from calibration.report.figures import plot_summary  # loads matplotlib

        ax = given_axes(ax)
        plot_summary(ax, self)
        ax.legend(frameon=False, fontsize=8)
        return ax

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the relative errors on the held-out runs: a row for each model, all outputs and each output."""
        rows = {name: {"all": rms, **self.errors.by_output[name]} for name, rms in self.errors.rms.items()}
        return pd.DataFrame.from_dict(rows, orient="index")

    def to_dict(self) -> dict[str, Any]:
        """Return the content of verdict.json."""
        paths = {error.words: error.record() for error in self.paths}
        return verdict_record(self, table=self.table, path=paths or None)

    def save(self, folder: str | Path) -> list[Path]:
        """Write verdict.json, report.html and corrected.toml, all or none, and return their paths.

        Raises:
            InputError: the files cannot be written.
        """
        corrected, record = as_toml(*self._handed_on), self.to_dict()
        with files_together(folder, FILES) as temporary:
            write_report(self, record, temporary / "report.html", paths=self.paths)
            write_text(temporary / "corrected.toml", corrected)
            write_text(temporary / "verdict.json", json.dumps(record, indent=1) + "\n")
        return [Path(folder, name) for name in FILES]


def read_runs(
    table: str | Path | pd.DataFrame, protocol: Literal["session", "paper"], tell: Callable[[str], object]
) -> tuple[Measurements, Flags | None, str]:
    """Read the runs of a table, those that its protocol holds out, and its name; see `softflagella.calibrate`."""
    data = read_measurements(table)
    excluded = summary_of_excluded(data.excluded, len(data) + count_of_rows(data.excluded))
    for line in (*data.converted, *(f"excluded: {line}" for line in excluded)):
        tell(line)
    return *PROTOCOLS[protocol](data), "table" if isinstance(table, pd.DataFrame) else Path(table).name
