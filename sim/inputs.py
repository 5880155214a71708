"""Robots as users give them: robot.toml, names of presets, columns of a table. Checked here, with effects.

`sim.model.robot_toml` has the entries of a robot.toml.
"""

from __future__ import annotations

import tomllib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from common.arrays import Floats
from common.changes import RobotSource, changed, changes_of
from common.errors import InputError, InputWarning, naming
from common.files import write_text
from common.keywords import checks_keywords
from common.reading import read_toml
from common.run_columns import RUN, RUN_SYNONYMS
from common.units import split, to_si
from sim.effects import catalogue, check_effects, effect_named, is_effect
from sim.model.groups import GROUP_COLUMNS, OPTIONAL_COLUMNS, checked_values
from sim.model.learnt_range import read_learnt_range
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.robot_toml import check_keys, doubtful, read_robot, robot_toml

if TYPE_CHECKING:
    import pandas as pd


def check_columns(columns: Mapping[str, Any]) -> dict[str, Floats]:
    """Convert columns of robots to float64 arrays, a_over_R filled in; reject robots that cannot be simulated.

    Args:
        columns: `sim.model.groups.GROUP_COLUMNS`, optionally a_over_R and effect sizes, each (M,).

    Raises:
        InputError: a column is missing or unknown, or a number is not finite or out of its range.
    """
    groups = {*GROUP_COLUMNS, *OPTIONAL_COLUMNS}
    unknown = sorted(name for name in set(columns) - groups if not is_effect(name))
    if unknown:
        allowed = ", ".join(sorted({*groups, *catalogue()}))
        raise InputError(f"unknown column {unknown[0]!r}; allowed are {allowed}: rename or drop it")
    values = checked_values(columns)
    check_effects({name: sizes for name, sizes in values.items() if name not in groups})
    return values


def group_columns(robots: Sequence[Robot]) -> dict[str, Floats]:
    """Return the dimensionless columns of robots, (M,) each; an effect that a robot lacks is null."""
    rows = [robot.group_values() for robot in robots]
    names = dict.fromkeys(name for row in rows for name in row)
    nulls = {name: effect_named(name).null for name in names if is_effect(name)}
    return {name: np.array([row.get(name, nulls.get(name)) for row in rows]) for name in names}


def run_columns(table: pd.DataFrame, robot: Robot, where: str) -> tuple[list[Robot], dict[str, Floats]]:
    """Return the robot in each of M runs, and the dimensionless columns, (M,) each, of its runs.

    Args:
        table: columns of RUN, or these in other units; for what is missing the robot has one value. Other columns
            are not read.
        robot: the robot of the runs. The sign of a run's omega_rpm is the direction of the motor.
        where: name of the table, for messages.

    Raises:
        InputError: there is no column of a run, or a run is not possible.
    """
    from common.quantities import convert_columns, numbers_of  # these load pandas
    from common.tables import row_name

    given = convert_columns(table, RUN, where, RUN_SYNONYMS).table
    if not set(RUN) & set(given):
        raise InputError(f"{where}: no column {', '.join(RUN)}; give at least one of them for the runs of a robot")
    robots, directions = [], []
    values = {name: numbers_of(given[name]).to_list() for name in RUN if name in given}
    for row in range(len(table)):
        run = {name: column[row] for name, column in values.items()}
        speed = to_si(run["omega_rpm"], "rpm") if "omega_rpm" in run else robot.motor_speed
        length = to_si(run["l_cm"], "cm") if "l_cm" in run else robot.tail_length
        with naming(f"{where}, {row_name(table, row)}"):
            tails = run.get("N", robot.tails)
            if tails % 1 != 0:
                raise InputError(f"N = {tails:g}; give a whole number of tails")
            robots.append(replace(robot, tails=int(tails), tail_length=length, motor_speed=abs(speed)))
        directions.append(-1.0 if speed < 0 else 1.0)
    columns = group_columns(robots)
    return robots, {**columns, "omega_bar": columns["omega_bar"] * np.array(directions)}


def names_robot(source: RobotSource) -> bool:
    """Tell whether words name a robot, a preset or a robot.toml, rather than a table of points."""
    path = Path(source)
    return str(source) in PRESETS or path.suffix == ".toml" or not (path.suffix or path.exists())


@checks_keywords
def load_robot(source: RobotSource) -> Robot:
    """Load a robot from a preset's name or a robot.toml; an `InputWarning` asks about doubtful units.

    Args:
        source: path of a file, or one of `sim.model.presets.PRESETS`.

    Raises:
        InputError: the file does not describe a robot; the message names the key and what is allowed.

    Example:
        >>> from softflagella import load_robot
        >>> load_robot("paper-control").tails
        2
    """
    changes, name = changes_of(source), Path(source).stem
    if str(source) in PRESETS and not changes:
        return PRESETS[str(source)]
    content = robot_content(source)
    with naming(source):
        robot = robot_of(content, name)
    if changes:
        check_keys(changes, "--set")
        content = changed(content, changes)
        with naming("--set"):
            robot = robot_of(content, name)
    if doubts := ", ".join(doubtful(content)):
        warnings.warn(f"{source}: {doubts}", InputWarning, stacklevel=1)  # from one place, so once a command
    return robot


def robot_content(source: RobotSource) -> dict[str, Any]:
    """Return the content of a robot.toml, or that of a preset.

    Raises:
        InputError: there is no such robot, or the file cannot be read.
    """
    if preset := PRESETS.get(str(source)):
        return tomllib.loads(robot_toml(preset))
    if not Path(source).exists():
        raise InputError(f"no robot {str(source)!r}; give a robot.toml or one of {', '.join(PRESETS)}")
    with naming(source):
        return read_toml(Path(source))


def robot_of(content: Mapping[str, Any], name: str) -> Robot:
    """Return the robot that the content of a robot.toml describes, by default with this name.

    Raises:
        InputError: it describes none.
    """
    if describes_vehicle(content):
        raise InputError(
            "a vehicle has no simulation and no look-up table, only plan, goal, tour, hold, track and page; "
            f"here give a robot.toml or one of {', '.join(PRESETS)}"
        )
    tables = dict(content)
    name = str(tables.pop("name", name))
    tables.pop("calibration", None)  # read by sim.knowledge
    if "correction" in tables:
        raise InputError("[correction] is no longer read; calibrate the robot as it was given again")
    learnt_from = read_learnt_range(tables.pop("learnt_from")) if "learnt_from" in tables else None
    effects = tables.pop("effects", {})
    if not isinstance(effects, dict):
        raise InputError(f"effects = {effects!r}; write a table [effects] with lines name = size")
    values = read_robot(tables)
    check_effects(effects)
    return Robot(name=name, effects=dict(effects), learnt_from=learnt_from, **values)


def describes_vehicle(content: Mapping[str, Any]) -> bool:
    """Tell whether the content of a TOML file is that of a measured vehicle, by its speed; a robot has none."""
    return any(split(key).quantity == "speed" for key in content)


@checks_keywords
def save_robot(robot: Robot, path: str | Path) -> None:
    """Write a robot.toml that `load_robot` reads back to the same robot.

    Args:
        robot: the robot, in SI units.
        path: the file.

    Raises:
        InputError: the file cannot be written.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> from softflagella import load_robot, save_robot
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     save_robot(load_robot("paper-control"), Path(folder) / "robot.toml")
        ...     load_robot(Path(folder) / "robot.toml") == load_robot("paper-control")
        True
    """
    write_text(path, robot_toml(robot))
