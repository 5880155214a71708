"""Switching times by hysteresis about the line of sight.

The reference of the pivot and its heading (`planner.paths.tractrix.Reference`) give the wanted heading:

    φ_d = φ_ref − atan(e/Δ) − ∫ e ds/(2 Δ²),

with e the pivot's cross-track error (left positive) and Δ the look-ahead. The integral removes the constant
error of a robot that moves at an angle to its heading. The motor flips when

    σ (φ − φ_d) ≥ h,   not before the shortest dwell T after the last flip,

with h = β (1 + |κ| R′)/2 and β the angle by which the heading swings to and fro on a straight line with dwells T
(Ω T without lags): on a path of curvature κ the shorter one of two dwells then lasts about T. The pose after
each dwell is predicted with the vehicle, memory included. The next dwell starts from the predicted pose, so errors
do not accumulate along the path. Without this feedback they grow with its length (docs/log.md).

The time of a flip is the root of one equation, which the secant method finds in about four evaluations. Their cost
does not depend on the length of the path: the place on it is remembered, and moves forward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from planner.paths.tractrix import Reference
from planner.planning.line_of_sight import Guidance, LineOfSight, hysteresis
from planner.planning.progress import FOLLOWING, Progress, tell
from planner.vehicle.rollout import Switches
from planner.vehicle.vehicle import Vehicle
from planner.vehicle.zigzag import zigzag
from sim.io.errors import InputError
from sim.mechanics import planar

MOST_SWITCHES = 2_000_000
_PATIENCE = 30.0  # lengths of the robot's motion that may pass without progress along the path
_EVERY = 2_000  # switches between two calls of `progress`


@dataclass(frozen=True)
class Start:
    """Where a schedule begins, at rest: pose of the head's centre, and direction of the first dwell."""

    pose: tuple[float, float, float]
    sense: int


def follow(
    reference: Reference,
    vehicle: Vehicle,
    guidance: Guidance,
    offset: float = 0.0,
    *,
    start: Start | None = None,
    progress: Progress | None = None,
) -> Switches:
    """Choose dwell times that keep the tracked point on the reference.

    Args:
        reference: declared path and its tractrix.
        vehicle: arcs and lags of the head's centre.
        guidance: the numbers of the guidance law.
        offset: distance from the head's centre forward to the tracked point.
        start: default: at rest at the beginning of the reference, with its heading.
        progress: called now and then with the share of the path that is done.

    Raises:
        InputError: the path needs too many switches, or the robot turns in circles.
    """
    start = start or start_at_rest(reference, vehicle, guidance, offset)
    law = LineOfSight(reference, vehicle, guidance, offset)
    pose, sense = start.pose, start.sense
    before: float | None = None  # at rest
    dwells: list[float] = []
    poses = [pose]
    furthest, stalled = law.place, 0.0
    rod = vehicle.pivot_distance + offset
    patience = _PATIENCE * (guidance.ahead + rod + vehicle.turn_radius) / max(vehicle.speed, 1e-300)
    while True:
        time, ended = law.next_dwell(pose, sense, before)
        if time > 0:
            pose = law.pose_after(pose, sense, before, time)
            law.integrate(pose, sense)
            dwells.append(time)
            poses.append(pose)
            sense, before = -sense, time
        if ended:
            return Switches(start.sense, np.array(dwells), np.array(poses))
        stalled = 0.0 if law.place > furthest else stalled + time
        furthest = max(furthest, law.place)
        if stalled > patience:
            x, y = reference.p[furthest]
            raise InputError(
                f"the robot does not get past ({x:.3g}, {y:.3g}) l, where the path turns back too "
                "sharply; split it there"
            )
        if len(dwells) >= MOST_SWITCHES:
            raise InputError(f"the path needs more than {MOST_SWITCHES} switches; split it")
        if len(dwells) % _EVERY == 0:
            tell(progress, FOLLOWING, law.place / len(reference.q))


def start_at_rest(reference: Reference, vehicle: Vehicle, guidance: Guidance, offset: float) -> Start:
    """Start at rest near the reference's beginning, so that the first dwell continues as one of the zigzag does.

    The robot turns first to the side to which the reference turns first. On a straight line, a dwell of the
    zigzag to that side begins outside the reference by half a swing of the heading; where the path bends so much
    that the robot can only turn, it begins on the reference. Its tails are bent. From rest they are straight, and
    the robot moves further, so the start is where the shortest dwell from rest leads to the same pose.
    """
    sense = reference.first_turn
    straight = zigzag(vehicle, guidance.dwell, offset)
    outside = straight.swing * (1 - hysteresis(reference, vehicle, 1.0)[0])
    heading = float(reference.heading[0]) - sense * outside
    to_head = math.hypot(*(reference.p[0] - reference.q[0]).tolist()) - offset
    aside = sense * straight.sway * np.array([math.sin(heading), -math.cos(heading)])
    x, y = (reference.q[0] + aside + to_head * np.array([math.cos(heading), math.sin(heading)])).tolist()
    bent = vehicle.motion(sense, straight.dwells[0 if sense < 0 else 1], guidance.dwell)
    from_rest = vehicle.motion(sense, None, guidance.dwell)
    after = planar.compose(np.array([x, y, heading]), bent)
    x, y, heading = planar.compose(after, planar.inverse(from_rest)).tolist()
    return Start((x, y, heading), sense)
