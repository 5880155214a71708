"""From a request to a plan: one solver for all jobs.

1. A task's source gives a declared path for a trial: the vehicle with one shortest dwell, and a margin.
2. Where obstacles block it, ways around them change it.
3. Line-of-sight guidance follows the path, which gives the schedule, and its errors are computed
   (`_followed`).
4. Where there are obstacles, the margin grows until it covers the stated error (`at_dwell`).
5. The objective chooses the shortest dwell. Where the path is blocked or the tolerance is not kept, others are
   tried (`solve`).

Errors are distances of the tracked point from the declared path. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from common.errors import InputError
from planner.guidance.line_of_sight import Guidance, Start, follow, guaranteed, look_ahead
from planner.paths.obstacles import FreeSpace
from planner.paths.path import Path2D
from planner.paths.tractrix import Drift
from planner.paths.units import in_lab, time_in_lab
from planner.planning.conditions import BlockedError, KeptClear
from planner.planning.declare import FeasiblePath
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from planner.planning.stated_error import plan_errors
from planner.progress import ProgressCallback
from planner.vehicle.from_table import OWN_TABLE
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.vehicle import Switches
from planner.vehicle.zigzag import Zigzag, check_least, dwells_for, longer_dwells, nearly_fastest, zigzag

_MARGINS = 6  # tried for each dwell
_MORE = 1.05  # times the stated error is the next margin
_GROWS = 1.02  # or times the margin before
_OTHERS = 4  # longer, and shorter dwells that are tried where the path is blocked
_WORTH = 0.8  # of the stated error: a longer dwell, which swings further, must leave at most this
_LENGTHENED_FROM = 1.2  # stated error over predicted error, below which fewer flips gain nothing
_SAVED = 3.0  # dwells that corners and the end of a path may save


class Trial(NamedTuple):
    """A vehicle with one shortest dwell, and what its reference keeps to. Lengths in l, times in μ0 l⁴/EI."""

    tracked: TrackedVehicle
    dwell: float
    straight: Zigzag
    drift: Drift
    margin: float | None = None  # around the body; None: no error is known yet

    @staticmethod
    def of(tracked: TrackedVehicle, dwell: float) -> Trial:
        """Compute straight motion and drift with a shortest dwell.

        Raises:
            InputError: with such dwells the robot does not get ahead.
        """
        straight = zigzag(tracked.vehicle, dwell, tracked.offset)
        return Trial(tracked, dwell, straight, tracked.drift(straight))

    def guidance(self, declared: FeasiblePath) -> Guidance:
        """Choose look-ahead and hysteresis for a declared path."""
        ahead = look_ahead(self.tracked.vehicle, declared.curvature, self.straight)
        return Guidance(self.dwell, ahead, self.straight.hysteresis(ahead))


Change = Callable[[FeasiblePath, Trial], FeasiblePath]  # transforms a reference, or returns its argument
Ending = Callable[[Switches, FeasiblePath, Trial], Switches]  # changes the last dwells


@dataclass(frozen=True, kw_only=True)
class PathTask:
    """What is to be followed."""

    source: Callable[[Trial], FeasiblePath]  # where the reference comes from
    avoid: Change | None = None  # keeps it clear of obstacles
    drawn: Path2D | None = None  # None: the declared path counts as drawn
    start: Callable[[FeasiblePath], Start] | None = None  # None: at rest on the path
    finish: Ending | None = None
    zigzags: float | None = None  # first margin over the zigzag; None: first there is no margin
    try_longer: bool = True  # longer dwells are tried, too: for a small error, and where the path is blocked
    quickest: bool = False  # for the shortest time, the path is followed with several dwells
    blocked: type[BlockedError] = BlockedError

    def declared(self, trial: Trial) -> FeasiblePath:
        """Declare a path, with ways around what blocks it."""
        declared = self.source(trial)
        return declared if self.avoid is None else self.avoid(declared, trial)


def _followed(
    task: PathTask, declared: FeasiblePath, trial: Trial, request: PlanRequest, progress: ProgressCallback | None
) -> Plan[None]:
    """Follow a declared path, and compute the errors; from a start away from the path none is guaranteed."""
    tracked, straight = trial.tracked, trial.straight
    vehicle, guidance = tracked.vehicle, trial.guidance(declared)
    drawn = task.drawn or Path2D(declared.reference.p, False)
    start = task.start(declared) if task.start else None
    switches = follow(declared.reference, vehicle, guidance, tracked.offset, start=start, progress=progress)
    if task.finish is not None:
        switches = task.finish(switches, declared, trial)
        guidance = guidance._replace(dwell=min(guidance.dwell, float(switches.dwells.min())))
    bound = None if start else guaranteed(vehicle, tracked.rod, straight.swing, guidance.ahead)
    errors = plan_errors(tracked, drawn, declared, switches, guaranteed=bound, seed=request.seed,
                         progress=progress)  # fmt: skip
    return Plan(tracked, request, drawn, declared, straight, guidance, switches, errors)


def at_dwell(
    task: PathTask,
    tracked: TrackedVehicle,
    request: PlanRequest,
    dwell: float,
    progress: ProgressCallback | None = None,
) -> Plan[None]:
    """Plan with one shortest dwell; the margin grows until it covers the error that the plan states.

    Args:
        task: what is to be followed.
        tracked: the vehicle.
        request: what the plan is asked for.
        dwell: the shortest dwell.
        progress: called now and then with the share of the path that is done.

    Raises:
        BlockedError: there is no such plan.
    """
    trial, space = Trial.of(tracked, dwell), request.space
    if task.zigzags and not space.empty:
        trial = trial._replace(margin=task.zigzags * trial.straight.largest)
    plan: Plan[None] | None = None
    for _ in range(_MARGINS + (trial.margin is None)):
        declared = task.declared(trial)
        if plan is None or not declared.same(plan.declared):
            plan = _followed(task, declared, trial, request, progress)
        if space.empty:
            return plan
        needed, margin = plan.margin_needed, trial.margin
        if margin is not None and needed <= margin and (clearance := plan.clearance(space)) > 0:
            return replace(plan, kept_clear=KeptClear(space, margin, clearance, declared.detours))
        trial = trial._replace(margin=max(_MORE * needed, _GROWS * (margin or 0.0)))
    raise task.blocked(
        f"there is no way that leaves the plan's stated error around the robot: it is "
        f"{in_lab(needed, tracked.robot)}; plan with feedback, make a table of this robot ({OWN_TABLE}), or move "
        "the path, the goal or the obstacles"
    )


def solve(
    task: PathTask, tracked: TrackedVehicle, request: PlanRequest, progress: ProgressCallback | None = None
) -> Plan[None]:
    """Plan for a task with the dwell that the objective chooses; where the path is blocked, with others.

    With the objective "error" the dwell is that of the path without obstacles. For the least stated error among
    the ways around, a dwell would be best whose error is so large that its way leaves out most of the path.

    Raises:
        BlockedError: there is no way around what blocks the path.
        InputError: the path cannot be followed, or no dwell keeps the tolerance.
    """
    vehicle, plan = tracked.vehicle, None
    at = partial(at_dwell, task, tracked, request, progress=progress)
    if request.dwell is not None:
        dwells = [check_least(request.dwell)]
        others: list[float] = []
    else:
        least = request.least_dwell(tracked.robot)
        dwells = dwells_for(vehicle, request.objective, least)
        if task.quickest and request.objective == "time":
            fastest = _quickest(task, tracked, dwells[0], least)
            dwells = [fastest, *(dwell for dwell in dwells if dwell < fastest)]
        shorter = np.unique(np.linspace(0, len(dwells) - 1, _OTHERS + 1).astype(int)).tolist()
        others = [
            *(longer_dwells(vehicle, dwells[0])[:_OTHERS] if task.try_longer else ()),
            *(dwells[k] for k in shorter),
        ]
    first = dwells[0]
    if task.try_longer and request.objective == "error" and request.dwell is None:
        free, unhindered = replace(task, avoid=None), replace(request, space=FreeSpace())
        with suppress(*([] if request.space.empty else [InputError])):  # there may be a way around the tight place
            plan = _least_stated(partial(at_dwell, free, tracked, unhindered, progress=progress), tracked, first)
            first = plan.minimum_dwell
    if plan is None or not request.space.empty:
        plan = _first_clear(at, [first, *(dwell for dwell in others if dwell != first)])
    if request.tolerance is None or plan.stated_error <= request.tolerance:
        return plan
    return _shortened(plan, dwells, at, request.tolerance)


def _quickest(task: PathTask, tracked: TrackedVehicle, fastest: float, least: float | None) -> float:
    """Choose the dwell with which a declared path takes the least time.

    Shorter dwells are tried until they cost more time than corners and the end may save.

    Args:
        task: gives the declared path.
        tracked: the vehicle and its tracked point.
        fastest: the dwell with which straight motion is the fastest.
        least: the shortest dwell that the motor allows.
    """
    declared = task.declared(Trial.of(tracked, fastest))
    times: dict[float, float] = {}
    for dwell in nearly_fastest(tracked.vehicle, least):
        with suppress(InputError):  # too long for this path
            guidance = Trial.of(tracked, dwell).guidance(declared)
            switches = follow(declared.reference, tracked.vehicle, guidance, tracked.offset)
            times[dwell] = float(switches.dwells.sum())
            if times[dwell] > min(times.values()) + _SAVED * fastest:
                break
    return min(times, key=lambda dwell: times[dwell], default=fastest)


def _least_stated(at: Callable[[float], Plan[None]], tracked: TrackedVehicle, dwell: float) -> Plan[None]:
    """Lengthen the dwells where this makes the stated error smaller by a fifth or more.

    What is uncertain of each flip adds up, so it shrinks with their number. The predicted error grows with the
    dwell; where it alone is above the best stated error, longer dwells cannot be better.
    """
    best = at(dwell)
    if best.stated_error < _LENGTHENED_FROM * best.predicted_max:
        return best
    for longer in longer_dwells(tracked.vehicle, dwell):
        try:
            candidate = at(longer)
        except InputError:  # too long for this path
            break
        if candidate.predicted_max >= best.stated_error:
            break
        if candidate.stated_error < _WORTH * best.stated_error:
            best = candidate
    return best


def _first_clear(at: Callable[[float], Plan[None]], dwells: list[float]) -> Plan[None]:
    """Plan with the first dwell for which there is a way.

    Raises:
        BlockedError: there is none for any of them.
    """
    refusal: BlockedError | None = None
    for dwell in dwells:
        try:
            return at(dwell)
        except BlockedError as blocked:
            refusal = refusal or blocked
            if blocked.hopeless:
                break
    assert refusal is not None
    raise refusal


def _shortened(
    first: Plan[None], dwells: list[float], at: Callable[[float], Plan[None]], tolerance: float
) -> Plan[None]:
    """Halve between the first dwell, which is too long, and the shortest one, until the tolerance is kept.

    Raises:
        InputError: no dwell that was tried keeps the tolerance.
    """
    best, kept = first, None
    low, high = 0, len(dwells)
    while high - low > 1:
        middle = (low + high) // 2
        try:
            candidate = at(dwells[middle])
        except BlockedError:
            low = middle
            continue
        best = min(best, candidate, key=lambda plan: plan.stated_error)
        if candidate.stated_error <= tolerance:
            kept, high = candidate, middle
        else:
            low = middle
    if kept is None:
        robot = first.robot
        raise InputError(
            f"tolerance {in_lab(tolerance, robot)} cannot be kept: the smallest stated error is "
            f"{in_lab(best.stated_error, robot)}, with dwells from {time_in_lab(best.minimum_dwell, robot)}; "
            f"allow more, or make a table of this robot with {OWN_TABLE}"
        )
    return kept
