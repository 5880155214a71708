"""arrive(task, …): a plan that takes a given time.

1. No plan is faster than that of the objective "time": an earlier wish is refused.
2. A robot whose motor flips more often loses more speed to the turn-over of its tails; one that swings further to
   both sides loses speed, too. So the shortest dwell is changed until the plan takes the time that was asked for.
   Where a shorter and a longer one would do, the one with the smaller stated error is taken.
3. Where no dwell makes the robot slow enough, or keeps the tolerance, the track gets a swing with waiting circles
   (`planner.goal.swings`), at the dwell that the objective chooses.

The duration is nearly linear in what is changed: the inverse of the net speed, or the length of the swing. The
secant method meets the wish to EXACT of it, or to half of a dwell. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from planner.paths.units import in_lab
from planner.planning.conditions import Arrival
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest, Progress
from planner.planning.solve import Task, by_dwell
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.zigzag import check_least, longest_dwell, net_speeds
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.units import format_time

EXACT = 5e-4  # of the wish
MISSED = 2e-3  # of the wish, or a dwell: a plan that is further off is refused
_STEPS = 8  # plans that are tried for one way to take time
_SAME = 1.001  # a ratio of dwells below which they are the same
_GRID = 200  # dwells whose net speeds are compared


def arrive(
    task: Task, tracked: TrackedVehicle, request: PlanRequest, progress: Progress | None = None
) -> Plan[None]:
    """Plan for the duration that a request asks for.

    Raises:
        InputError: the duration is below that of the fastest plan, or there is no room for a swing.
    """
    seconds = request.arrive_seconds or 0.0
    if not (math.isfinite(seconds) and seconds > 0):
        raise InputError(f"arrival after {seconds:g} s; give a time above 0")
    search = _Arriving(seconds / tracked.robot.time_scale, task, tracked, request, progress)
    fastest = search.plan(replace(request, objective="time"))
    early = fastest.duration - search.wished
    if early > search.near(fastest):
        raise InputError(
            f"arrival after {search.words(search.wished)}: the fastest plan takes "
            f"{search.words(fastest.duration)}; allow at least that"
        )
    timed = [fastest] if abs(early) <= search.near(fastest) else search.by_dwells(fastest)
    best = min(timed, key=lambda plan: plan.stated_error) if timed else search.by_swing()
    return replace(best, arrival=Arrival(search.wished, fastest.duration))


@dataclass(frozen=True)
class _Arriving:
    """A duration, and what takes it."""

    wished: float
    task: Task
    tracked: TrackedVehicle
    request: PlanRequest
    progress: Progress | None

    def plan(self, request: PlanRequest, longer: float = 0.0) -> Plan[None]:
        """Plan with another dwell, or a length that a swing adds."""
        return by_dwell(self.task, self.tracked, request, longer, self.progress)

    def near(self, plan: Plan[None]) -> float:
        """Return how far from the wish a plan may be without being changed further."""
        return max(EXACT * self.wished, _dwell(plan) / 2)

    def words(self, time: float) -> str:
        return format_time(time * self.tracked.robot.time_scale)

    def by_dwells(self, fastest: Plan[None]) -> list[Plan[None]]:
        """Find shorter and longer dwells with which a plan takes the time and keeps the tolerance."""
        if self.request.dwell is not None:
            return []
        vehicle, tolerance = self.tracked.vehicle, self.request.tolerance
        least = check_least(self.request.least_dwell(self.tracked.robot))
        best, slow = _dwell(fastest), self.wished / fastest.duration
        timed = []
        for end in (least, longest_dwell(vehicle, least)):
            if max(end / best, best / end) < _SAME:
                continue
            grid = np.geomspace(best, end, _GRID)
            speeds = np.maximum(net_speeds(vehicle, grid), 1e-12)
            slowness = np.maximum.accumulate(speeds[0] / speeds) + 1e-9 * np.arange(_GRID)

            def plan_at(slow: float, grid: Floats = grid, slowness: Floats = slowness) -> Plan[None]:
                dwell = float(np.interp(slow, slowness, grid))
                return self.plan(replace(self.request, dwell=dwell, tolerance=None))

            met = self._met(plan_at, fastest, (1.0, slow), (1.0, float(slowness[-1])))
            if met is not None and (tolerance is None or met.stated_error <= tolerance):
                timed.append(met)
        return timed

    def by_swing(self) -> Plan[None]:
        """Add a swing to the plan that the objective prefers.

        Raises:
            InputError: there is no room, or the tolerance is not kept.
        """
        request, robot = self.request, self.tracked.robot
        own = self.plan(request)
        fixed = replace(request, dwell=_dwell(own), tolerance=None)
        longer = (self.wished - own.duration) * float(np.abs(self.tracked.vehicle.twist[:, 0]).mean())
        met = self._met(lambda length: self.plan(fixed, length), own, (0.0, longer), (1e-3 * longer, 2 * longer))
        if met is None:
            raise InputError(
                f"no plan takes {self.words(self.wished)}: the plan without swings takes "
                f"{self.words(own.duration)}, and swings do not meet the time; change it a little"
            )
        if request.tolerance is not None and met.stated_error > request.tolerance:
            raise InputError(
                f"tolerance {in_lab(request.tolerance, robot)} cannot be kept with this arrival: the stated error "
                f"is {in_lab(met.stated_error, robot)}; allow more"
            )
        return met

    def _met(
        self,
        plan_at: Callable[[float], Plan[None]],
        first: Plan[None],
        values: tuple[float, float],
        limits: tuple[float, float],
    ) -> Plan[None] | None:
        """Find a plan that takes the time by the secant method; None where there is none.

        Args:
            plan_at: plans with a value.
            first: the plan with the first value.
            values: the first value, and the next one that is tried.
            limits: between which values are.
        """
        best, least = first, math.inf
        (before, value), late = values, first.duration - self.wished
        for _ in range(_STEPS):
            value = min(max(value, limits[0]), limits[1])
            candidate = plan_at(value)
            later = candidate.duration - self.wished
            if abs(later) < least:
                best, least = candidate, abs(later)
            if least <= self.near(best) or later == late or value == before:
                break
            before, value, late = value, value - later * (value - before) / (later - late), later
        return best if least <= max(MISSED * self.wished, _dwell(best)) else None


def _dwell(plan: Plan[None]) -> float:
    """Return the shortest dwell that a plan was made for."""
    return min(plan.straight.dwells)
