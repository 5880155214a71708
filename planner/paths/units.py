"""Lengths in the units of a laboratory, and paths whose size makes no sense for a robot.

Every length of a command has a unit: its own, as in 24cm and 3l, or that of --unit. A message gives lengths in mm,
cm or m first and in tail lengths l second.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from common.errors import InputError, InputWarning
from common.units import (
    LENGTHS,
    format_length,
    format_time,
    length_in_lab,
    number_and_unit,
    of_kind,
    tails_in_words,
    to_si,
)

if TYPE_CHECKING:  # the command needs them before it loads NumPy
    from planner.paths.path import Path2D

LONGEST = 12_000.0  # l
_DAY = 86_400.0  # s
SMALLEST = 0.25  # of the radius of the robot's circle, largest extent of a path
NO_UNIT = (
    "its lengths have no unit; write it behind them, 24cm or 3l (tail lengths), name columns x_cm and y_cm, or "
    'give --unit cm (in Python unit="cm")'
)


class Scales(Protocol):
    """What the planner must know besides the motion: a robot has it, and a vehicle that was measured."""

    @property
    def name(self) -> str:
        """In texts and files."""

    @property
    def length_scale(self) -> float:
        """The unit of length [m]: of a robot the tail length l."""

    @property
    def time_scale(self) -> float:
        """The unit of time [s]."""

    @property
    def outline(self) -> tuple[float, float, float]:
        """Front and back of the body, forward from the point whose poses count, and half of the width [l]."""


def in_lab(value: float, robot: Scales) -> str:
    """Write a length given in tail lengths: 3.52 cm (0.32 l)."""
    return length_in_lab(value, robot.length_scale)


def missed_words(missed: float, stated: float, length: float) -> str:
    """Begin a sentence with what a track missed of its declared path; empty where that is within `stated` [l].

    Args:
        missed: largest distance of a point of the path from the track [l].
        stated: error that the plan states [l].
        length: of a tail [m].
    """
    if missed <= stated:
        return ""
    return f"MISSED a part of the declared path: it is up to {length_in_lab(missed, length)} from the track; "


def time_in_lab(value: float, robot: Scales) -> str:
    """Write a time given in units of μ0 l⁴/EI: 1.79 s (0.81 time units)."""
    return f"{format_time(value * robot.time_scale)} ({value:.2g} time units)"


def read_time(words: str, name: str) -> float:
    """Read a time such as 12min, 90s or 1h20min, in seconds.

    Raises:
        InputError: the words are no time above 0; the message begins with `name`.
    """
    units = "|".join(of_kind("time"))
    parts = re.findall(rf"(?<![0-9.])([0-9.]+)\s*({units})(?![a-z])", words)
    try:
        seconds = sum(float(to_si(float(number), unit)) for number, unit in parts)
    except ValueError:
        seconds = 0.0
    if not re.fullmatch(rf"(\s*[0-9.]+\s*({units}))+\s*", words) or not 0 < seconds < math.inf:
        raise InputError(f"{name} {words}; write a time above 0 with its unit, such as 90s, 12min or 1h20min")
    return seconds


def place_in_lab(x: float, y: float, robot: Scales) -> str:
    """Write a place given in tail lengths: (3.52, 1.1) cm = (0.32, 0.1) l."""
    cm = 100 * robot.length_scale
    lab, tails = (", ".join(_fixed(s * value, n) for value in (x, y)) for s, n in ((cm, 2), (1.0, 3)))
    return f"({lab}) cm = ({tails}) l"


def heading_in_degrees(heading: float) -> str:
    """Write a heading given in radians, above −180 and up to 180 degrees: 91.2 degrees."""
    angle = round(math.degrees(math.remainder(heading, math.tau)), 1)
    return f"{_fixed(180.0 if angle == -180 else angle, 1)} degrees"


def _fixed(value: float, places: int) -> str:
    """Write a number with some decimals, and zero without a sign."""
    return f"{round(value, places) + 0.0:.{places}f}"


def describe(path: Path2D, robot: Scales) -> str:
    """Describe length and extent of a path."""
    width, height = extent(path)
    across = [format_length(value * robot.length_scale) for value in (width, height)]
    in_tail_lengths = f"({tails_in_words(width)} by {tails_in_words(height)} l)"
    return f"{in_lab(path.length, robot)} long, {' by '.join(across)} {in_tail_lengths}"


def in_tails(unit: str, robot: Scales) -> float:
    """Convert a unit of length to tail lengths; l is the tail length itself.

    Raises:
        InputError: there is no such unit.
    """
    if unit not in LENGTHS:
        raise InputError(f"unit {unit!r}; allowed are {', '.join(LENGTHS)}")
    return 1.0 if unit == "l" else to_si(1.0, unit) / robot.length_scale


def read_length(words: str, unit: str | None, robot: Scales, name: str, *, above_zero: bool = False) -> float:
    """Read a length, in tail lengths.

    Args:
        words: a number with its unit, such as 4cm or 0.3l; a number alone is in `unit`. Zero needs no unit.
        unit: of numbers alone; None: they are refused.
        robot: its tail length.
        name: with which a message begins.
        above_zero: refuse 0 and less.

    Raises:
        InputError: the words are no length, or have no unit.
    """
    value, own = number_and_unit(words)
    if not math.isfinite(value) or (above_zero and value <= 0):
        raise InputError(f"{name}: {words}; write a length{' above 0' if above_zero else ''}, such as 4cm")
    if value and not (own or unit):
        raise InputError(
            f"{name}: {words} has no unit; write {words}cm, or {words}l in tail lengths, or give --unit cm"
        )
    return value * in_tails(own or unit or "l", robot)


def read_pose(words: Sequence[str], unit: str | None, robot: Scales, name: str) -> tuple[float, float, float]:
    """Read a pose, in tail lengths and rad, from two lengths and an angle in degrees.

    Raises:
        InputError: the words are none, or have no unit.
    """
    x, y = (read_length(each, unit, robot, name) for each in words[:2])
    try:
        return x, y, math.radians(math.remainder(float(words[2]), 360))
    except ValueError:
        raise InputError(f"{name}: {words[2]}; write the heading in degrees, such as 90") from None


def extent(path: Path2D) -> tuple[float, float]:
    """Return width and height of a path."""
    width, height = (path.points.max(0) - path.points.min(0)).tolist()
    return width, height


def check_size(path: Path2D, robot: Scales, turn_radius: float, speed: float) -> None:
    """Refuse a path that no schedule can be meant for, and ask about one that takes days.

    Raises:
        InputError: the path is far too long or too small.
    """
    if path.length > LONGEST:
        raise InputError(f"the path is {describe(path, robot)}; at most {LONGEST:g} l can be planned; scale it")
    if max(extent(path)) < SMALLEST * turn_radius:
        raise InputError(
            f"the path is {describe(path, robot)}: too small, the robot's circle has a radius of "
            f"{in_lab(turn_radius, robot)}; scale it"
        )
    ask_about_days(path.length, robot, speed)


def ask_about_days(length: float, robot: Scales, speed: float) -> None:
    """Ask whether the units are right of a way that takes more than a day."""
    seconds = length / speed * robot.time_scale
    if seconds > _DAY:
        asked = f"takes this robot {format_time(seconds)} or more; are its units right?"
        warnings.warn(f"a way of {in_lab(length, robot)} {asked}", InputWarning, stacklevel=4)
