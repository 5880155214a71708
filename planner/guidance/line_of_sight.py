"""Line-of-sight guidance: switching times by hysteresis about the line of sight.

The reference of the pivot and its heading (`planner.paths.tractrix.Reference`) give the wanted heading:

    φ_d = φ_ref − atan(e/Δ) − ∫ e ds/(2 Δ²),

with e the pivot's cross-track error (left positive) and Δ the look-ahead. The integral removes the constant
error of a robot that moves at an angle to its heading. The motor flips when

    σ (φ − φ_d) ≥ h,   not before the shortest dwell T after the last flip,

with h = β (1 + |κ| R′)/2 and β the angle by which the heading swings to and fro on a straight line with dwells T
(Ω T without lags): on a path of curvature κ the shorter one of two dwells then lasts about T. The pose after
each dwell is predicted with the vehicle, memory included. The next dwell starts from the predicted pose, so errors
do not accumulate along the path. Without this feedback they grow with its length (docs/log.md).

*Guaranteed error*: a bound for a vehicle without errors on a path of any length. With the swing β, the look-ahead
Δ ≥ R′/(1 − κ̄ R′), R′ = R cos θ, and κ̄ the largest curvature of the reference,

    |e| ≤ β (Δ + 2 a),

where a is the distance from the pivot to the tracked point. A flip adds its lag: at most |lag_x, lag_z| + 2 a
|lag_ψ| + Δ |lag_ψ|. Source: ours; the tests check it on random paths.

`planner.guidance.law` finds the flips, for whole plans in a compiled loop and for trackers (`tracking.tracker`)
one at a time. A pose is x, y and heading of the head's centre. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from planner.guidance.law import (
    REST,
    FollowState,
    GuidanceLaw,
    PathState,
    approach,
    follow_dwells,
    has_ended,
    integrate,
    lag_after,
    next_dwell,
    pose_after,
)
from planner.paths.tractrix import Reference
from planner.progress import FOLLOWING, ProgressCallback, tell
from planner.vehicle.vehicle import BEFORE_KNOTS, SHORTEST, STEP, Switches, Vehicle
from planner.vehicle.zigzag import Zigzag, zigzag
from sim.mechanics import planar
from sim.mechanics.planar import POSE

_TIGHTEST = 0.97
_PAIRS_AHEAD = 4.0  # pairs of dwells
MOST_SWITCHES = 2_000_000
_PATIENCE = 30.0  # lengths of the robot's motion that may pass without progress along the path
_EVERY = 2_000  # switches between two calls of `progress`
_CIRCLES = "the robot turns in circles and does not reach the path; check the path's scale"
_QUICKEST = 0.5  # of the time that the pivot needs for the reference at its largest speed: no schedule is shorter


class Guidance(NamedTuple):
    """The numbers of the guidance law."""

    dwell: float  # shortest dwell T
    ahead: float  # look-ahead Δ
    swing: float  # β: 2 h of the hysteresis on a straight line


def hysteresis(reference: Reference, vehicle: Vehicle, swing: float) -> Floats:
    """Compute h at every step of the reference."""
    bend = np.minimum(np.abs(reference.curvature) * vehicle.pivot_radius, 1.0)
    return np.asarray(swing * (1 + bend) / 2)


def law_of(reference: Reference, vehicle: Vehicle, guidance: Guidance, offset: float) -> GuidanceLaw:
    """Return the law of guidance about a reference, as compiled loops take it; no way leads to the reference."""

    def table(array: Floats) -> Floats:
        return np.ascontiguousarray(array, dtype=float)

    return GuidanceLaw(
        x=table(reference.q[:, 0]),
        y=table(reference.q[:, 1]),
        heading=table(reference.heading),
        arc=table(reference.arc),
        hysteresis=table(hysteresis(reference, vehicle, guidance.swing)),
        last=len(reference.q) - 2,
        dwell=float(guidance.dwell),
        ahead=float(guidance.ahead),
        rod=float(vehicle.pivot_distance + offset),
        offset=float(offset),
        knots=BEFORE_KNOTS,
        step=STEP,
        twist=table(vehicle.twist),
        lag=table(vehicle.lag),
        rest=table(vehicle.rest),
        current=table(vehicle.current),
    )


class LineOfSight:
    """A vehicle, its reference, and the place that it has reached, for one flip at a time.

    Args:
        reference: declared path and its tractrix.
        vehicle: arcs and lags of the head's centre.
        guidance: the numbers of the guidance law.
        offset: distance from the head's centre forward to the tracked point.
    """

    def __init__(self, reference: Reference, vehicle: Vehicle, guidance: Guidance, offset: float):
        law = law_of(reference, vehicle, guidance, offset)
        arrays = {name: each for name, each in law._asdict().items() if isinstance(each, np.ndarray)}
        self._law = law._replace(**{name: array.tolist() for name, array in arrays.items()})
        self.state = PathState()

    def update_vehicle(self, twist: list[list[float]], lag_angle: float, current: list[float]) -> None:
        """Update the vehicle: twists (2, 3), an offset added to all lag angles, and a current (2,)."""
        self._law = self._law._replace(twist=twist, lag_angle=lag_angle, current=current)

    def pose_after(self, pose: POSE, sense: int, before: float, time: float) -> POSE:
        """Predict the pose of the head's centre after `time` in direction `sense`."""
        return pose_after(self._law, pose, sense, before, time)

    def lag_after(self, side: int, before: float, time: float) -> POSE:
        """Interpolate the lag after `time` in direction `side` (0: positive, 1: negative)."""
        return lag_after(self._law, side, before, time)

    def integrate(self, pose: POSE, sense: int) -> None:
        """Add the mean error of the last two dwells to the integral."""
        self.state = integrate(self._law, self.state, pose, sense)

    @property
    def ended(self) -> bool:
        return has_ended(self._law, self.state)

    def approach(self, pose: POSE, sense: int, before: float, time: float) -> None:
        """Move the place with the robot from `pose`, where the dwell began, nearly until `time`."""
        *_, self.state = approach(self._law, self.state, pose, sense, before, time)

    def next_dwell(self, pose: POSE, sense: int, before: float, elapsed: float = 0.0) -> tuple[float, bool]:
        """Compute the length of the dwell that began at `pose`, and whether the path ends in it.

        `elapsed` is the time since then: the motor cannot flip before it.

        Raises:
            InputError: the robot turns in circles.
        """
        flip = next_dwell(self._law, self.state, pose, sense, before, elapsed)
        self.state = flip.state
        if flip.lost:
            raise InputError(_CIRCLES)
        return flip.time, flip.ended


@dataclass(frozen=True)
class Start:
    """Where a schedule begins, at rest: pose of the head's centre, and direction of the first dwell."""

    pose: POSE
    sense: int


def follow(
    reference: Reference,
    vehicle: Vehicle,
    guidance: Guidance,
    offset: float = 0.0,
    *,
    start: Start | None = None,
    progress: ProgressCallback | None = None,
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
    law = law_of(reference, vehicle, guidance, offset)
    patience = _PATIENCE * (guidance.ahead + law.rod + vehicle.turn_radius) / max(vehicle.speed, 1e-300)
    following = FollowState(start.pose, start.sense, REST, PathState())
    dwells, poses = [np.empty(0)], [np.array([start.pose])]
    switches = 0
    while not following.ended:
        times, places = np.empty(_EVERY), np.empty((_EVERY, 3))
        following = follow_dwells(law, following, patience, times, places)
        dwells.append(times[: following.done])
        poses.append(places[: following.done])
        switches += following.done
        if following.lost:
            raise InputError(_CIRCLES)
        if following.stalled > patience:
            x, y = reference.p[following.furthest]
            raise InputError(
                f"the robot does not get past ({x:.3g}, {y:.3g}) l, where the path turns back too "
                "sharply; split it there"
            )
        if switches >= MOST_SWITCHES:
            raise InputError(f"the path needs more than {MOST_SWITCHES} switches; split it")
        if not following.ended:
            tell(progress, FOLLOWING, following.state.step / len(reference.q))
    schedule = Switches(start.sense, np.concatenate(dwells), np.concatenate(poses))
    _check_duration(schedule, reference, vehicle)
    return schedule


def _check_duration(switches: Switches, reference: Reference, vehicle: Vehicle) -> None:
    """Raise RuntimeError where a schedule is too short for its path: its end was accepted too early."""
    lags = len(switches.dwells) * float(np.hypot(vehicle.rest[..., 0], vehicle.rest[..., 1]).max())
    fastest = float(np.abs(vehicle.twist[:, 0]).max() + np.hypot(*vehicle.current))
    if fastest * switches.dwells.sum() < _QUICKEST * (float(reference.arc[-1]) - lags):
        raise RuntimeError(
            f"a schedule of {switches.dwells.sum():.3g} time units is too short for {reference.arc[-1]:.3g} l: an "
            "error of the planner; please report robot and path"
        )


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


def look_ahead(vehicle: Vehicle, curvature: float, straight: Zigzag | None = None) -> float:
    """Compute Δ = R′/(1 − κ̄ R′), at least the way that the robot makes in some pairs of dwells."""
    least = vehicle.pivot_radius / (1 - min(curvature * vehicle.pivot_radius, _TIGHTEST))
    return least if straight is None else max(least, _PAIRS_AHEAD * straight.net_speed * sum(straight.dwells))


def guaranteed(vehicle: Vehicle, pivot_distance: float, swing: float, ahead: float) -> float:
    """Bound the distance from the reference [l] for a vehicle without errors; see the module."""
    lag = np.abs(vehicle.lag[:, :, round(SHORTEST / STEP) :]).max((0, 1, 2))
    flip = float(np.hypot(lag[0], lag[1]) + (ahead + 2 * pivot_distance) * lag[2])
    return swing * (ahead + 2 * pivot_distance) + flip
