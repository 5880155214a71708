"""arrive(seconds, …): a plan that takes a given time.

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
from dataclasses import replace
from typing import Generic, TypeVar

import numpy as np

from planner.paths.units import in_lab
from planner.planning.arrival import Arrival
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.dwell_choice import check_least, longest_dwell, net_speeds
from planner.vehicle.tracked_point import TrackedVehicle
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.units import format_time
from sim.model.robot import Robot

EXACT = 5e-4  # of the wish
MISSED = 2e-3  # of the wish, or a dwell: a plan that is further off is refused
_STEPS = 8  # plans that are tried for one way to take time
_SAME = 1.001  # a ratio of dwells below which they are the same
_GRID = 200  # dwells whose net speeds are compared

Timed = TypeVar("Timed")  # a plan, or a plan from pose to pose


def arrive(
    seconds: float,
    tracked: TrackedVehicle,
    request: PlanRequest,
    plan_with: Callable[[PlanRequest, float], Timed],
    plan_of: Callable[[Timed], Plan],
) -> tuple[Timed, Arrival]:
    """Plan for a duration.

    Args:
        seconds: the duration.
        tracked: the vehicle.
        request: dwells, tolerance.
        plan_with: plans for a request and a length that a swing adds.
        plan_of: the plan in what `plan_with` returns.

    Raises:
        InputError: the wish is below the fastest plan, or there is no room for a swing.
    """
    if not (math.isfinite(seconds) and seconds > 0):
        raise InputError(f"arrival after {seconds:g} s; give a time above 0")
    wished = seconds / tracked.robot.time_scale
    task = _Arriving(wished, tracked, request, plan_with, plan_of)
    fastest = plan_with(replace(request, objective="time"), 0.0)
    least = plan_of(fastest).duration
    if wished < least - task.near(fastest):
        raise InputError(
            f"arrival after {_time(wished, tracked.robot)}: the fastest plan takes {_time(least, tracked.robot)}; "
            "allow at least that"
        )
    arrival = Arrival(wished, least)
    timed = [fastest] if abs(wished - least) <= task.near(fastest) else task.by_dwells(fastest)
    if timed:
        return min(timed, key=lambda candidate: plan_of(candidate).stated_error), arrival
    return task.by_swing(), arrival


class _Arriving(Generic[Timed]):
    """A duration, and plans that are tried for it."""

    def __init__(
        self,
        wished: float,
        tracked: TrackedVehicle,
        request: PlanRequest,
        plan_with: Callable[[PlanRequest, float], Timed],
        plan_of: Callable[[Timed], Plan],
    ):
        self._wished, self._tracked, self._request = wished, tracked, request
        self._plan_with, self._plan_of = plan_with, plan_of

    def near(self, candidate: Timed) -> float:
        """Return how far from the wish a plan may be without being changed further."""
        return max(EXACT * self._wished, self._dwell(candidate) / 2)

    def by_dwells(self, fastest: Timed) -> list[Timed]:
        """Find shorter and longer dwells with which a plan takes the time and keeps the tolerance."""
        if self._request.dwell is not None:
            return []
        vehicle, request = self._tracked.vehicle, self._request
        least = check_least(request.least_dwell(self._tracked.robot))
        best = self._dwell(fastest)
        timed = []
        for end in (least, longest_dwell(vehicle, least)):
            if max(end / best, best / end) < _SAME:
                continue
            grid = np.geomspace(best, end, _GRID)
            speeds = np.maximum(net_speeds(vehicle, grid), 1e-12)
            slowness = np.maximum.accumulate(speeds[0] / speeds) + 1e-9 * np.arange(_GRID)

            def plan_at(slow: float, grid: Floats = grid, slowness: Floats = slowness) -> Timed:
                dwell = float(np.interp(slow, slowness, grid))
                return self._plan_with(replace(request, dwell=dwell, tolerance=None), 0.0)

            slow = self._wished / self._plan_of(fastest).duration
            met = self._met(plan_at, fastest, (1.0, slow), (1.0, float(slowness[-1])))
            if met is None:
                continue
            if request.tolerance is None or self._plan_of(met).stated_error <= request.tolerance:
                timed.append(met)
        return timed

    def by_swing(self) -> Timed:
        """Add a swing to the plan that the objective prefers.

        Raises:
            InputError: there is no room, or the tolerance is not kept.
        """
        robot, request = self._tracked.robot, self._request
        own = self._plan_with(request, 0.0)
        fixed = replace(request, dwell=self._dwell(own), tolerance=None)
        speed = float(np.abs(self._tracked.vehicle.twist[:, 0]).mean())
        longer = (self._wished - self._plan_of(own).duration) * speed
        met = self._met(
            lambda length: self._plan_with(fixed, length), own, (0.0, longer), (1e-3 * longer, 2 * longer)
        )
        if met is None:
            raise InputError(
                f"no plan takes {_time(self._wished, robot)}: the plan without swings takes "
                f"{_time(self._plan_of(own).duration, robot)}, and swings do not meet the time; change it a little"
            )
        stated = self._plan_of(met).stated_error
        if request.tolerance is not None and stated > request.tolerance:
            raise InputError(
                f"tolerance {in_lab(request.tolerance, robot)} cannot be kept with this arrival: the stated error "
                f"is {in_lab(stated, robot)}; allow more"
            )
        return met

    def _met(
        self,
        plan_at: Callable[[float], Timed],
        first: Timed,
        values: tuple[float, float],
        limits: tuple[float, float],
    ) -> Timed | None:
        """Find a plan that takes the time by the secant method; None where there is none.

        Args:
            plan_at: plans with a value.
            first: the plan with the first value.
            values: the first value, and the next one that is tried.
            limits: between which values are.
        """
        best, least = first, math.inf
        (before, value), late = values, self._late(first)
        for _ in range(_STEPS):
            value = min(max(value, limits[0]), limits[1])
            candidate = plan_at(value)
            later = self._late(candidate)
            if abs(later) < least:
                best, least = candidate, abs(later)
            if least <= self.near(best) or later == late or value == before:
                break
            before, value, late = value, value - later * (value - before) / (later - late), later
        return best if least <= max(MISSED * self._wished, self._dwell(best)) else None

    def _late(self, candidate: Timed) -> float:
        return self._plan_of(candidate).duration - self._wished

    def _dwell(self, candidate: Timed) -> float:
        """Return the shortest dwell that a plan was made for."""
        return min(self._plan_of(candidate).straight.dwells)


def _time(value: float, robot: Robot) -> str:
    return format_time(value * robot.time_scale)
