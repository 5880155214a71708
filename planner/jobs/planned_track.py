"""Plans for tracks of the pivot that a job has chosen: declared as they are, with ways around obstacles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planner.goal.route import Route
from planner.jobs.clear_plan import Clearing, plan_redirected
from planner.paths.obstacles import FreeSpace
from planner.paths.path import Path2D
from planner.paths.tractrix import Drift, Reference, slips
from planner.paths.units import LONGEST, in_lab
from planner.planning.declared_path import Declared
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.tracked_point import TrackedVehicle
from sim.arrays import Floats
from sim.io.errors import InputError

_SPACING = 0.02  # l, of the reference's points


def pivot_poses(places: Floats, courses: Floats, tracked: TrackedVehicle, drift: Drift) -> Floats:
    """Return the pivot's poses (..., 3), place and course, where the tracked point is at places (..., 2)."""
    heading = courses - slips(courses, drift)
    axis = np.stack([np.cos(heading), np.sin(heading)], -1)
    return np.concatenate([places - tracked.rod * axis, courses[..., None]], -1)


def plan_track(
    tracked: TrackedVehicle,
    request: PlanRequest,
    space: FreeSpace,
    track: Callable[[Drift], Route],
    drift: Drift,
    *,
    feedback: bool,
    progress: Callable[[float], object] | None,
) -> Plan:
    """Plan for the track that a job gives for a drift.

    Args:
        tracked: the vehicle and its tracked point.
        request: dwells, tolerance.
        space: what the robot's body must keep clear of.
        track: the pivot's track with a drift.
        drift: that with the dwell that the objective prefers.
        feedback: the pose will be measured for a tracker.
        progress: called now and then with the share of the path that is done.

    Raises:
        InputError: the track is too long, or there is no way around an obstacle.
    """

    def declared(drift: Drift) -> Declared:
        reference = Reference.of_pivot(track(drift).poses(_SPACING), tracked.rod, drift)
        return Declared(reference, float(np.abs(reference.curvature).max()), 0.0, 0.0, ())

    drawn = Path2D(declared(drift).reference.p, False)
    if drawn.length > LONGEST:
        length = in_lab(drawn.length, tracked.robot)
        raise InputError(f"the path is {length} long; at most {LONGEST:g} l can be planned")
    clearing = Clearing(drawn, tracked, space, feedback=feedback)

    def redirect(_: Callable[[], Declared], drift: Drift, follow: Callable[[Declared], Plan]) -> Plan:
        if space.empty:
            return follow(declared(drift))
        return clearing.redirect(lambda: declared(drift), drift, follow)

    return plan_redirected(drawn, tracked, request, redirect, progress)
