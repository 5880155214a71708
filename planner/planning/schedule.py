"""Switching times by hysteresis about the line of sight.

The reference of the pivot and its heading (`planner.paths.tractrix.Reference`) give the wanted heading at every
place:

    φ_d = φ_ref − atan(e/Δ) − ∫ e ds/(2 Δ²),

with e the pivot's cross-track error (left positive) and Δ the look-ahead. The integral takes out a constant error,
which is left where the robot moves at an angle to its heading. The motor flips when

    σ (φ − φ_d) ≥ h,   not before the shortest dwell T after the last flip,

with h = β (1 + |κ| R′)/2 and β the angle by which the heading swings to and fro on a straight line with dwells T
(Ω T without lags): on a path of curvature κ the shorter one of two dwells then lasts about T. The pose after
each dwell is predicted with the vehicle, memory included. The next dwell starts from the predicted pose, so errors
do not add up along the path. Without this feedback they grow with the length of the path (docs/log.md).

The time of a flip is the root of one equation, found by the secant method, in about four evaluations. Nothing
depends on the length of the path: the place on it is remembered, and moves forward.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.paths.tractrix import Reference
from planner.planning.line_of_sight import LineOfSight, hysteresis
from planner.vehicle.rollout import Switches
from planner.vehicle.vehicle import Vehicle
from sim.io.errors import InputError

MOST_SWITCHES = 200_000
_PATIENCE = 30.0  # ways of the size of the robot's motion that may be made without getting ahead
_EVERY = 2_000  # switches between two calls of `progress`


@dataclass(frozen=True)
class Start:
    """Where a schedule begins: pose of the head's centre, place on the reference, direction of the first dwell.

    `before` is the length of the dwell that ends here, in the other direction; None where the robot is at rest.
    """

    pose: tuple[float, float, float]
    place: int
    sense: int
    before: float | None = None


def follow(
    reference: Reference,
    vehicle: Vehicle,
    *,
    pivot_distance: float,
    ahead: float,
    dwell: float,
    offset: float,
    swing: float | None = None,
    start: Start | None = None,
    most: int = MOST_SWITCHES,
    progress: Callable[[float], object] | None = None,
) -> Switches:
    """Dwell times that keep the tracked point on the reference.

    Args:
        reference: declared path and its tractrix.
        vehicle: arcs and lags of the head's centre.
        pivot_distance: from the pivot to the tracked point.
        ahead: look-ahead Δ.
        dwell: shortest dwell T.
        swing: β; default Ω T.
        offset: distance from the head's centre to the tracked point, forward.
        start: default: at rest at the beginning of the reference, with its heading.
        most: end after this many dwells.
        progress: called now and then with the share of the path that is done.

    Raises:
        InputError: the path needs too many switches, or the robot turns in circles.
    """
    swing = float(np.abs(vehicle.twist[:, 2]).max()) * dwell if swing is None else swing
    start = start or start_at_rest(reference, vehicle, offset, swing)
    follower = LineOfSight(reference, vehicle, ahead, pivot_distance, offset, dwell, swing)
    follower.place = start.place
    follower.begin()
    pose, sense, before = start.pose, start.sense, start.before
    dwells: list[float] = []
    poses = [pose]
    furthest, patience = follower.place, 0.0
    allowed = _PATIENCE * (ahead + pivot_distance + vehicle.turn_radius) / max(vehicle.speed, 1e-300)
    while len(dwells) < most:
        time, ended = follower.next_dwell(pose, sense, before)
        if time > 0:
            pose = follower.moved(pose, sense, before, time)
            follower.learn(pose, sense)
            dwells.append(time)
            poses.append(pose)
            sense, before = -sense, time
        if ended:
            break
        patience = 0.0 if follower.place > furthest else patience + time
        furthest = max(furthest, follower.place)
        if patience > allowed:
            x, y = reference.p[furthest]
            raise InputError(
                f"the robot does not get past ({x:.3g}, {y:.3g}) l, where the path turns back too "
                "sharply; split it there"
            )
        if len(dwells) >= MOST_SWITCHES:
            raise InputError(f"the path needs more than {MOST_SWITCHES} switches; split it")
        if progress is not None and len(dwells) % _EVERY == 0:
            progress(follower.place / len(reference.q))
    return Switches(start.sense, np.array(dwells), np.array(poses))


def start_at_rest(reference: Reference, vehicle: Vehicle, offset: float, swing: float) -> Start:
    """At rest, where the reference begins.

    The robot turns first to the side to which the reference turns first. So it must look to the other side of the
    reference by half a swing of the zigzag.
    """
    turn = reference.heading - reference.heading[0]
    far = np.flatnonzero(np.abs(turn) > 1e-6)
    sense = 1 if not len(far) or turn[far[0]] > 0 else -1
    heading = float(reference.heading[0]) - sense * float(hysteresis(reference, vehicle, swing)[0])
    ahead = reference.p[0] - reference.q[0]
    rod = math.hypot(*ahead.tolist()) - offset
    x, y = (reference.q[0] + rod * np.array([math.cos(heading), math.sin(heading)])).tolist()
    return Start((x, y, heading), 0, sense)
