"""Plans for a path that take a given time: see `planner.goal.arrive`. Times in μ0 l⁴/EI, lengths in l."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from planner.goal.arrive import arrive
from planner.goal.swings import swung_clear
from planner.jobs.clear_plan import Clearing, plan_redirected
from planner.paths.distance import two_sided
from planner.paths.obstacles import FreeSpace
from planner.paths.path import Path2D
from planner.paths.tractrix import Drift
from planner.planning.declared_path import Declared
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.tracked_point import TrackedVehicle


def plan_arrival(
    drawn: Path2D,
    tracked: TrackedVehicle,
    request: PlanRequest,
    seconds: float,
    space: FreeSpace | None = None,
    *,
    feedback: bool = False,
    progress: Callable[[float], object] | None = None,
) -> Plan:
    """Plan for a path, so that the robot is at its end after a given time.

    Args:
        drawn: the path as drawn.
        tracked: the vehicle and its tracked point.
        request: corners, dwells, tolerance.
        seconds: from the start to the end.
        space: what the robot's body must keep clear of.
        feedback: the pose will be measured for a tracker, so the margin is the stated error with feedback.
        progress: called now and then with the share of the path that is done.

    Raises:
        InputError: the path cannot be planned, the time is below that of the fastest plan, or there is no room for
            a swing.
    """
    space = FreeSpace() if space is None else space
    clearing = Clearing(drawn, tracked, space, feedback=feedback)
    margin = 0.0

    def plan_with(asked: PlanRequest, longer: float) -> Plan:
        nonlocal margin

        def redirect(declare: Callable[[], Declared], drift: Drift, follow: Callable[[Declared], Plan]) -> Plan:
            def declared() -> Declared:
                return _with_swing(declare(), drawn, longer, tracked, drift, space, margin)

            return follow(declared()) if space.empty else clearing.redirect(declared, drift, follow)

        plan = plan_redirected(drawn, tracked, asked, redirect, progress)
        if not longer and plan.kept_clear is not None:
            margin = plan.kept_clear.margin
        return plan

    plan, arrival = arrive(seconds, tracked, request, plan_with, lambda plan: plan)
    return replace(plan, arrival=arrival)


def _with_swing(
    declared: Declared,
    drawn: Path2D,
    longer: float,
    tracked: TrackedVehicle,
    drift: Drift,
    space: FreeSpace,
    margin: float,
) -> Declared:
    """Add a swing to a declared path."""
    if not longer:
        return declared
    reference, swing = swung_clear(declared.reference, longer, tracked, drift, space, margin)
    off_drawn, missed = two_sided(reference.p, drawn.polyline())
    return replace(declared, reference=reference, off_drawn=off_drawn, missed=missed, swing=swing)
