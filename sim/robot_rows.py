"""Robots as the public functions take them, and the tables that they return.

Robots are a `Robot`, the path of a robot.toml, the name of a preset, or a list of these. Or they are
dimensionless: a mapping, a pandas table, or its file, with the columns `C_t`, `C_r`, `C_yr`, `l_over_R`,
`L_over_R`, `l_over_r0`, `omega_bar`, `N`, and optionally `a_over_R` and sizes of effects, one row for each robot.
Or they are the runs of one robot: a table with `N`, `l_cm`, `omega_rpm`, or these in other units, as for
`calibrate`.

A table of results begins with the robots' names, or with the columns of the table that was given, without those
that have new results. The columns in lab units and the dimensionless ones follow. Robots that are dimensionless
have no lab units. `frame.attrs["units"]` has the unit of every column that has one.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from common.arrays import Floats
from common.changes import RobotSource
from common.errors import InputError, naming
from common.files import is_stream, refuse_folder
from common.journal import Journal, journal
from common.provenance import code_version
from common.reading import digest_of
from common.units import column_units
from sim.inputs import check_columns, group_columns, load_robot, names_robot, run_columns
from sim.model.robot import Robot
from sim.motion.steady_motion import QUALITY_COLUMNS, STEADY_COLUMNS, lab_motion

NAME = "robot"  # the column of the robots' names
UNITS = {  # of dimensionless columns whose name does not say it
    **dict.fromkeys(("omega_bar", "omega_t_bar", "omega_h_bar", "omega_yr_bar"), "EI/(mu0 l^4)"),
    **dict.fromkeys(("v_x", "v_z", "net_speed_bar"), "EI/(mu0 l^3)"),
    **dict.fromkeys(("lag_x", "lag_z"), "l"),
    "tail_gap": "2 r0",
}

OneRobot = Robot | RobotSource
if TYPE_CHECKING:  # one robot needs no pandas
    import pandas as pd

    Robots = OneRobot | Sequence[OneRobot] | Mapping[str, Any] | pd.DataFrame


@dataclass(frozen=True)
class RobotRows:
    """M robots as dimensionless columns, each (M,), and the robots in SI units where they were given so."""

    columns: dict[str, Floats]
    robots: tuple[Robot, ...] = ()  # none: the rows are dimensionless
    given: Mapping[str, Any] | None = None  # columns of the table that was given, (M,) each; None: none was
    file: str | Path | None = None  # of the table

    def naming(self) -> AbstractContextManager[None]:
        """Write the name of the table's file before messages."""
        return naming(self.file)

    @contextmanager
    def journal(self, out: str | None, options: Mapping[str, Any]) -> Iterator[Journal | None]:
        """Keep the rows of a table that are done beside the file `out`, see `common.journal`; None: not kept.

        Args:
            out: the file; nothing is kept beside a stream.
            options: that decide what is done with the rows.
        """
        if out is None or not self.file or is_stream(Path(out)):
            yield None
            return
        numbers = {name: values.tolist() for name, values in self.columns.items()}
        path, key = Path(f"{out}.journal"), digest_of(json.dumps([numbers, options, code_version()]))
        with journal(path, key) as kept:
            if kept.done:
                print(f"note: goes on with the rows that are kept in {path}", file=sys.stderr)
            yield kept

    def frame(self, values: Mapping[str, Any]) -> pd.DataFrame:
        """Make a table of M rows: names or given columns, columns in lab units, dimensionless columns.

        Args:
            values: columns of the steady motion, (M,) each. They replace given ones, see `attrs["replaced"]`.
        """
        import pandas as pd

        lab = lab_motion(self.robots, values) if self.robots else {}
        results = {**lab, **{k: v for k, v in values.items() if k not in lab}}
        names = {NAME: [robot.name for robot in self.robots]}
        first: Mapping[str, Any] = names if self.given is None else self.given
        table = with_units(pd.DataFrame({**{k: v for k, v in first.items() if k not in results}, **results}))
        table.attrs["replaced"] = [name for name in first if name in results]
        return table


def command_rows(robots: RobotSource, robot: RobotSource | None, out: str | None, *beside: str) -> RobotRows:
    """Read the robots of a command: one, or a table of points or runs, whose motion needs a file `out`.

    Raises:
        InputError: the robots are bad, or there is no file, or it is a folder.
    """
    if out is not None:
        refuse_folder(out)
    if out is None and not names_robot(robots):
        from common.tables import read_table

        read_table(str(robots))  # refuses what is no table
        raise InputError(f"{robots} is a table of points; name the file of their motion with --out")
    return robot_rows(robots, robot, *beside)


def write_motion(rows: RobotRows, values: Mapping[str, Any], out: str | None, said: str) -> None:
    """Print what a command says, and write the motion of its robots as CSV where a file is named."""
    from common.files import write_csv

    if out is None:
        return print(said)
    table = rows.frame(values)
    if replaced := table.attrs["replaced"]:
        names = ", ".join(replaced)
        print(f"note: these columns of the input are replaced by new results: {names}", file=sys.stderr)
    write_csv(table, out)
    print(said, f"-> {out}", sep=" " if rows.file else "\n")


def robot_rows(robots: Robots, robot: OneRobot | None = None, *beside: str) -> RobotRows:
    """Check robots, and convert them to columns; with `robot`, a table has its runs.

    Args:
        robots: see above. Columns of a table that are results of a simulation are not read.
        robot: the robot of a table of runs.
        beside: columns of a table that are handed on unchecked.

    Raises:
        InputError: a robot cannot be simulated, or columns differ in length.
    """
    if isinstance(robots, str | PathLike) and not names_robot(robots):
        from common.tables import read_table

        return _table_rows(read_table(str(robots)), robot, str(robots), beside)
    if not isinstance(robots, Robot | str | PathLike | Sequence):
        return _table_rows(robots, robot, None, beside)
    if robot is not None:
        raise InputError(
            "robot goes with a table of runs, with N, l_cm, omega_rpm, and robots are given; leave one of them out"
        )
    given = [robots] if isinstance(robots, Robot | str | PathLike) else list(robots)
    if not given:
        raise InputError("no robots; give at least one")
    loaded = tuple(map(one_robot, given))
    return RobotRows(check_columns(group_columns(loaded)), loaded)


def _table_rows(
    table: Mapping[str, Any] | pd.DataFrame,
    robot: OneRobot | None,
    file: str | Path | None,
    beside: tuple[str, ...],
) -> RobotRows:
    columns = _broadcast(table)
    with naming(file):
        if robot is None:
            ours = {*STEADY_COLUMNS, *QUALITY_COLUMNS, *beside}
            values = check_columns({name: values for name, values in columns.items() if name not in ours})
            values |= {name: columns[name] for name in beside if name in columns}
            return RobotRows(values, given=columns, file=file)
        import pandas as pd

        runs, values = run_columns(pd.DataFrame(columns), one_robot(robot), str(file or "the table"))
        return RobotRows(check_columns(values), tuple(runs), columns, file)


def one_robot(robot: OneRobot) -> Robot:
    """Return a robot, read from its file where a path or a preset's name is given.

    Raises:
        InputError: it is neither, or its file cannot be read.
    """
    if not isinstance(robot, Robot | str | PathLike):
        raise InputError(f"a {type(robot).__name__} is no robot; give a Robot, a robot.toml or a preset's name")
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
    """Note the units of a table's columns in `frame.attrs["units"]`: as its names say, or as declared here."""
    units = column_units(frame)
    for name in map(str, frame):
        plain = name.removesuffix("_low").removesuffix("_high")
        if name not in units and plain in UNITS:
            units[name] = UNITS[plain]
    frame.attrs["units"] = units
    return frame
