"""The swimmer's nuisance parameters: which they are, how well they are known, and what depends on them.

Those of the robot come from robot.toml. Four belong to the way of measuring and come from the table: the camera's
scale, the zeros of the heading and of the course, and the tachometer. Each is a parameter with a prior
(`calibration.statistics.statistical_model`). The zero of the course shows only where a current is at work.

A motion depends on the robot through its groups, and on the unit of time μ0 l⁴/EI. Both are products of powers of
the numbers, so the derivative along a number is a sum over groups with these powers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from calibration.statistics.statistical_model import Parameter
from sim.io.units import UNITS, from_si
from sim.model.robot import Robot

CAMERA, HEADING, TACHOMETER = "camera_scale", "heading_zero", "tachometer"
COURSE = "course_zero"
LENGTH = "tail_length_offset"
TABLE_DEFAULTS = {CAMERA: 0.01, HEADING: math.radians(1.0), TACHOMETER: 0.005, COURSE: math.radians(2.0)}

# Powers of the groups, and of "time", "length" (l) and "ahead" (L/l), in each number. The offset of the tail
# length changes ln l by 1/l for each metre.
POWERS: dict[str, dict[str, float]] = {
    "youngs_modulus": {"omega_bar": -1, "time": -1},
    "viscosity": {"omega_bar": 1, "time": 1},
    "tail_radius": {"l_over_r0": -1, "omega_bar": -4, "time": -4},
    LENGTH: {"l_over_R": 1, "l_over_r0": 1, "omega_bar": 4, "time": 4, "length": 1, "ahead": -1},
    "head_radius": {"l_over_R": -1, "L_over_R": -1, "a_over_R": -1},
    "head_length": {"L_over_R": 1, "ahead": 1},
    "disc_offset": {"a_over_R": 1},
    TACHOMETER: {"omega_bar": 1},
    CAMERA: {},
    HEADING: {},
    COURSE: {},
}
GROUPS = ("omega_bar", "l_over_r0", "l_over_R", "L_over_R", "a_over_R", "C_t", "C_r", "C_yr")
_TITLES = {
    "youngs_modulus": "E (Young's modulus)",
    "viscosity": "μ0 (viscosity)",
    "tail_radius": "r0 (radius of the tails' section)",
    "head_radius": "R (head radius)",
    "head_length": "L (head length)",
    "disc_offset": "a (radius of the circle of the clamps)",
}
_SHOWN_IN = {
    "youngs_modulus": "MPa", "viscosity": "Pa_s", "tail_radius": "mm", "head_radius": "cm", "head_length": "cm",
    "disc_offset": "cm",
}  # fmt: skip
_FACTOR = 5.0  # a number may be off by


def robot_number(robot: Robot, name: str) -> float:
    """Return a number of the robot; a is the head's radius if it is not given."""
    value = getattr(robot, name)
    return float(robot.head_radius if value is None else value)


def nuisance_parameters(
    robot: Robot, table: Mapping[str, float], outputs: Sequence[str], noted: Sequence[str]
) -> tuple[Parameter, ...]:
    """List every number that is not exact.

    Args:
        robot: with its standard deviations.
        table: σ of CAMERA, HEADING [rad] and TACHOMETER.
        outputs: of the table; what no output shows is left out.
        noted: names of what was noted of the runs.
    """
    parameters = []
    for name, title in _TITLES.items():
        value = robot_number(robot, name)
        sigma = robot.sigma(name).of(value) / value
        bounds = (value / _FACTOR, value * _FACTOR)
        unit = UNITS[_SHOWN_IN[name]]
        shown = from_si(1.0, unit.suffix)
        parameters.append(Parameter(name, title, value, bounds, 1.0, True, unit.text, sigma, shown=shown))
    sigmas = {**TABLE_DEFAULTS, **table, LENGTH: robot.sigma("tail_length").of(robot.tail_length)}
    degree, turn, log = {"shown": 180 / math.pi}, math.pi / 2, {"logarithmic": True}
    course = {**degree, "plausible": (-2 * turn, 2 * turn), "grid": (-turn, turn)}
    sees = bool({"R_yr", "v"} & set(outputs))
    measured: tuple[tuple[bool, str, str, float, tuple[float, float], float, str, dict[str, Any]], ...] = (
        (True, LENGTH, "l (tail length, all tails alike)", 0.0, (-0.02, 0.02), 1e-3, "mm", {"shown": 1e3}),
        (sees, CAMERA, "scale of the camera", 1.0, (0.5, 2.0), 1.0, "1", log),
        ("theta" in outputs, HEADING, "zero of the heading", 0.0, (-0.5, 0.5), 0.02, "°", degree),
        (sees and "course_x" in noted, COURSE, "zero of the course", 0.0, (-4.0, 4.0), 0.1, "°", course),
        (True, TACHOMETER, "ω (tachometer)", 1.0, (0.5, 2.0), 1.0, "1", log),
    )
    for seen, name, title, start, bounds, typical, text, further in measured:
        if seen:
            parameters.append(
                Parameter(name, title, start, bounds, typical, unit=text, sigma=sigmas[name], **further)
            )
    return tuple(p for p in parameters if p.sigma)
