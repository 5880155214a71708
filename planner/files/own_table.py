"""The look-up table of a command: the one that comes with the package, or the robot's own.

The package's table covers a domain of robots without odd effects. For any other robot a table of its own is
simulated, once: it is kept beside the robot's file, and read again as long as the robot is the same.
"""

from __future__ import annotations

import sys
from pathlib import Path

from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.from_table import check_known, default_table
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from surrogate.interface import LookupTable

ENDING = ".table.json"
_TABLES: dict[tuple[tuple[str, float], ...], LookupTable] = {}  # of robots without a file, by their groups


def table_for(
    robot: Robot, source: str | None, knowledge: CalibrationKnowledge, *, own: bool = False
) -> LookupTable:
    """Load the package's table if it knows a robot, else the robot's own; simulate that where there is none.

    Args:
        robot: the robot.
        source: its file, or the name of a preset; None: the table is kept in this process alone.
        knowledge: what a calibration found besides the robot.
        own: take the robot's own table in any case. It is more accurate.

    Raises:
        InputError: the robot's motion cannot be simulated.
    """
    reason = ""
    if not own:
        shipped = default_table()
        try:
            check_known(robot, shipped, knowledge)
        except InputError as unknown:
            reason = f"{str(unknown).partition('; ')[0]}: "
        else:
            return shipped
    kept = None if source is None or source in PRESETS else Path(source).with_suffix(ENDING)
    table = _kept_table(robot, kept, knowledge)
    if table is None:
        print(f"{reason}simulating this robot's own look-up table, for some seconds", file=sys.stderr)
        table = _simulated_table(robot, kept)
    return table


def _kept_table(robot: Robot, kept: Path | None, knowledge: CalibrationKnowledge) -> LookupTable | None:
    """Read the table beside the robot's file; None where there is none, or one of another robot or version."""
    from surrogate.robot_table import load_robot_table

    if kept is None:
        return _TABLES.get(_key(robot))
    if not kept.exists():
        return None
    try:
        table = load_robot_table(kept)
        check_known(robot, table, knowledge)
    except InputError:
        return None
    return table


def _simulated_table(robot: Robot, kept: Path | None) -> LookupTable:
    """Simulate the table of a robot, and keep it where that is possible."""
    from surrogate.tabulate import tabulate

    table = tabulate(robot)
    if kept is None:
        _TABLES[_key(robot)] = table
    else:
        try:
            table.save(kept)
            print(f"-> {kept}", file=sys.stderr)
        except InputError as refusal:  # a folder that cannot be written is no reason not to plan
            print(f"the table is not kept: {refusal}", file=sys.stderr)
    return table


def _key(robot: Robot) -> tuple[tuple[str, float], ...]:
    return tuple(sorted(robot.group_values().items()))
