"""Answers of a look-up table, each with an error of its own, and refusals in the words of a laboratory.

    error           = largest half-width of the 90 % intervals of spins, yaw rate and velocities, relative to the
                      value (of velocities: to the speed); of a table of one robot the largest that it states
    certified error = largest relative difference of these between table and simulator + the simulator's own error

The simulator takes about a millisecond a robot, and longer for one and two tails.

A table refuses a robot by its groups. A refusal names the number of the robot that a laboratory sets, such as the
motor's speed for ω̄, with the values of this number that the table knows for this robot. They are found by asking
the table about robots that differ in this number alone; other groups that depend on it change, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.units import from_si
from sim.inputs import group_columns
from sim.model.groups import MOST_TAILS
from sim.model.robot import Robot
from sim.robot_rows import RobotRows
from surrogate.held_out import CERTIFIED_OUTPUTS, RATES
from surrogate.interface import LookupTable, OutsideError
from surrogate.robot_table import RobotTable
from surrogate.table import OUTSIDE, NeuralTable

_FACTOR, _STEPS = 1000.0, 600  # values up to this many times as large or as small are asked about, on either side
_REMEDY = "change the robot, or simulate it (softflagella steady, softflagella surrogate robot)"


class _Number(NamedTuple):
    """A number of a robot that decides a group."""

    words: str
    field: str
    unit: str = ""


_NUMBERS = {
    "omega_bar": _Number("motor speed", "motor_speed", "rpm"),
    "l_over_R": _Number("tail length", "tail_length", "cm"),
    "l_over_r0": _Number("tail radius", "tail_radius", "mm"),
    "L_over_R": _Number("head length", "head_length", "mm"),
    "a_over_R": _Number("disc offset", "disc_offset", "mm"),
    "N": _Number("number of tails", "tails"),
}


@contextmanager
def refusing_robots(robots: Sequence[Robot], table: LookupTable) -> Iterator[None]:
    """Say in the units of a laboratory why a table refuses one of its robots.

    Args:
        robots: those that the table is asked about, in the order of its rows.
        table: the table.

    Raises:
        OutsideError: a robot is outside the table's domain.
    """
    try:
        yield
    except OutsideError as refusal:
        words = _in_lab_units(refusal, robots[refusal.row], table)
        raise OutsideError(words, refusal.row, refusal.reason) from None


def _in_lab_units(refusal: OutsideError, robot: Robot, table: LookupTable) -> str:
    """Name a number of the robot that is outside, and the values of it that the table knows."""
    values = robot.group_values()
    outside = [
        group for group in _NUMBERS for low, high in [table.domain[group]]
        if not low * (1 - 1e-9) <= values[group] <= high * (1 + 1e-9)
    ]  # fmt: skip
    groups = outside or ["omega_bar"]  # the number that is changed most easily
    group, known = next(((g, known) for g in groups if (known := _known(robot, g, table))), (groups[0], []))
    value = f"{_NUMBERS[group].words} {_lab(robot, group)} ({_group(robot, group)})"
    why = value if group in outside else f"{refusal.reason}; {value}"
    words = f"robot {robot.name!r} is outside the look-up table: {why}"
    if known:
        ends = (f"{_lab(end, group)} ({_group(end, group)})" for end in (known[0], known[-1]))
        words += f"; for this robot it knows {' to '.join(ends)}"
    return f"{words}; {_REMEDY}"


def _group(robot: Robot, group: str) -> str:
    return f"{group} = {robot.group_values()[group]:.3g}"


def _lab(robot: Robot, group: str) -> str:
    """Write the number that decides a group in its unit."""
    unit = _NUMBERS[group].unit
    return f"{from_si(robot.number(_NUMBERS[group].field), unit):.4g} {unit}" if unit else f"{robot.tails}"


def _known(robot: Robot, group: str, table: LookupTable) -> list[Robot]:
    """Return those nearest to a robot that the table knows, without a gap, of robots that differ in one number."""
    robots = _variants(robot, group) if isinstance(table, NeuralTable) else []
    if not isinstance(table, NeuralTable) or not robots:
        return []
    known = ~table.query(group_columns(robots), flag=True)[OUTSIDE]
    if not known.any():
        return []
    field = _NUMBERS[group].field
    far = np.abs(np.log([variant.number(field) / robot.number(field) for variant in robots]))
    first = last = int(np.argmin(np.where(known, far, np.inf)))
    while first > 0 and known[first - 1]:
        first -= 1
    while last < len(robots) - 1 and known[last + 1]:
        last += 1
    return robots[first : last + 1]


def _variants(robot: Robot, group: str) -> list[Robot]:
    """Return robots that differ in the number that decides a group, rising; without those that cannot be."""
    values: list[Any] = list(range(1, MOST_TAILS + 1))
    field = _NUMBERS[group].field
    if group != "N":
        values = (robot.number(field) * np.geomspace(1 / _FACTOR, _FACTOR, 2 * _STEPS + 1)).tolist()
    robots = []
    for value in values:
        try:
            variant = replace(robot, **{field: value})
            variant.group_values()  # a law has a range of its own
        except InputError:
            continue
        robots.append(variant)
    return robots


def answer_with_error(
    table: LookupTable,
    columns: Mapping[str, Floats],
    *,
    flag: bool = False,
    certify: bool = False,
    strict: bool = True,
) -> dict[str, Any]:
    """Predict outputs, their intervals where the table has them, and `error`, each (M,).

    Args:
        table: the table.
        columns: robots by column name, each (M,).
        flag: answer for robots outside the domain as well, see `NeuralTable.query`.
        certify: simulate each robot as well.
        strict: refuse all robots where one is outside; otherwise add the column NOTE, see `NeuralTable.query`.

    Raises:
        InputError: a robot that cannot be, or one outside the domain.
    """
    if not isinstance(table, NeuralTable):
        mark = {"mark": not strict} if isinstance(table, RobotTable) else {}
        answer: dict[str, Any] = dict(table.query(columns, **mark))
        error = max(table.errors[name]["rms"] for name in CERTIFIED_OUTPUTS if name in table.errors)
        return {**answer, "error": error + 0 * answer["v_z"]}
    intervals = table.intervals is not None
    answer = table.query(columns, intervals=intervals, flag=flag, certify=certify, mark=not strict)
    if not intervals:
        return answer
    speed = np.hypot(answer["v_x"], answer["v_z"])
    sizes = {name: np.abs(answer[name]) if name in RATES else speed for name in CERTIFIED_OUTPUTS}
    with np.errstate(divide="ignore", invalid="ignore"):  # a rate of zero
        widths = [(answer[f"{name}_high"] - answer[f"{name}_low"]) / 2 / size for name, size in sizes.items()]
    return {**answer, "error": np.max(widths, axis=0)}


def answer_rows(
    rows: RobotRows, table: LookupTable, *, flag: bool = False, certify: bool = False, strict: bool = False
) -> dict[str, Any]:
    """Answer as `answer_with_error`; refusals name the robots, and the file of their table."""
    if flag and strict:
        raise InputError("flag and strict: give numbers for robots outside, or refuse all; leave one of them out")
    with rows.naming(), refusing_robots(rows.robots, table) if rows.robots else nullcontext():
        return answer_with_error(table, rows.columns, flag=flag, certify=certify, strict=strict)
