"""From a path to a frozen plan, without simulating.

The look-up table gives the vehicle: both directions, and the memory of the last dwell
(`planner.vehicle.from_table`). The path that the robot can follow and that is nearest to the drawn one is declared
(`planner.planning.declare`). Its tractrix is the pivot's reference (`planner.paths.tractrix`).
`planner.planning.solve` follows it. What is not asked for is not loaded.
"""

from __future__ import annotations

from functools import cache

from planner.paths.path import Path2D
from planner.paths.tractrix import Drift
from planner.paths.units import check_size
from planner.planning.declare import declare
from planner.planning.feasible import Declared, Feasibility
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest, Progress
from planner.planning.solve import Change, Task, solve
from planner.vehicle.tracked_point import TrackedVehicle
from sim.io.errors import InputError


def make_plan(
    drawn: Path2D, tracked: TrackedVehicle, request: PlanRequest, progress: Progress | None = None
) -> Plan[None]:
    """Plan for a path [l] that the tracked point follows, see `planner.api.plan`."""
    if request.loop and not drawn.closed:
        raise InputError("a path that repeats is closed; join its end to its start (--closed), or plan it once")
    check_size(drawn, tracked.robot, tracked.vehicle.turn_radius)

    @cache
    def nearest(drift: Drift) -> Declared:
        vehicle, corner = tracked.vehicle, request.corner
        feasibility = Feasibility(tracked.robot, vehicle, tracked.rod, drift, corner, request.time_weight)
        return declare(drawn, feasibility, progress)

    changes: list[Change] = []
    if request.arrive_seconds is not None:
        from planner.goal.swings import Delay

        changes.append(Delay(request.space, drawn))
    if not request.space.empty:
        from planner.jobs.detours import Around  # loads SciPy's graphs

        changes.append(Around(tracked, request.space, drawn))
    task = Task(
        source=lambda setting: nearest(setting.drift), changes=tuple(changes), drawn=drawn, quickest=not changes
    )
    once = solve(task, tracked, request, progress)
    if not request.loop:
        return once
    from planner.goal.last_dwells import looped

    return looped(once, progress)
