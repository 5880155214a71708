"""Calibrate a robot with a measured table, and what comes of it: the verdict, the corrected robot, their files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import pandas as pd

from calibration.findings.samples import open_forms
from calibration.report.path_error import PathError
from calibration.robot.corrected_robot import as_toml, handed_on, law_handed_on
from calibration.swimmer.measured_table import PROTOCOLS, Measurements, read_measurements
from calibration.table.runs import lines_of_excluded
from calibration.verdict.verdict import Verdict
from common.arrays import Flags
from sim.knowledge import CalibrationKnowledge
from sim.model.robot import Robot


@dataclass(frozen=True, repr=False)
class RobotVerdict(Verdict):
    """What a measured table says about a robot: a `Verdict` with the robot, its runs, and the corrected robot.

    Example:
        >>> from softflagella import calibrate
        >>> verdict = calibrate("runs.csv", "robot.toml")  # doctest: +SKIP
        >>> verdict.corrected.effects  # doctest: +SKIP
        {'end_over_end_drag': 4.9}
    """

    robot: Robot = field(kw_only=True)  # as it was given
    paths: tuple[PathError, ...] = field(default=(), kw_only=True)  # the error on paths, where it was asked for

    @property
    def corrected(self) -> Robot:
        """The robot with fitted coefficients, nuisance parameters and effects, or with the law that describes."""
        return self._handed_on[0]

    @property
    def knowledge(self) -> CalibrationKnowledge:
        """Covariance of what was fitted, and the current in the tank; for `softflagella.plan`."""
        return self._handed_on[1]

    def to_dict(self) -> dict[str, Any]:
        """Return the content of verdict.json."""
        return {**super().to_dict(), "path": {error.words: error.record() for error in self.paths} or None}

    @cached_property
    def _handed_on(self) -> tuple[Robot, CalibrationKnowledge]:
        if self.law and self.described:
            return law_handed_on(self.robot, self.law.kept[0], self.split.kept)
        return handed_on(self.robot, self.final_refit)

    @cached_property
    def alternatives(self) -> tuple[tuple[Robot, CalibrationKnowledge], ...]:
        """The robot with each further form that the runs cannot tell from that of `corrected`."""
        if self.law and self.described:
            return ()
        return tuple(handed_on(self.robot, refit) for refit in [*open_forms(self).values()][1:])

    def _corrected_file(self) -> tuple[str, str]:
        notes = [f"{title}: {words}" for title, words in self.quantities()[2:]]  # fitted, with 95 % intervals
        notes += [f"as good: {form.title}" for form in self.forms]
        return "corrected.toml", as_toml(*self._handed_on, () if self.described else notes)


def read_runs(
    table: pd.DataFrame,
    protocol: Literal["session", "paper"],
    tell: Callable[[str], object],
    *,
    file: str | Path | None = None,
) -> tuple[Measurements, Flags]:
    """Read the runs of a table, and those that its protocol holds out; see `softflagella.calibrate`.

    Args:
        file: from which the table was read.
    """
    data = read_measurements(table, file=file)
    for line in (*data.converted, *lines_of_excluded(data)):
        tell(line)
    return PROTOCOLS[protocol](data)
