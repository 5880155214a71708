"""Check the size of a path against the robot; reject absurd sizes and suggest the unit that was probably meant."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.io.errors import InputError

if TYPE_CHECKING:  # the command needs UNITS before it loads NumPy
    from planner.paths.path import Path2D
    from sim.model.robot import Robot

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
LONGEST = 1500.0  # l
SMALLEST = 0.25  # of the radius of the robot's circle, largest extent of a path
_SENSIBLE = (3.0, 300.0)  # length in l


def describe(path: Path2D, robot: Robot) -> str:
    """Describe length and extent of a path, in l and cm."""
    width, height = extent(path)
    cm = 100 * robot.tail_length
    return (
        f"{path.length:.3g} l ({path.length * cm:.3g} cm) long, {width:.3g} by {height:.3g} l "
        f"({width * cm:.3g} by {height * cm:.3g} cm)"
    )


def in_tails(unit: str, robot: Robot) -> float:
    """Convert a unit of length to tail lengths; l is the tail length itself."""
    return 1.0 if unit == "l" else UNITS[unit] / robot.tail_length


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
                         f"{_hint(path, robot)}")  # fmt: skip
    if max(extent(path)) < SMALLEST * turn_radius:
        raise InputError(
            f"the path is {describe(path, robot)}: too small, the robot's circle has a radius of "
            f"{turn_radius:.3g} l{_hint(path, robot)}"
        )


def _hint(path: Path2D, robot: Robot) -> str:
    """Suggest the units with which the numbers of the path would make sense."""
    scales = {unit: in_tails(unit, robot) for unit in ("l", *UNITS)}
    # The path may have been given in any of these units: undo it, then try the others.
    hints = []
    for given, scale in scales.items():
        for meant, meant_scale in scales.items():
            length = path.length / scale * meant_scale
            if given != meant and _SENSIBLE[0] <= length <= _SENSIBLE[1]:
                hints.append(f"if you gave {given} and mean {meant}, it is {length:.3g} l: --unit {meant}")
    return "; " + "; or ".join(hints[:2]) if hints else "; scale it"
