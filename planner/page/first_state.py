"""What the page begins with: robots, ends of the sliders, shapes, options. Fields of robots are in SI units."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from common.errors import InputError
from planner.jobs.plan import make_plan
from planner.paths.path import Path2D
from planner.paths.units import Scales, extent
from planner.planning.request import PlanRequest
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.tracked_point import TrackedVehicle
from sim.model.presets import PRESETS
from sim.model.robot import Robot

FIELDS = ("tails", "tail_length", "tail_radius", "youngs_modulus", "head_radius", "head_length", "viscosity",
          "motor_speed", "C_t", "C_r", "C_yr", "disc_offset")  # fmt: skip
_ROUND = 2  # digits of the ends of sliders
_TURNS = 2.5  # turn radii: the first size of a shape
_MOST_DWELLS = 2000  # of a plan that is written into the page
_DECIMALS = 3  # of its picture, in cm and rad


class NamedPath(NamedTuple):
    """A path that the page offers."""

    name: str
    path: Path2D  # in m


def camel(name: str) -> str:
    """Return a name as JavaScript writes it: tailLength for tail_length; coefficients keep theirs, such as C_t."""
    first, *rest = name.split("_")
    return name if first == "C" else first + "".join(word.title() for word in rest)


def robot_fields(robot: Robot) -> dict[str, Any]:
    """Return a robot's fields as the page has them."""
    values = {camel(field): getattr(robot, field) for field in FIELDS}
    return {"name": robot.name, **values, "effects": dict(robot.effects)}


def vehicle_fields(vehicle: MeasuredVehicle) -> dict[str, Any]:
    """Return a measured vehicle as the page has it: its scales, and the lines of a vehicle.toml in their order."""
    return {
        "name": vehicle.name,
        "tailLength": vehicle.length_scale,
        "timeScale": vehicle.time_scale,
        "outline": vehicle.outline,
        "measured": list(vehicle.to_dict().items()),
    }


def robots_of(robot: Robot | MeasuredVehicle) -> list[dict[str, Any]]:
    """Return the robot or vehicle of the page, and the robots of the paper."""
    others = [robot_fields(preset) for preset in PRESETS.values() if preset.name != robot.name]
    first = vehicle_fields(robot) if isinstance(robot, MeasuredVehicle) else robot_fields(robot)
    return [{"name": fields["name"], "fields": fields} for fields in (first, *others)]


def slider_ends(robot: Robot, domain: Mapping[str, tuple[float, float]]) -> dict[str, list[float]]:
    """Return the ends of each field's slider in laboratory units, from the domain of a table.

    One field at a time is moved from the given robot, so that all its groups stay within the domain.
    """

    def between(low: float, high: float, value: float) -> list[float]:
        low, high = min(low, value), max(high, value)
        return [_rounded(low, math.floor), _rounded(high, math.ceil)]

    groups, cm, mm = robot.group_values(), 100.0, 1000.0
    omega = [bound / robot.omega_bar for bound in domain["omega_bar"]]
    slender, size, head = domain["l_over_r0"], domain["l_over_R"], domain["L_over_R"]
    modulus = robot.youngs_modulus / 1e6
    rpm, length = 30 / math.pi * robot.motor_speed, robot.tail_length
    radius, r0 = robot.head_radius, robot.tail_radius
    # ω̄ goes as the fourth power of the length and of the inverse of the tail's radius
    lengths = [max(size[0] * radius, slender[0] * r0), min(size[1] * radius, slender[1] * r0)]
    by_speed = [length * part**0.25 for part in omega]
    thick = [max(length / slender[1], r0 / omega[1] ** 0.25), min(length / slender[0], r0 / omega[0] ** 0.25)]
    wide = [length / size[1], length / size[0]]
    ends = {
        "tails": [float(max(domain["N"][0], 2)), float(domain["N"][1])],
        "tailLength": between(cm * max(lengths[0], by_speed[0]), cm * min(lengths[1], by_speed[1]), cm * length),
        "motorSpeed": between(rpm * omega[0], rpm * omega[1], rpm),
        "viscosity": between(robot.viscosity * omega[0], robot.viscosity * omega[1], robot.viscosity),
        "tailRadius": between(mm * thick[0], mm * thick[1], mm * r0),
        "youngsModulus": between(modulus / omega[1], modulus / omega[0], modulus),
        "headRadius": between(mm * wide[0], mm * wide[1], mm * radius),
        "headLength": between(mm * radius * head[0], mm * radius * head[1], mm * robot.head_length),
        "discOffset": [0.0, _rounded(2 * mm * radius, math.ceil)],
    }  # fmt: skip
    coefficients = {name: between(*domain[name], groups[name]) for name in ("C_t", "C_r", "C_yr")}
    return {**ends, **coefficients}


def _rounded(value: float, towards: Any) -> float:
    """Round a number to some digits, up or down."""
    if value == 0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(abs(value))) + 1 - _ROUND)
    return float(f"{towards(value / unit) * unit:.12g}")


def shapes_of(turn_radius: float, paths: Sequence[NamedPath]) -> list[dict[str, Any]]:
    """Return the shapes that the page offers; `turn_radius` [m] sets their first size [cm]."""
    size = _rounded(100 * _TURNS * turn_radius, math.ceil)
    given = [
        {"name": name, "points": np.round(100 * path.points, 8).tolist(), "closed": path.closed}
        for name, path in paths
    ]
    return [
        *given,
        {"name": "circle", "words": "circle", "size": size, "sizeWords": "Radius"},
        {"name": "square", "words": "square", "size": 2 * size, "sizeWords": "Side"},
        {"name": "triangle", "words": "triangle", "size": 2 * size, "sizeWords": "Side"},
        {"name": "polygon:6", "words": "hexagon", "size": size, "sizeWords": "Side"},
        {"name": "eight", "words": "figure of eight", "size": 3 * size, "sizeWords": "Width"},
        {"name": "wave", "words": "wave", "size": 5 * size, "sizeWords": "Length"},
    ]


def first_plan(path: Path2D, tracked: TrackedVehicle, request: PlanRequest) -> dict[str, Any] | None:
    """Make the plan that the page shows until its own planner has made it.

    Names are those of `pictured` in worker.js; lengths in cm, times in s. One pose for each dwell is enough for a
    picture.

    Args:
        path: the first path [l].
        tracked: the robot and its tracked point.
        request: what is asked of the plan.

    Returns:
        The plan; None: there is none, and the page says why, or it is too long to be written into the page.
    """
    try:
        plan = make_plan(path, tracked, request)
    except InputError:
        return None
    if len(plan.dwells) > _MOST_DWELLS:
        return None
    second, cm = plan.robot.time_scale, 100 * plan.robot.length_scale
    start, *poses = (plan.poses * [cm, cm, 1.0]).tolist()
    lengths = {
        "offset": tracked.offset,
        "stated": plan.stated_error,
        "unmeasured": plan.unmeasured_error,
        "size": max(extent(path)),
        "feedback": plan.feedback_error,
        "guaranteed": plan.errors.guaranteed,
        "predictedRms": plan.predicted_rms,
        "predictedMax": plan.predicted_max,
        "offDrawn": plan.declared.off_drawn,
        "missed": plan.declared.missed,
        "netSpeed": plan.straight.speed / second,
    }
    return {name: None if length is None else cm * length for name, length in lengths.items()} | {
        "reference": np.round(cm * plan.reference, _DECIMALS).tolist(),
        "closed": path.closed,
        "motion": [start, *np.round(poses, _DECIMALS).tolist()],
        "samples": 1,
        "dwells": np.round(plan.seconds, 4).tolist(),
        "firstDirection": plan.first_direction,
        "minimumDwell": plan.minimum_dwell * second,
        "calibrated": tracked.calibrated,
        "warnings": list(plan.warnings),
        "timeScale": second,
    }


def first_options(request: PlanRequest, robot: Scales, smooth: float | None) -> dict[str, Any]:
    """Return the options of the page's first plan: times in s, the tolerance and the smoothing in cm.

    Args:
        request: what is asked of the plan.
        robot: the robot, or a vehicle.
        smooth: length over which a drawn stroke is smoothed [l].

    Raises:
        InputError: the request has a dwell or a seed of its own, which the page does not have.
    """
    if request.dwell is not None or request.seed:
        raise InputError("the page has no option for a dwell or a seed of its own")
    cm = 100 * robot.length_scale
    least = request.least_dwell(robot)
    return {
        "objective": request.objective,
        "corner": request.corner,
        "point": request.point,
        "minimumSeconds": request.minimum_seconds if least is None else least * robot.time_scale,
        "tolerance": None if request.tolerance is None else request.tolerance * cm,
        "timeWeight": request.time_weight,
        "keepOut": "",
        "walls": "",
        "start": "",
        "goal": "",
        "smooth": None if smooth is None else smooth * cm,
    }
