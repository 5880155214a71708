"""Plans for tracks of the pivot that a job has chosen: declared as they are, with ways around obstacles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planner.goal.route import Route
from planner.paths.path import Path2D
from planner.paths.tractrix import Drift, Reference, slips
from planner.paths.units import LONGEST, check_size, in_lab
from planner.planning.declare import Declared
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest, Progress
from planner.planning.solve import Setting, Task, solve
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.zigzag import dwells_for
from sim.arrays import Floats
from sim.io.errors import InputError

_SPACING = 0.02  # l, of the reference's points


def preferred_setting(tracked: TrackedVehicle, request: PlanRequest) -> Setting:
    """Return the vehicle with the dwell that the objective prefers."""
    least = request.least_dwell(tracked.robot)
    return Setting.of(tracked, request.dwell or dwells_for(tracked.vehicle, request.objective, least)[0])


def pivot_poses(places: Floats, courses: Floats, tracked: TrackedVehicle, drift: Drift) -> Floats:
    """Return the pivot's poses (..., 3), place and course, where the tracked point is at places (..., 2)."""
    heading = courses - slips(courses, drift)
    axis = np.stack([np.cos(heading), np.sin(heading)], -1)
    return np.concatenate([places - tracked.rod * axis, courses[..., None]], -1)


def plan_track(
    track: Callable[[Drift], Route], preferred: Setting, request: PlanRequest, progress: Progress | None
) -> Plan[None]:
    """Plan for the pivot's track that a job gives for a drift.

    Raises:
        InputError: the track is too long, or there is no way around an obstacle.
    """
    tracked, space = preferred.tracked, request.space

    def source(setting: Setting) -> Declared:
        reference = Reference.of_pivot(track(setting.drift).poses(_SPACING), tracked.rod, setting.drift)
        return Declared(reference, float(np.abs(reference.curvature).max()))

    drawn = Path2D(source(preferred).reference.p, False)
    if drawn.length > LONGEST:
        length = in_lab(drawn.length, tracked.robot)
        raise InputError(f"the path is {length} long; at most {LONGEST:g} l can be planned")
    check_size(drawn, tracked.robot, tracked.vehicle.turn_radius)
    if space.empty:
        return solve(Task(source=source, drawn=drawn), tracked, request, progress)
    from planner.jobs.detours import Around

    return solve(
        Task(source=source, changes=(Around(tracked, space, drawn),), drawn=drawn), tracked, request, progress
    )
