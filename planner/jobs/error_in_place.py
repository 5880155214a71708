"""How far a robot may be from where its plan says it is at a time.

The stated error of a plan is a distance from its path, and says nothing about time. Robots that must keep apart
need more: the error in place at a given time. It is a curve over time below which 95 % of the robots that the
model's uncertainty allows keep both ends of their body, all the time.

*Open loop*: the deviations from which the stated error is computed (`planner.planning.errors`), in all
directions.

*With feedback*: a tracker holds the robot to its path, but not to a time. Across the path the robot is within the
stated error with feedback, the prediction within its own largest error, and the two may swing in opposite phases.
Along the path the robot is late or early by

    lag(s) = V [t′(s) − t(s)] + b ∫ |κ| √(1 + κ² a²) dσ,

where t is the time in which the pivot passes the tractrix of the path, t′ the same for a robot with another speed,
rod or current, and b the part of the error with feedback that is not the zigzag: the pivot of a robot that is
outside on a curve has a longer way. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planner.draws import normals
from planner.paths.obstacles import Footprint
from planner.paths.path import Path2D, arc_length
from planner.paths.tractrix import reference
from planner.planning.errors import LEVEL, WOBBLE, deviations_open_loop, error_growth, flips_between
from planner.planning.plan import Plan
from planner.vehicle.rollout import roll_out
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.vehicle import Mode
from planner.vehicle.zigzag import zigzag
from sim.arrays import Floats
from sim.io.errors import InputError

_PLACES = 300  # along the path
_DRAWS = 400
_SPACING = 0.05  # l, of the points of a tractrix


def error_open_loop(plan: Plan) -> tuple[Floats, Floats]:
    """Return times (E,) and the error in place (E,) of a robot that carries out the schedule open loop."""
    tracked, switches = plan.tracked, plan.switches
    edges = flips_between(len(plan.dwells))
    rollout = roll_out(tracked.vehicle, switches, tracked.offset)
    moved, turned = deviations_open_loop(error_growth(tracked.vehicle, switches, rollout, edges))
    heading = plan.poses[edges[1:], 2]
    left = np.stack([-np.sin(heading), np.cos(heading)], -1)
    sizes = []
    for place in _ends(plan):
        away = moved + turned[..., None] * place * left
        sizes.append(np.hypot(away[..., 0], away[..., 1]))
    times = np.concatenate([[0.0], np.cumsum(plan.dwells)])[edges]
    return times, WOBBLE + np.concatenate([[0.0], _band(np.maximum(*sizes))])


def error_with_feedback(plan: Plan) -> tuple[Floats, Floats]:
    """Return times (E,) and the error in place (E,) of a robot under a tracker."""
    declared, tracked = plan.declared.reference, plan.tracked
    arcs = np.linspace(0.0, declared.arc[-1], _PLACES)
    lag = _lag(plan, arcs)
    levers = [place + tracked.vehicle.pivot_distance for place in _ends(plan)]
    along = np.zeros(_PLACES)
    for lever in levers:
        p = declared.q + lever * np.stack([np.cos(declared.heading), np.sin(declared.heading)], 1)
        here = _interpolated(arcs, declared.arc, p)
        for shifted in (arcs + lag, arcs - lag):
            along = np.maximum(along, np.hypot(*(_interpolated(shifted, declared.arc, p) - here).T))
    beyond = max(0.0, max(map(abs, levers)) - tracked.rod)
    across = plan.predicted_max + plan.feedback_error + plan.straight.swing * beyond
    return times_at(plan, arcs), np.hypot(WOBBLE + along, across)


def times_at(plan: Plan, arcs: Floats) -> Floats:
    """Estimate the times (K,) at which the pivot has come so far (K,) along its reference."""
    axis = np.stack([np.cos(plan.poses[:, 2]), np.sin(plan.poses[:, 2])], 1)
    way = arc_length(plan.poses[:, :2] - plan.tracked.vehicle.pivot_distance * axis)
    times = np.concatenate([[0.0], np.cumsum(plan.dwells)])
    return np.asarray(np.interp(arcs / float(plan.declared.reference.arc[-1]) * way[-1], way, times))


def _ends(plan: Plan) -> tuple[float, float]:
    """Return the ends of the body, forward from the head's centre."""
    body = Footprint.of(plan.robot, 0.0)
    return float(body.places.max()), float(body.places.min())


def _lag(plan: Plan, arcs: Floats) -> Floats:
    """Bound how far along its reference (K,) the pivot is late or early."""
    declared, tracked = plan.declared.reference, plan.tracked
    path = Path2D(declared.p, False)
    planned = _passing_times(path, tracked, plan.minimum_dwell)
    lags = []
    for mode in tracked.vehicle.modes:
        try:
            late = _passing_times(path, _changed(tracked, mode), plan.minimum_dwell) - planned
        except InputError:  # such a robot does not get ahead; the others tell enough
            continue
        lags.append(plan.straight.net_speed * late)
    bend = np.abs(declared.curvature)
    bias = max(plan.feedback_error - plan.predicted_max, 0.0)
    outside = np.concatenate([
        [0.0],
        np.cumsum(bend * np.sqrt(1 + (bend * tracked.vehicle.pivot_distance) ** 2) * np.diff(declared.arc)),
    ])  # fmt: skip
    late = np.zeros(_PLACES)
    if lags:
        late = _band(np.abs(normals(0, 0, _DRAWS * len(lags)).reshape(_DRAWS, -1) @ np.array(lags)))
    return np.asarray(late + bias * np.interp(arcs, declared.arc, outside))


def _changed(tracked: TrackedVehicle, mode: Mode) -> TrackedVehicle:
    """Return a vehicle that is off by one standard deviation of a mode."""
    vehicle = tracked.vehicle
    lag = vehicle.lag if mode.lag is None else vehicle.lag + mode.lag
    changed = replace(vehicle, twist=vehicle.twist + mode.twist, lag=lag, current=vehicle.current + mode.current)
    return tracked._replace(vehicle=changed)


def _passing_times(path: Path2D, tracked: TrackedVehicle, dwell: float) -> Floats:
    """Compute the times (K,) at which the pivot of a robot that follows a path passes equal parts of it."""
    straight = zigzag(tracked.vehicle, dwell, tracked.offset)
    drift = tracked.drift(straight)
    followed = reference(path, tracked.rod, max(_SPACING, path.length / 4000), drift)
    heading = (followed.heading[1:] + followed.heading[:-1]) / 2
    ahead = 1 + drift.current[0] * np.cos(heading) + drift.current[1] * np.sin(heading)
    steps = np.diff(followed.arc) / np.maximum(ahead, 0.1) / straight.speed
    times = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(np.interp(np.linspace(0.0, 1.0, _PLACES), np.linspace(0.0, 1.0, len(times)), times))


def _interpolated(arcs: Floats, known: Floats, points: Floats) -> Floats:
    """Interpolate points (m, 2) at arc lengths (K,)."""
    return np.stack([np.interp(arcs, known, column) for column in points.T], 1)


def _band(sizes: Floats) -> Floats:
    """Bound draws (D, E) by a curve (E,) below which LEVEL of them stay all the time."""
    level = np.maximum(np.quantile(sizes, LEVEL, axis=0), 1e-9)
    return np.asarray(level * np.quantile((sizes / level).max(1), LEVEL))
