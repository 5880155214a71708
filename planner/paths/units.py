"""Lengths in the units of a laboratory, and paths whose size makes no sense for a robot.

A message gives lengths in mm, cm or m first and in tail lengths l second.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from sim.io.errors import InputError
from sim.io.units import format_length, format_time, of_kind, to_si

if TYPE_CHECKING:  # the command needs UNITS before it loads NumPy
    from planner.paths.path import Path2D
    from sim.model.robot import Robot

UNITS = ("m", "cm", "mm")
ANY_UNIT = ("l", *UNITS)
LONGEST = 12_000.0  # l
SMALLEST = 0.25  # of the radius of the robot's circle, largest extent of a path
MOST_CIRCLES = 30.0  # of the robot, across a path whose unit is not stated
MOST_SECONDS = 4 * 3600.0  # that such a path may take
_LITTLE = 2.0  # turn radii across: a path whose unit may be wrong
_SENSIBLE = (3.0, 300.0)  # length in l


def in_lab(value: float, robot: Robot) -> str:
    """Write a length given in tail lengths: 3.52 cm (0.32 l)."""
    return length_in_lab(value, robot.tail_length)


def length_in_lab(value: float, tail_length: float) -> str:
    """Write a length given in tail lengths; one of them is `tail_length` in m."""
    return f"{format_length(value * tail_length)} ({_tails(value)} l)"


def time_in_lab(value: float, robot: Robot) -> str:
    """Write a time given in units of μ0 l⁴/EI: 1.79 s (0.81 time units)."""
    return f"{format_time(value * robot.time_scale)} ({value:.2g} time units)"


def read_time(words: str, name: str) -> float:
    """Read a time such as 12min, 90s or 1h20min, in seconds.

    Raises:
        InputError: the words are no time above 0; the message begins with `name`.
    """
    units = "|".join(of_kind("time"))
    parts = re.findall(rf"\s*([0-9.]+)\s*({units})(?![a-z])", words)
    try:
        seconds = sum(float(to_si(float(number), unit)) for number, unit in parts)
    except ValueError:
        seconds = 0.0
    if not re.fullmatch(rf"(\s*[0-9.]+\s*({units}))+\s*", words) or not 0 < seconds < math.inf:
        raise InputError(f"{name} {words}; write a time above 0 with its unit, such as 90s, 12min or 1h20min")
    return seconds


def place_in_lab(x: float, y: float, robot: Robot) -> str:
    """Write a place given in tail lengths: (3.52, 1.1) cm = (0.32, 0.1) l."""
    cm = 100 * robot.tail_length
    lab, tails = (", ".join(_fixed(s * value, n) for value in (x, y)) for s, n in ((cm, 2), (1.0, 3)))
    return f"({lab}) cm = ({tails}) l"


def heading_in_degrees(heading: float) -> str:
    """Write a heading given in radians, above −180 and up to 180 degrees: 91.2 degrees."""
    angle = round(math.degrees(math.remainder(heading, math.tau)), 1)
    return f"{_fixed(180.0 if angle == -180 else angle, 1)} degrees"


def _fixed(value: float, places: int) -> str:
    """Write a number with some decimals, and zero without a sign."""
    return f"{round(value, places) + 0.0:.{places}f}"


def _tails(value: float) -> str:
    """Write a length in tail lengths: 0.32, 12, 1200."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def describe(path: Path2D, robot: Robot) -> str:
    """Describe length and extent of a path."""
    width, height = extent(path)
    across = [format_length(value * robot.tail_length) for value in (width, height)]
    return f"{in_lab(path.length, robot)} long, {' by '.join(across)} ({_tails(width)} by {_tails(height)} l)"


def in_tails(unit: str, robot: Robot) -> float:
    """Convert a unit of length to tail lengths; l is the tail length itself."""
    return 1.0 if unit == "l" else to_si(1.0, unit) / robot.tail_length


def extent(path: Path2D) -> tuple[float, float]:
    """Return width and height of a path."""
    width, height = (path.points.max(0) - path.points.min(0)).tolist()
    return width, height


def check_size(path: Path2D, robot: Robot, turn_radius: float) -> None:
    """Refuse a path that no schedule can be meant for.

    Raises:
        InputError: the path is far too long or too small; the message names a unit that would make sense.
    """
    if path.length > LONGEST:
        raise InputError(f"the path is {describe(path, robot)}; at most {LONGEST:g} l can be planned"
                         f"{_remedy(path, robot, ANY_UNIT)}")  # fmt: skip
    if max(extent(path)) < SMALLEST * turn_radius:
        raise InputError(
            f"the path is {describe(path, robot)}: too small, the robot's circle has a radius of "
            f"{in_lab(turn_radius, robot)}{_remedy(path, robot, ANY_UNIT)}"
        )


def check_unstated_unit(path: Path2D, robot: Robot, turn_radius: float, speed: float, what: str = "path") -> None:
    """Ask for the unit of a path that is very large if its numbers are tail lengths, which nobody said.

    Args:
        path: in tail lengths.
        robot: its tail length and unit of time.
        turn_radius: of the robot's circle, in l.
        speed: net speed along a path, in l per unit of time.
        what: what the path is, for the message.

    Raises:
        InputError: the path is more than MOST_CIRCLES circles across, or takes more than MOST_SECONDS.
    """
    circles = max(extent(path)) / (2 * turn_radius)
    seconds = path.length / max(speed, 1e-9) * robot.time_scale
    if circles > MOST_CIRCLES or seconds > MOST_SECONDS:
        raise InputError(
            f"the {what} is {describe(path, robot)} if its numbers are tail lengths: {circles:.0f} of the robot's "
            f"circles across, about {format_time(seconds)}; say its unit, --unit l if this is meant"
            f"{_remedy(path, robot, ('l',))}"
        )


class TooTightError(InputError):
    """A path is too tight for a robot."""


@contextmanager
def hinting_at_units(path: Path2D, robot: Robot, turn_radius: float, given_in: tuple[str, ...]) -> Iterator[None]:
    """Add advice on its unit where a path is too tight, and not much larger than the robot's circle.

    Args:
        path: in tail lengths.
        robot: its tail length.
        turn_radius: of the robot's circle, in l.
        given_in: units in which the user may have given the numbers; none: the path has a size of its own.

    Raises:
        TooTightError: with the advice.
    """
    try:
        yield
    except TooTightError as refusal:
        hint = unit_hint(path, robot, given_in) if max(extent(path)) < _LITTLE * turn_radius else ""
        raise TooTightError(f"{refusal}; or, {hint}" if hint else str(refusal)) from None


def unit_hint(path: Path2D, robot: Robot, given_in: tuple[str, ...]) -> str:
    """Suggest at most two units with which the numbers of a path would make sense; empty if there is none.

    Args:
        path: in tail lengths.
        robot: its tail length.
        given_in: units in which the user may have given the numbers; none: the path has a size of its own.
    """
    hints = []
    for given in given_in:
        for meant in ANY_UNIT:
            length = path.length / in_tails(given, robot) * in_tails(meant, robot)
            if given != meant and _SENSIBLE[0] <= length <= _SENSIBLE[1]:
                hints.append(f"if you gave {given} and mean {meant}, it is {length:.3g} l: --unit {meant}")
    return "; or ".join(hints[:2])


def _remedy(path: Path2D, robot: Robot, given_in: tuple[str, ...]) -> str:
    """Suggest units that would make sense, or another scale."""
    return f"; {unit_hint(path, robot, given_in) or 'scale it'}"
