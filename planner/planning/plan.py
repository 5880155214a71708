"""plan(path, robot): from a path to a frozen plan, without simulating.

1. The look-up table gives the vehicle: both directions, and the memory of the last dwell
   (`planner.vehicle.from_table`).
2. The objective chooses the shortest dwell (`planner.vehicle.dwell_choice`). For the shortest time, the path is
   followed with several.
3. The path that the robot can follow and that is nearest to the drawn one is declared
   (`planner.planning.declared_path`). Its tractrix is the pivot's reference (`planner.paths.tractrix`).
4. Line-of-sight guidance with hysteresis gives the dwells (`planner.planning.schedule`).
5. The errors of this schedule are computed (`planner.planning.errors`). If the stated error is above the
   tolerance, shorter dwells are tried.

Errors are distances of the tracked point from the declared path. The distance between the declared and the drawn
path is reported from both sides.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from planner.paths.path import Path2D
from planner.paths.tractrix import Drift
from planner.paths.units import check_size, in_lab, time_in_lab
from planner.planning.declared_path import Declared, declare
from planner.planning.errors import plan_errors
from planner.planning.feasible import Feasibility
from planner.planning.line_of_sight import Guidance
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest, RequestOptions
from planner.planning.schedule import follow
from planner.planning.stated_error import guaranteed, look_ahead
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.coefficient_modes import OWN_TABLE
from planner.vehicle.dwell_choice import check_least, dwells_for, longer_dwells, nearly_fastest
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from planner.vehicle.vehicle import Vehicle
from planner.vehicle.zigzag import Zigzag, zigzag
from sim.io.errors import InputError
from sim.model.robot import Robot
from surrogate.interface import LookupTable

_WORTH = 0.8  # of the stated error: a longer dwell, which swings further, must leave at most this
_LENGTHENED_FROM = 1.2  # stated error over predicted error, below which fewer flips gain nothing
_SAVED = 3.0  # dwells that corners and the end of a path may save
# Plans from what declares the path, the drift, and what follows a declared path.
Redirect = Callable[[Callable[[], Declared], Drift, Callable[[Declared], Plan]], Plan]


def plan(
    path: Path2D | ArrayLike,
    robot: Robot,
    *,
    lookup: LookupTable | None = None,
    knowledge: CalibrationKnowledge | None = None,
    progress: Callable[[float], object] | None = None,
    **options: Unpack[RequestOptions],
) -> Plan:
    """Plan the motor's switching times for a path.

    Args:
        path: (n, 2) points or a Path2D, lengths in tail lengths l.
        robot: the robot; its motor speed is used in both directions.
        lookup: trained table, or the table of this one robot; default the shipped one.
        knowledge: what a calibration found besides the robot: covariance, current.
        progress: called now and then with the share of the path that is done.
        options: the fields of `PlanRequest`; `softflagella.plan` explains them.

    Raises:
        InputError: the path is bad or too tight, the dwell too short, the tolerance too small, or the robot
            outside the table's domain.

    Example:
        >>> from softflagella import circle, load_robot, plan
        >>> result = plan(circle(2.0), load_robot("paper-control"))
        >>> len(result.dwells) > 100, result.predicted_rms < 0.03
        (True, True)
    """
    request = PlanRequest(**options)
    tracked = tracked_vehicle(robot, lookup, request.point, knowledge)
    return make_plan(path if isinstance(path, Path2D) else Path2D.of(path), tracked, request, progress)


def make_plan(
    drawn: Path2D,
    tracked: TrackedVehicle,
    request: PlanRequest,
    progress: Callable[[float], object] | None = None,
    redirect: Redirect | None = None,
) -> Plan:
    """Plan for a path, a vehicle and a request; see `plan`.

    Args:
        drawn: the path as drawn.
        tracked: the vehicle and its tracked point.
        request: corners, dwells, tolerance.
        progress: called now and then with the share of the path that is done.
        redirect: plans for another path than the nearest one that can be followed.
    """
    vehicle = tracked.vehicle
    check_size(drawn, tracked.robot, vehicle.turn_radius)
    least = request.least_dwell(tracked.robot)
    if request.dwell is None:
        dwells = dwells_for(vehicle, request.objective, least)
    else:
        dwells = [check_least(request.dwell)]

    @cache
    def declared_path(drift: Drift) -> Declared:
        feasibility = Feasibility(tracked.robot, vehicle, tracked.rod, drift, request.corner, request.time_weight)
        return declare(drawn, feasibility, progress)

    def with_dwell(dwell: float) -> Plan:
        straight = zigzag(vehicle, dwell, tracked.offset)
        drift = zigzag_drift(tracked, straight, dwell)

        def follow_declared(declared: Declared) -> Plan:
            guidance = choose_guidance(vehicle, declared, straight, dwell)
            switches = follow(declared.reference, vehicle, guidance, tracked.offset, progress=progress)
            bound = guaranteed(vehicle, tracked.rod, straight.swing, guidance.ahead)
            errors = plan_errors(tracked, drawn, declared, switches, guaranteed=bound, seed=request.seed)
            parts = (tracked, request.objective, drawn, declared, straight, guidance, switches, errors)
            return Plan(*parts, camera=request.camera)

        if redirect is not None:
            return redirect(partial(declared_path, drift), drift, follow_declared)
        return follow_declared(declared_path(drift))

    if request.dwell is None and request.objective == "time" and redirect is None:
        drift = zigzag_drift(tracked, zigzag(vehicle, dwells[0], tracked.offset), dwells[0])
        best = _quickest(tracked, declared_path(drift), dwells[0], least)
        dwells = [best, *(dwell for dwell in dwells if dwell < best)]
    first = with_dwell(dwells[0])
    if request.dwell is None and request.objective == "error":
        first = _least_stated(first, longer_dwells(vehicle, first.minimum_dwell), with_dwell)
    if request.tolerance is None or first.stated_error <= request.tolerance:
        return first
    return _shortened(first, dwells, with_dwell, request.tolerance)


def _quickest(tracked: TrackedVehicle, declared: Declared, fastest: float, least: float | None) -> float:
    """Choose the dwell with which a declared path takes the least time.

    Shorter dwells are tried until they cost more time than corners and the end may save.

    Args:
        tracked: the vehicle and its tracked point.
        declared: with the dwell `fastest`.
        fastest: with which straight motion is the fastest.
        least: the shortest dwell that the motor allows.
    """
    vehicle, offset = tracked.vehicle, tracked.offset

    times: dict[float, float] = {}
    for dwell in nearly_fastest(vehicle, least):
        guidance = choose_guidance(vehicle, declared, zigzag(vehicle, dwell, offset), dwell)
        with suppress(InputError):  # too long for this path
            times[dwell] = float(follow(declared.reference, vehicle, guidance, offset).dwells.sum())
            if times[dwell] > min(times.values()) + _SAVED * fastest:
                break
    return min(times, key=lambda dwell: times[dwell], default=fastest)


def _least_stated(first: Plan, longer: list[float], with_dwell: Callable[[float], Plan]) -> Plan:
    """Lengthen the dwells where this makes the stated error smaller by a fifth or more.

    What is uncertain of each flip adds up, so it shrinks with their number. The predicted error grows with the
    dwell; where it alone is above the best stated error, longer dwells cannot be better.
    """
    best = first
    if first.stated_error < _LENGTHENED_FROM * first.predicted_max:
        return best
    for dwell in longer:
        try:
            candidate = with_dwell(dwell)
        except InputError:  # too long for this path
            break
        if candidate.predicted_max >= best.stated_error:
            break
        if candidate.stated_error < _WORTH * best.stated_error:
            best = candidate
    return best


def _shortened(first: Plan, dwells: list[float], with_dwell: Callable[[float], Plan], tolerance: float) -> Plan:
    """Halve between the first dwell, which is too long, and the shortest one, until the tolerance is kept.

    Raises:
        InputError: no dwell that was tried keeps the tolerance.
    """
    best, kept = first, None
    low, high = 0, len(dwells)
    while high - low > 1:
        middle = (low + high) // 2
        candidate = with_dwell(dwells[middle])
        if candidate.stated_error < best.stated_error:
            best = candidate
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


def zigzag_drift(tracked: TrackedVehicle, straight: Zigzag, dwell: float) -> Drift:
    """Return what carries the robot off its heading, with one shortest dwell, as shares of its net speed.

    Raises:
        InputError: with such dwells the robot does not get ahead.
    """
    vehicle = tracked.vehicle
    if straight.speed <= 0:
        turn = dwell * float(np.abs(vehicle.twist[:, 2]).max())
        remedy = "shorter ones: it turns too far" if turn > 1.0 else "longer ones: it is still accelerating"
        raise InputError(
            f"with dwells of {time_in_lab(dwell, tracked.robot)} the robot does not get ahead; allow {remedy} in "
            "each dwell"
        )
    sideways = straight.drift / straight.speed
    x, y = (vehicle.current / straight.speed).tolist()
    # A mirror-symmetric robot has no drift: what is left is rounding.
    return Drift(0.0 if abs(sideways) < 1e-9 else sideways, (x, y))


def choose_guidance(vehicle: Vehicle, declared: Declared, straight: Zigzag, dwell: float) -> Guidance:
    """Choose look-ahead and hysteresis for a declared path and a shortest dwell."""
    ahead = look_ahead(vehicle, declared.curvature, straight)
    return Guidance(dwell, ahead, straight.hysteresis(ahead))
