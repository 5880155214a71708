"""Robots as the public functions take them, and the tables that they return.

Robots are a `Robot`, the path of a robot.toml, the name of a preset, or a list of these. Or they are
dimensionless: a mapping or a pandas table with the columns `C_t`, `C_r`, `C_yr`, `l_over_R`, `L_over_R`,
`l_over_r0`, `omega_bar`, `N`, and optionally `a_over_R` and sizes of effects, one row for each robot. Or they are
the runs of one robot: a table with `N`, `l_cm`, `omega_rpm`, or these in other units, as for `calibrate`.

A table of results begins with the robots' names, or with the columns of the table that was given, without those
that have new results. The columns in lab units and the dimensionless ones follow. Robots that are dimensionless
have no lab units. `frame.attrs["units"]` has the unit of every column that has one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dataset.schema import INPUTS, OUTPUTS
from sim.arrays import Floats
from sim.inputs import check_columns, group_columns, load_robot, run_columns
from sim.io.errors import InputError
from sim.io.units import column_units
from sim.model.robot import Robot

NAME = "robot"  # the column of the robots' names

OneRobot = Robot | str | Path
Robots = OneRobot | Sequence[OneRobot] | Mapping[str, Any] | pd.DataFrame


@dataclass(frozen=True)
class RobotRows:
    """M robots as dimensionless columns, each (M,), and the robots in SI units where they were given so."""

    columns: dict[str, Floats]
    robots: tuple[Robot, ...] = ()  # none: the rows are dimensionless
    given: Mapping[str, Any] | None = None  # columns of the table that was given, (M,) each; None: none was

    def frame(self, lab: Mapping[str, Any], values: Mapping[str, Any]) -> pd.DataFrame:
        """Make a table of M rows: names or given columns, columns in lab units, dimensionless columns."""
        results = {**lab, **{k: v for k, v in values.items() if k not in lab}}
        names = {NAME: [robot.name for robot in self.robots]}
        first: Mapping[str, Any] = names if self.given is None else self.given
        return with_units(pd.DataFrame({**{k: v for k, v in first.items() if k not in results}, **results}))


def robot_rows(robots: Robots, robot: OneRobot | None = None) -> RobotRows:
    """Check robots, and convert them to columns; with `robot`, a table has its runs.

    Raises:
        InputError: a robot cannot be simulated, or columns differ in length.
    """
    if isinstance(robots, Mapping | pd.DataFrame):
        table = _broadcast(robots)
        if robot is None:
            return RobotRows(check_columns(table), given=table)
        runs, columns = run_columns(pd.DataFrame(table), one_robot(robot), "the table")
        return RobotRows(check_columns(columns), tuple(runs), table)
    if robot is not None:
        raise InputError("robot goes with a table of runs; give a table with N, l_cm, omega_rpm, or leave it out")
    given = [robots] if isinstance(robots, Robot | str | Path) else list(robots)
    if not given:
        raise InputError("no robots; give at least one")
    loaded = tuple(robot if isinstance(robot, Robot) else load_robot(robot) for robot in given)
    return RobotRows(check_columns(group_columns(loaded)), loaded)


def one_robot(robot: OneRobot) -> Robot:
    """Return a robot, read from its file where a path or a preset's name is given."""
    return robot if isinstance(robot, Robot) else load_robot(robot)


def _broadcast(robots: Mapping[str, Any] | pd.DataFrame) -> dict[str, Any]:
    columns = {str(name): np.atleast_1d(np.asarray(values)) for name, values in robots.items()}
    try:
        rows = np.broadcast_shapes(*(column.shape for column in columns.values()))
    except ValueError:
        sizes = ", ".join(f"{name} {len(column)}" for name, column in columns.items())
        raise InputError(
            f"columns differ in length ({sizes}); give one value for each robot, or one for all"
        ) from None
    return {name: np.broadcast_to(column, rows) for name, column in columns.items()}


def with_units(frame: pd.DataFrame) -> pd.DataFrame:
    """Note the units of a table's columns in `frame.attrs["units"]`: as its names or the data set say."""
    declared = {column.name: column.unit for column in (*INPUTS, *OUTPUTS) if column.unit != "1"}
    units = column_units(frame)
    for name in map(str, frame):
        plain = name.removesuffix("_low").removesuffix("_high")
        if name not in units and plain in declared:
            units[name] = declared[plain]
    frame.attrs["units"] = units
    return frame
