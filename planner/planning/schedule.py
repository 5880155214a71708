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
from planner.planning.line_of_sight import Follower, hysteresis
from planner.vehicle.vehicle import Vehicle
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.mechanics import planar

MOST_SWITCHES = 200_000
_PATIENCE = 30.0  # ways of the size of the robot's motion that may be made without getting ahead
_EVERY = 2_000  # switches between two calls of `progress`


@dataclass(frozen=True)
class Switches:
    """First direction and dwell times; poses of the head's centre at the flips and the end."""

    first_direction: int
    dwells: Floats  # (M,)
    poses: Floats  # (M + 1, 3)


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
    start = start or start_of(reference, vehicle, offset, swing)
    follower = Follower(reference, vehicle, ahead, pivot_distance, offset, dwell, swing)
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


def start_of(reference: Reference, vehicle: Vehicle, offset: float, swing: float) -> Start:
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


def poses_at_flips(vehicle: Vehicle, switches: Switches) -> Floats:
    """Poses (M + 1, 3) of the head's centre at the flips, if `vehicle` carries out the schedule."""
    changes = pose_changes(vehicle, switches.first_direction, switches.dwells, switches.dwells[:, None])[:, 0]
    return _chain(switches.poses[0], changes, vehicle.current * switches.dwells[:, None])


def trace(vehicle: Vehicle, switches: Switches, offset: float, *, samples: int = 8) -> Floats:
    """Predicted track of the tracked point, (M samples + 1, 2), at equal times within each dwell."""
    share = np.arange(1, samples + 1) / samples
    times = switches.dwells[:, None] * share
    changes = pose_changes(vehicle, switches.first_direction, switches.dwells, times)
    flips = _chain(switches.poses[0], changes[:, -1], vehicle.current * switches.dwells[:, None])
    within = planar.compose(flips[:-1, None], changes)
    within[..., :2] += vehicle.current * times[..., None]
    poses = np.concatenate([flips[:1], within.reshape(-1, 3)])
    return planar.compose(poses, np.array([offset, 0.0, 0.0]))[:, :2]


def pose_changes(vehicle: Vehicle, first_direction: int, dwells: Floats, times: Floats) -> Floats:
    """Pose changes (M, K, 3) of each dwell after times (M, K), from rest."""
    before = np.concatenate([dwells[:1], dwells[:-1]])[:, None] + np.zeros_like(times)
    changes = np.empty((*times.shape, 3))
    for first, sense in ((0, first_direction), (1, -first_direction)):
        changes[first::2] = vehicle.motion(sense, before[first::2], times[first::2])
    changes[0] = vehicle.motion(first_direction, None, times[0])
    return changes


def _chain(start: Floats, changes: Floats, drift: Floats) -> Floats:
    """Poses (M + 1, 3) from a start, pose changes (M, 3) and moves in the lab (M, 2)."""
    heading = start[2] + np.concatenate([[0.0], np.cumsum(changes[:, 2])])
    moves = planar.turn(changes[:, :2], heading[:-1]) + drift
    position = start[:2] + np.concatenate([[[0.0, 0.0]], np.cumsum(moves, 0)])
    return np.concatenate([position, heading[:, None]], 1)
