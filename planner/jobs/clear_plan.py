"""Plans for a path that keep clear of obstacles.

The path that the robot can follow is declared first, as for every plan. Where obstacles block it, ways around
replace it (`planner.jobs.detours`). The margin around the robot's body is at least the stated error of the plan,
which is known only when the plan is made. So the path is planned again with a larger margin until the two agree.
If that leads to no plan, longer dwells are tried, whose flips add up to less, and shorter ones, which swing less.
Lengths in l.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from planner.jobs.detours import BlockedError, Detours
from planner.paths.distance import two_sided
from planner.paths.obstacles import Footprint, FreeSpace
from planner.paths.path import Path2D
from planner.paths.tractrix import Drift, Reference
from planner.paths.units import in_lab
from planner.planning.declared_path import Declared
from planner.planning.kept_clear import Detour, KeptClear
from planner.planning.plan import Redirect, make_plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.coefficient_modes import OWN_TABLE
from planner.vehicle.dwell_choice import dwells_for, longer_dwells
from planner.vehicle.rollout import predicted_poses
from planner.vehicle.tracked_point import TrackedVehicle
from sim.io.errors import InputError

_MARGINS = 6  # tried for each dwell
_MORE = 1.05  # times the stated error is the next margin
_DWELLS = 4  # longer and shorter dwells that are tried


def plan_clear(
    drawn: Path2D,
    tracked: TrackedVehicle,
    request: PlanRequest,
    space: FreeSpace,
    *,
    feedback: bool = False,
    progress: Callable[[float], object] | None = None,
) -> Plan:
    """Plan for a path that keeps clear of walls and regions.

    Args:
        drawn: the path as drawn.
        tracked: the vehicle and its tracked point.
        request: corners, dwells, tolerance.
        space: what the robot's body must keep clear of.
        feedback: the pose will be measured for a tracker, so the margin is the stated error with feedback.
        progress: called now and then with the share of the path that is done.

    Raises:
        InputError: the path cannot be planned, or there is no way around what blocks it.
    """
    if space.empty:
        return make_plan(drawn, tracked, request, progress)
    clearing = Clearing(drawn, tracked, space, feedback=feedback)
    return plan_redirected(drawn, tracked, request, clearing.redirect, progress)


def plan_redirected(
    drawn: Path2D,
    tracked: TrackedVehicle,
    request: PlanRequest,
    redirect: Redirect,
    progress: Callable[[float], object] | None = None,
) -> Plan:
    """Plan with the dwell that the objective chooses; where the path is blocked, with longer and shorter ones.

    With the objective "error" the dwell is that of the path without obstacles. For the least stated error among
    the ways around, a dwell would be best whose error is so large that its way leaves out most of the path.

    Raises:
        BlockedError: there is no way around what blocks the path.
    """
    chosen = request
    if request.dwell is None and request.tolerance is None and request.objective == "error":
        with suppress(InputError):  # a path that cannot be followed itself may have a way around
            chosen = replace(request, dwell=make_plan(drawn, tracked, request, progress).minimum_dwell)
    try:
        return make_plan(drawn, tracked, chosen, progress, redirect)
    except BlockedError as blocked:
        if blocked.hopeless or request.dwell is not None:
            raise
        refusal = blocked
    dwells = dwells_for(tracked.vehicle, request.objective, request.least_dwell(tracked.robot))
    shorter = np.unique(np.linspace(0, len(dwells) - 1, _DWELLS).astype(int))[chosen is request :]
    longer = longer_dwells(tracked.vehicle, dwells[0])[:_DWELLS]
    for dwell in (*longer, *(dwells[place] for place in shorter.tolist())):
        try:
            return make_plan(drawn, tracked, replace(request, dwell=dwell), progress, redirect)
        except BlockedError:
            continue
    raise refusal


@dataclass
class Clearing:
    """Replaces a declared path by one that keeps clear, and plans for it."""

    drawn: Path2D
    tracked: TrackedVehicle
    space: FreeSpace
    feedback: bool = field(kw_only=True)
    detours: dict[Drift, Detours] = field(default_factory=dict)

    def redirect(self, declare: Callable[[], Declared], drift: Drift, follow: Callable[[Declared], Plan]) -> Plan:
        """Plan with larger and larger margins, until the margin is at least the stated error.

        Raises:
            BlockedError: there is no such plan.
        """
        around = self.detours.setdefault(drift, Detours(self.tracked, self.space, drift))
        body = Footprint.of(self.tracked.robot, 0.0)
        declared, margin = declare(), 0.0
        plan = follow(declared)
        for _ in range(_MARGINS):
            margin = max(_MORE * self._needed(plan), 1.02 * margin)
            reference, detours = self._around(around, declared, margin)
            if detours:
                plan = follow(redeclared(declared, reference, self.drawn))
            poses = predicted_poses(self.tracked.vehicle, plan.switches)
            clearance = float(body.clearance(poses, self.space).min())
            if self._needed(plan) <= margin and clearance > 0:
                return replace(plan, kept_clear=KeptClear(self.space, margin, clearance, detours))
        stated = in_lab(self._needed(plan), self.tracked.robot)
        raise BlockedError(
            f"no way around leaves the stated error, {stated}, around the robot; plan with feedback, or "
            f"make a table of this robot ({OWN_TABLE})"
        )

    def _around(self, around: Detours, declared: Declared, margin: float) -> tuple[Reference, tuple[Detour, ...]]:
        """Find ways around; where there are none, find out whether there are any without a margin."""
        try:
            return around.around(declared.reference, margin)
        except BlockedError as blocked:
            try:
                around.around(declared.reference, 0.0)
            except BlockedError:
                blocked.hopeless = True
            raise

    def _needed(self, plan: Plan) -> float:
        """Return the error that the margin must cover."""
        return plan.feedback_error if self.feedback else plan.stated_error


def redeclared(declared: Declared, reference: Reference, drawn: Path2D) -> Declared:
    """Declare a reference in place of the nearest one."""
    off_drawn, missed = two_sided(reference.p, drawn.polyline())
    curvature = float(np.abs(reference.curvature).max())
    return replace(declared, reference=reference, curvature=curvature, off_drawn=off_drawn, missed=missed)
