"""hold(place, robot): the smallest orbit about a place that the robot can keep.

A robot that only swims forward cannot stay at a point. Seen from the robot, a fixed place turns about one of two
centres: where the robot's circles to the left and to the right have their own. A cycle of flips always brings the
place further behind the pivot, unless it goes around one of these centres. So no cycle of arcs keeps the tracked
point nearer to the place than the circle at constant direction, whose radius is

    R = sqrt(R′² + b²),   R′ the pivot's turn radius, b the distance from the pivot to the tracked point.

With the lags of the flips the same holds for all pairs of dwells that the tests try. That circle cannot be
corrected to the inside. What is planned is a somewhat wider one, in laps: its pivot uses CURVED of the largest
curvature, so that flips correct it in both directions. Lengths in l.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np

from common.errors import InputError
from common.keywords import checks_keywords
from common.units import format_time
from planner.jobs.plan import make_plan
from planner.options import AnyVehicle, JobOptions, asked, place_of, seconds_of
from planner.paths.obstacles import FreeSpace
from planner.paths.path import Path2D, circle
from planner.paths.units import in_lab, place_in_lab
from planner.planning.plan import Job, Plan

FORMAT = 2  # of hold.json
CURVED = 0.84  # below the share up to which a path is followed as it was drawn


@dataclass(frozen=True)
class Orbit(Job):
    """An orbit about a place. Lengths in l.

    Example:
        >>> import softflagella as sf
        >>> held = sf.hold((2, 1), "paper-control", seconds=1800)
        >>> held.job.smallest < held.job.radius < 1.1 * held.job.smallest, held.job.laps
        (True, 6)
    """

    place: tuple[float, float]  # that is held
    radius: float  # of the orbit of the tracked point
    smallest: float  # radius of the tracked point's smaller circle: no schedule stays nearer
    laps: int | None  # whole laps that take the time that was asked for, or more; None: until told otherwise

    kind = "hold"

    def within(self, plan: Plan) -> float:
        """Return the distance from the place within which the tracked point stays with feedback."""
        return self.radius + plan.feedback_error

    def lines(self, plan: Plan) -> list[str]:
        """Say how near the robot stays."""
        radius, smallest, within = (
            in_lab(value, plan.robot) for value in (self.radius, self.smallest, self.within(plan))
        )
        laps = "" if self.laps is None else f"{self.laps} laps, "
        lap, about = format_time(plan.duration * plan.robot.time_scale), place_in_lab(*self.place, plan.robot)
        return [
            f"orbit of radius {radius} about {about}, {laps}each {lap}; with feedback within {within}; "
            f"no schedule stays nearer than {smallest}"
        ]

    def to_dict(self, plan: Plan) -> dict[str, Any]:
        """Return the content of hold.json. Lengths in l, times in seconds."""
        return {
            "format": FORMAT,
            "place": list(self.place),
            "radius_over_l": self.radius,
            "smallest_over_l": self.smallest,
            "within_over_l": self.within(plan),
            "lap_s": plan.duration * plan.robot.time_scale,
            "laps": self.laps,
        }


@checks_keywords
def hold(
    place: Sequence[float] | str,
    robot: AnyVehicle,
    *,
    seconds: float | str | None = None,
    **options: Unpack[JobOptions],
) -> Plan[Orbit]:
    """Stay about a place, on the smallest orbit that the robot can keep with a camera; it repeats.

    Args:
        place: X,Y. In Python also x, y [l].
        robot: robot.toml or the name of a preset, or the vehicle.toml of a measured vehicle. In Python also the
            robot or the vehicle.
        seconds: TIME, for so long, such as 30min (default: until told otherwise).
        options: see `JobOptions`.

    Raises:
        InputError: the place is no pair of finite numbers, the time is not above 0, or the body has no room.

    Example:
        >>> import softflagella as sf
        >>> held = sf.hold((2, 1), "paper-control", seconds=1800)
        >>> round(held.job.smallest, 2), round(held.job.radius, 2)
        (0.94, 0.97)
    """
    duration = seconds_of(seconds, "--for")
    if duration is not None and not (math.isfinite(duration) and duration > 0):
        raise InputError(f"hold for {duration:g} s; give a time above 0")
    tracked, request = asked(robot, options)
    x, y = place_of(place, options.get("unit"), tracked.robot)
    vehicle, swims, space = tracked.vehicle, tracked.robot, request.space
    current = math.hypot(*vehicle.current.tolist()) / vehicle.speed
    radius = math.hypot(vehicle.pivot_radius * (1 + current) / CURVED, tracked.rod)
    orbit = Path2D.of(circle(radius).points + np.array([x, y]), closed=True)
    # Without obstacles: a way around one would leave the place.
    plan = make_plan(orbit, tracked, replace(request, loop=True, space=FreeSpace()), options.get("progress"))
    if not space.empty and (clearance := plan.clearance(space)) < plan.margin_needed:
        raise InputError(
            f"there is no room to hold {place_in_lab(x, y, swims)}: the body comes within "
            f"{in_lab(max(clearance, 0.0), swims)} of an obstacle and needs {in_lab(plan.margin_needed, swims)}; "
            "move the place"
        )
    forward, left, rate = vehicle.twist.T
    smallest = float((np.hypot(forward, left + rate * tracked.offset) / np.abs(rate)).min())
    laps = None if duration is None else math.ceil(duration / (plan.duration * swims.time_scale))
    return plan.with_job(Orbit((x, y), radius, smallest, laps))
