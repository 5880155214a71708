"""Calibrate a robot with a measured table, and what comes of it: the verdict, the corrected robot, their files.

Laws may describe what a table has beyond the model, whether an effect explains it or not. laws.json has every
place that was ranked and every law that was fitted. law.toml is the corrected robot with the best law
(`calibration.report.corrected_robot`). It is written if this law leaves no more than noise.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd

from calibration.laws.law_model import LEVER, SIZE
from calibration.laws.laws import Laws, find_laws
from calibration.laws.readings import EXPONENTS
from calibration.report.corrected_robot import as_toml, check_given, handed_on, law_handed_on
from calibration.report.path_error import PathError
from calibration.report.report import write_report
from calibration.statistics.excluded import count_of_rows, summary_of_excluded
from calibration.statistics.fit import Fit
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.study import Study, errors
from calibration.swimmer.measured_table import PROTOCOLS, Measurements, read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.calibrate import first_fit
from calibration.verdict.record import verdict_record
from calibration.verdict.verdict import Verdict
from common.arrays import Flags
from common.files import files_together, write_text
from common.notebook import Shown, given_axes
from common.provenance import provenance
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
        paths = {error.wanted.words: error.record() for error in self.paths}
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


@dataclass(frozen=True, repr=False)
class RobotLaws:
    """What describes the residual of a table of runs; made by `find_robot_laws`."""

    robot: Robot  # as it was given
    runs: Measurements
    study: Study
    base: Fit  # coefficients and nuisance parameters, without a law
    p_value: float  # of its residual
    laws: Laws | None  # None: the residual is within the noise
    table: str  # name of the table

    def __repr__(self) -> str:
        return f"RobotLaws: {self.sentence}"

    @property
    def sentence(self) -> str:
        """What the runs say, without a claim about the cause."""
        if self.laws is None:
            return f"The residual is within the noise (p = {self.p_value:.2g}): no law is looked for."
        return self.laws.sentence

    @property
    def error_without(self) -> float:
        """Relative rms of the calibrated model on the held-out runs."""
        return errors(self.runs, self.base.prediction, self.study.split.test)[0]

    @property
    def noise(self) -> float:
        """Relative error that the noise of a run makes."""
        return self.base.noise.rms

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the laws that were fitted, the largest gain first."""
        numbers = [name.removeprefix("law_") for name in (SIZE, LEVER, *EXPONENTS)]
        rows = [
            {
                "place": law.place.name,
                **{column: law.fit.parameters.get(f"law_{column}", math.nan) for column in numbers},
                "gain": law.gain,
                "error": law.error,
                "p_value": law.p_value,
                "kept": not law.reason,
            }
            for law in (self.laws.fitted if self.laws else ())
        ]
        return pd.DataFrame(rows, columns=["place", *numbers, "gain", "error", "p_value", "kept"])

    def to_dict(self) -> dict[str, Any]:
        """Return the content of laws.json."""
        laws = self.laws or Laws(self.base, (), ())
        return {
            **laws.to_dict(),
            "sentence": self.sentence,
            "p_value": self.p_value,
            "error_without": self.error_without,
            "noise": self.noise,
            "held_out": self.study.split.names,
            "table": self.table,
            "provenance": provenance({"table": self.table}),
        }

    def save(self, folder: str | Path) -> list[Path]:
        """Write laws.json, and law.toml if the best law is an effect that leaves only noise; all or none.

        Returns:
            The paths of the files.

        Raises:
            InputError: the files cannot be written.
        """
        described = self.laws is not None and self.laws.complete
        names = ("laws.json", "law.toml") if described else ("laws.json",)
        with files_together(folder, names) as temporary:
            write_text(temporary / "laws.json", json.dumps(self.to_dict(), indent=1) + "\n")
            if self.laws is not None and described:
                with_law = law_handed_on(self.robot, self.laws.kept[0], self.study.split.kept)
                write_text(temporary / "law.toml", as_toml(*with_law))
        return [Path(folder, name) for name in names]


def find_robot_laws(
    table: str | Path | pd.DataFrame,
    robot: Robot,
    *,
    seed: int = 0,
    jobs: int | None = None,
    progress: bool = True,
    tell: Callable[[str], object] = lambda line: None,
) -> RobotLaws:
    """Find laws that describe what a table of runs has beyond the calibrated model without effects.

    One whole session is held out, as in a calibration.

    Args:
        table: measured runs, or their file.
        robot: as given.
        seed: of the bootstrap.
        jobs: threads; default all processors.
        progress: show progress bars.
        tell: is told what was converted and what was excluded, a line at a time.

    Raises:
        InputError: the table cannot be used.
    """
    check_given(robot)
    data, held_out, name = read_runs(table, "session", tell)
    model = SwimmerModel(robot, data, jobs)
    study, base, _ = first_fit(model, held_out, seed=seed, progress=progress)
    none = Directions.plain(np.empty((*data.y.shape, 0)))
    p_value = examine_residual(study, base, none).general_p
    laws = find_laws(study, base) if p_value < study.level else None
    return RobotLaws(robot, data, study, base, p_value, laws, name)
