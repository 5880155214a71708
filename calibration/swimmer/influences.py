"""The swimmer's nuisance parameters, and influences: what the model of a run may lack.

**Nuisance parameters** of the robot come from robot.toml. Four belong to the way of measuring and come from the
table: the camera's scale, the zeros of the heading and of the course, and the tachometer. Each is a parameter with
a prior (`calibration.statistics.statistical_model`). The zero of the course shows only where a current is at work.

**Influences.** Most change the robot of a run: an effect of `sim.effects` gets the size null + ε s. Here s is 1 or
a column of the table (hours since the first run, kelvin above the mean). Others change the observation only: the
true speed of the motor, the tracked point of the axis, a current in the lab. Some influences need a column. If the
table does not have it, they cannot be tested, and the report says so.

A fault of one tail of N changes the tails' wrench, averaged over a turn, as a change of all tails by 1/N of it, to
first order. So in runs with N tails a number of the robot is multiplied by a power of 1 − x/N: the length of the
tails or E; for a missing tail, the head's coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

from calibration.statistics.statistical_model import Parameter
from common.units import UNITS, from_si
from sim.effects import Effect, catalogue, effect_named, is_effect
from sim.model.robot import Robot

CAMERA, HEADING, TACHOMETER = "camera_scale", "heading_zero", "tachometer"
COURSE = "course_zero"
LENGTH = "tail_length_offset"
TABLE_DEFAULTS = {CAMERA: 0.01, HEADING: math.radians(1.0), TACHOMETER: 0.005, COURSE: math.radians(2.0)}

FIELDS = {  # numbers of a robot that are not exact, but for the tail length
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


def nuisance_parameters(
    robot: Robot, table: Mapping[str, float], outputs: Sequence[str], noted: Sequence[str]
) -> tuple[Parameter, ...]:
    """List every number that is not exact and shows in these outputs; `table` has σ of what the table states."""
    parameters = []
    for name, title in FIELDS.items():
        value = robot.number(name)
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


SLIP, TRACKED_POINT = "motor_slip", "tracked_point"
CURRENT = ("current_along_x", "current_along_y")
_ONE_TAIL = {  # name: title, unit, bounds, typical, plausible, powers of the robot's numbers in 1 - x/N
    "one_tail_shorter": ("one tail shorter", "l", (-0.5, 0.6), 0.1, (0.02, 0.5), {"tail_length": 1}),
    "one_tail_softer": ("one tail softer", "E", (-0.9, 0.8), 0.2, (0.05, 0.7), {"youngs_modulus": 1}),
    "one_tail_missing": (
        "one tail missing", "tails", (0.0, 1.5), 1.0, (0.7, 1.3), {"C_t": -1, "C_r": -1, "C_yr": -1}
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Influence:
    """One way in which a run may differ from the model."""

    parameter: Parameter
    effect: str | None  # of `sim.effects`; None: acts on the observation
    needs: str | None  # column of the table that it needs
    odd: bool  # left and right turns differ with it
    one_tail: Mapping[str, int] = field(default_factory=dict)  # powers of the robot's numbers in 1 − x/N


def influences() -> dict[str, Influence]:
    """List all influences by name."""
    known = {}
    for effect in catalogue().values():
        if not effect.drivers and not effect.beside:
            known[effect.name] = _plain(effect)
        for driver in effect.drivers:
            parameter = Parameter(
                driver.name, driver.title, 0.0, driver.bounds, driver.typical, unit=driver.unit,
                plausible=driver.plausible,
            )  # fmt: skip
            known[driver.name] = Influence(parameter, effect.name, driver.column, effect.symmetry == "odd")
    slip = Parameter(
        SLIP, "slip of the motor", 0.0, (-0.3, 0.3), 0.02, unit="%", plausible=(-0.1, 0.1), shown=100.0
    )
    point = Parameter(
        TRACKED_POINT, "tracked point off the head's centre", 0.0, (-2.0, 2.0), 0.1, unit="L, forward",
        plausible=(-0.6, 0.6),
    )  # fmt: skip
    for name, axis in zip(CURRENT, "xy", strict=True):
        title, plausible = f"current in the tank along {axis}", (-0.02, 0.02)
        current = Parameter(name, title, 0.0, (-0.05, 0.05), 0.001, unit="cm/s", plausible=plausible, shown=100.0)
        known[name] = Influence(current, None, f"course_{axis}", False)
    for name, (title, unit, bounds, typical, plausible, numbers) in _ONE_TAIL.items():
        fault = Parameter(name, title, 0.0, bounds, typical, unit=unit, plausible=plausible)
        known[name] = Influence(fault, None, None, False, numbers)
    known[SLIP] = Influence(slip, None, None, False)
    known[TRACKED_POINT] = Influence(point, None, None, False)
    return dict(sorted(known.items()))


@cache
def influence_of_law(name: str) -> Influence | None:
    """Return the influence of the term of a law, by the law's name; None if it is none."""
    return _plain(effect_named(name)) if is_effect(name) and name not in catalogue() else None


def _plain(effect: Effect) -> Influence:
    second = next((e for e in catalogue().values() if e.beside == effect.name and e.grid), None)
    parameter = replace(_parameter(effect), second=None if second is None else _parameter(second))
    return Influence(parameter, effect.name, None, effect.symmetry == "odd")


def _parameter(effect: Effect) -> Parameter:
    return Parameter(
        effect.name, effect.title, effect.null, effect.bounds, effect.typical - effect.null, unit=effect.unit,
        plausible=effect.plausible, grid=effect.grid,
    )  # fmt: skip


def reason_untestable(
    influence: Influence, columns: Mapping[str, object], both_directions: bool, outputs: Sequence[str]
) -> str:
    """Say why a table cannot test an influence; empty if it can."""
    if influence.parameter.name in CURRENT and not {"v", "R_yr", "theta"} & set(outputs):
        return "needs v_cm_s, R_yr_cm or theta_deg"
    if influence.needs is not None and influence.needs not in columns:
        return f"needs {_COLUMNS[influence.needs]}"
    if influence.odd and not both_directions:
        return "needs runs in both directions of the motor"
    return ""


_COLUMNS = {
    "elapsed_h": "elapsed_min, differing between the runs",
    "temperature_K": "temperature_C, differing between the runs",
    "course_x": "course_deg, differing between the runs",
    "course_y": "course_deg, differing between the runs",
    "head_over_tank": "tank_diameter_cm, differing between the runs",
}
