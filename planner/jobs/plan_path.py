"""A plan for a path with all that may be asked of it: obstacles, a time of arrival, laps."""

from __future__ import annotations

from collections.abc import Callable

from planner.paths.obstacles import FreeSpace
from planner.paths.path import Path2D
from planner.planning.plan import make_plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.tracked_point import TrackedVehicle
from sim.io.errors import InputError


def plan_path(
    drawn: Path2D,
    tracked: TrackedVehicle,
    request: PlanRequest,
    space: FreeSpace,
    arrive_seconds: float | None = None,
    *,
    loop: bool = False,
    feedback: bool = False,
    progress: Callable[[float], object] | None = None,
) -> Plan:
    """Plan for a path; what is not asked for is not loaded.

    Args:
        drawn: the path as drawn, in tail lengths.
        tracked: the vehicle and its tracked point.
        request: corners, dwells, tolerance.
        space: what the robot's body must keep clear of.
        arrive_seconds: the time from start to end, or of a lap; None: as the objective says.
        loop: the schedule repeats.
        feedback: the pose will be measured for a tracker, so the margin is the stated error with feedback.
        progress: called now and then with the share of the path that is done.

    Raises:
        InputError: the path cannot be planned as asked.
    """
    if loop and not drawn.closed:
        raise InputError("a path that repeats is closed; join its end to its start (--closed), or plan it once")
    if arrive_seconds is not None:
        from planner.jobs.arrival_plan import plan_arrival

        plan = plan_arrival(drawn, tracked, request, arrive_seconds, space, feedback=feedback, progress=progress)
    elif space.empty:
        plan = make_plan(drawn, tracked, request, progress)
    else:
        from planner.jobs.clear_plan import plan_clear  # loads SciPy's graphs

        plan = plan_clear(drawn, tracked, request, space, feedback=feedback, progress=progress)
    if not loop:
        return plan
    from planner.jobs.laps import looped

    return looped(plan, request.seed, progress)
