"""hold(place, robot): the smallest orbit about a place that the robot can keep.

A robot that only swims forward cannot stay at a point. Seen from the robot, a fixed place turns about one of two
centres: where the robot's circles to the left and to the right have their own. A cycle of flips always brings the
place further behind the pivot, unless it goes around one of these centres. So no cycle of arcs keeps the tracked
point nearer to the place than the circle at constant direction, whose radius is

    R = sqrt(R′² + b²),   R′ the pivot's turn radius, b the distance from the pivot to the tracked point.

With the lags of the flips the same holds for all pairs of dwells that the tests try. That circle cannot be
corrected to the inside. The orbit that is held is somewhat wider: its pivot uses CURVED of the largest curvature,
so that flips correct it in both directions. It repeats until told otherwise. Lengths in l.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from planner.jobs.hold_plan import HoldPlan
from planner.jobs.laps import looped
from planner.paths.obstacles import Footprint, FreeSpace
from planner.paths.path import Path2D, circle
from planner.paths.units import in_lab, place_in_lab
from planner.planning.plan import make_plan
from planner.planning.request import PlanRequest
from planner.vehicle.rollout import predicted_poses
from planner.vehicle.tracked_point import TrackedVehicle
from sim.io.errors import InputError

CURVED = 0.84  # below the share up to which a path is followed as it was drawn


def hold(
    place: Sequence[float],
    tracked: TrackedVehicle,
    request: PlanRequest,
    seconds: float | None = None,
    space: FreeSpace | None = None,
    *,
    feedback: bool = False,
    progress: Callable[[float], object] | None = None,
) -> HoldPlan:
    """Plan an orbit about a place.

    Args:
        place: x, y.
        tracked: the vehicle, and the point that stays near the place.
        request: dwells, tolerance.
        seconds: for so long; None: until told otherwise.
        space: what the robot's body must keep clear of.
        feedback: the pose will be measured for a tracker, so the margin is the stated error with feedback.
        progress: called now and then with the share of the path that is done.

    Raises:
        InputError: the place is no pair of finite numbers, the time is not above 0, or the body has no room.
    """
    x, y = _checked(place)
    if seconds is not None and not (math.isfinite(seconds) and seconds > 0):
        raise InputError(f"hold for {seconds:g} s; give a time above 0")
    vehicle, robot = tracked.vehicle, tracked.robot
    current = math.hypot(*vehicle.current.tolist()) / vehicle.speed
    radius = math.hypot(vehicle.pivot_radius * (1 + current) / CURVED, tracked.rod)
    plan = looped(make_plan(_orbit(x, y, radius), tracked, request, progress), request.seed, progress)
    poses = predicted_poses(vehicle, plan.switches)
    body = Footprint.of(robot, 0.0)
    margin = plan.feedback_error if feedback else plan.stated_error
    if space is not None and not space.empty:
        clearance = float(body.clearance(poses, space).min())
        if clearance < margin:
            raise InputError(
                f"there is no room to hold {place_in_lab(x, y, robot)}: the body comes within "
                f"{in_lab(max(clearance, 0.0), robot)} of an obstacle and needs {in_lab(margin, robot)}; move the "
                "place"
            )
    centres = body.centres(poses) - [x, y]
    reach = float((centres**2).sum(-1).max() ** 0.5) + body.radius
    laps = None if seconds is None else math.ceil(seconds / (plan.duration * robot.time_scale))
    return HoldPlan(plan, (x, y), radius, reach, laps)


def _orbit(x: float, y: float, radius: float) -> Path2D:
    return Path2D.of(circle(radius).points + np.array([x, y]), closed=True)


def _checked(place: Sequence[float]) -> tuple[float, float]:
    """Check the place."""
    try:
        x, y = (float(value) for value in place)
    except (TypeError, ValueError):
        x = y = math.nan
    if not max(abs(x), abs(y)) < 1e6:
        raise InputError("the place to hold: give x and y, finite numbers")
    return x, y
