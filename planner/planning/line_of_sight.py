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

The time of a flip is the root of one equation, which the secant method finds in about four evaluations. Their
cost does not depend on the length of the path: the place on it is remembered, and moves forward. Plans
(`planner.planning.solve`) and trackers (`tracking.tracker`) ask for one flip at a time, so it computes
with plain numbers. A pose is x, y and heading of the head's centre. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from planner.paths.tractrix import Reference
from planner.planning.request import FOLLOWING, POSE, ProgressCallback, tell
from planner.vehicle.vehicle import BEFORE_KNOTS, SHORTEST, STEP, Switches, Vehicle
from planner.vehicle.zigzag import Zigzag, zigzag
from sim.mechanics import planar

EXACT = 1e-7  # rad, of the heading at a flip
LARGEST_STEP = 0.4  # rad that the robot turns between two evaluations
LARGEST_TURN = 1.5  # rad that it turns while its place on the path is sought from the last one
TURNS = 4 * math.pi  # a dwell that turns further than this leads nowhere
MOST_BIAS = 0.3  # rad
HALVINGS = 30
MOST_LOOKS = 500  # evaluations of the equation for one dwell; about four are needed
_TIGHTEST = 0.97
_PAIRS_AHEAD = 4.0  # pairs of dwells
_KNOTS: list[float] = BEFORE_KNOTS.tolist()
MOST_SWITCHES = 2_000_000
_PATIENCE = 30.0  # lengths of the robot's motion that may pass without progress along the path
_EVERY = 2_000  # switches between two calls of `progress`
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


class LineOfSight:
    """A vehicle, its reference, and the place that it has reached.

    Args:
        reference: declared path and its tractrix.
        vehicle: arcs and lags of the head's centre.
        guidance: the numbers of the guidance law.
        offset: distance from the head's centre forward to the tracked point.
    """

    def __init__(self, reference: Reference, vehicle: Vehicle, guidance: Guidance, offset: float):
        self._x, self._y = reference.q[:, 0].tolist(), reference.q[:, 1].tolist()
        self._heading: list[float] = reference.heading.tolist()
        self._arc: list[float] = reference.arc.tolist()
        self._last = len(self._x) - 2
        self._dwell, self._ahead = guidance.dwell, guidance.ahead
        self._rod, self._offset = vehicle.pivot_distance + offset, offset
        self._hysteresis: list[float] = hysteresis(reference, vehicle, guidance.swing).tolist()
        self._twist: list[list[float]] = vehicle.twist.tolist()
        self._lag = vehicle.lag.tolist()
        self._rest = vehicle.rest.tolist()
        self._current: list[float] = vehicle.current.tolist()
        self._lag_angle = 0.0
        self._lean = 0.0  # angle by which the reference is turned about the tracked point
        self.place = 0
        self.share = 0.0  # of the step at the place
        self._error = self._last_error = self._bias = self._reached = 0.0

    def update_vehicle(self, twist: list[list[float]], lag_angle: float, current: list[float]) -> None:
        """Update the vehicle: twists (2, 3), an offset added to all lag angles, and a current (2,)."""
        self._twist, self._lag_angle, self._current = twist, lag_angle, current

    def pose_after(
        self, pose: tuple[float, float, float], sense: int, before: float | None, time: float
    ) -> tuple[float, float, float]:
        """Predict the pose of the head's centre after `time` in direction `sense`."""
        side = 0 if sense > 0 else 1
        z, x, turned = self.lag_after(side, before, time)
        turned += sense * self._lag_angle
        forward, left, rate = self._twist[side]
        along, across, angle = arc_terms(rate, time)
        ahead, aside = along * forward - across * left, across * forward + along * left
        c, s = math.cos(turned), math.sin(turned)
        z, x = z + c * ahead - s * aside, x + s * ahead + c * aside
        c, s = math.cos(pose[2]), math.sin(pose[2])
        return (
            pose[0] + c * z - s * x + self._current[0] * time,
            pose[1] + s * z + c * x + self._current[1] * time,
            pose[2] + turned + angle,
        )

    def lag_after(self, side: int, before: float | None, time: float) -> tuple[float, float, float]:
        """Interpolate the lag after `time` in direction `side` (0: positive, 1: negative); None: from rest."""
        u = time / STEP
        i = int(u)
        rest = self._rest[side]
        if i > len(rest) - 2:
            i, w = len(rest) - 2, 1.0
        else:
            w = u - i
        if before is None:
            (z0, x0, a0), (z1, x1, a1) = rest[i], rest[i + 1]
            return z0 + w * (z1 - z0), x0 + w * (x1 - x0), a0 + w * (a1 - a0)
        k, part = _knot_below(before)
        shorter, longer = self._lag[side][k], self._lag[side][k + 1]
        (z0, x0, a0), (z1, x1, a1) = shorter[i], shorter[i + 1]
        z, x, turned = z0 + w * (z1 - z0), x0 + w * (x1 - x0), a0 + w * (a1 - a0)
        if part:
            (z0, x0, a0), (z1, x1, a1) = longer[i], longer[i + 1]
            z += part * (z0 + w * (z1 - z0) - z)
            x += part * (x0 + w * (x1 - x0) - x)
            turned += part * (a0 + w * (a1 - a0) - turned)
        return z, x, turned

    def integrate(self, pose: tuple[float, float, float], sense: int) -> None:
        """Add the mean error of the last two dwells to the integral; errors at flips alternate."""
        self._excess(pose, sense)
        reached = self._arc[self.place]
        advance, self._reached = reached - self._reached, reached
        self._bias += (self._error + self._last_error) * advance / (4 * self._ahead**2)
        self._bias = min(max(self._bias, -MOST_BIAS), MOST_BIAS)
        self._last_error = self._error

    def _excess(self, pose: tuple[float, float, float], sense: int) -> float:
        """Compute σ(φ − φ_d) − h, which is zero at a flip; move the place to the step nearest to the pivot."""
        c, s = math.cos(pose[2]), math.sin(pose[2])
        heading = pose[2] - self._lean
        x, y = pose[0] + self._offset * c, pose[1] + self._offset * s  # tracked point
        x -= self._rod * math.cos(heading)
        y -= self._rod * math.sin(heading)
        i, xs, ys = self.place, self._x, self._y
        moved = 0
        while True:
            dx, dy = xs[i + 1] - xs[i], ys[i + 1] - ys[i]
            away_x, away_y = x - xs[i], y - ys[i]
            square = dx * dx + dy * dy
            share = (away_x * dx + away_y * dy) / square if square > 0 else 2.0
            if share > 1 and i < self._last and moved >= 0:
                i, moved = i + 1, 1
            elif share < 0 and i > 0 and moved <= 0:
                i, moved = i - 1, -1
            else:
                break
        self.place, self.share = i, share
        error = (dx * away_y - dy * away_x) / math.sqrt(square) if square > 0 else 0.0
        within = min(max(share, 0.0), 1.0)
        wanted = self._heading[i] + within * (self._heading[i + 1] - self._heading[i])
        self._error = error
        wanted -= math.atan(error / self._ahead) + self._bias
        return sense * (heading - wanted) - self._hysteresis[i]

    @property
    def ended(self) -> bool:
        return self.place >= self._last and self.share >= 1

    def approach(self, pose: POSE, sense: int, before: float | None, time: float) -> tuple[float, float]:
        """Move the place with the robot from `pose`, where the dwell began, nearly until `time`.

        The nearest step is sought from the last one. Seen from across a circle another step may be nearer, so the
        place moves in turns of at most LARGEST_TURN.

        Returns:
            When to look next, `time` or an earlier one at which the path has ended; and when it had not yet ended.
        """
        rate = abs(self._twist[0 if sense > 0 else 1][2])
        count, low = math.ceil(time * rate / LARGEST_TURN), 0.0
        for n in range(1, count):
            high = n * (time / count)
            self._excess(self.pose_after(pose, sense, before, high), sense)
            if self.ended:
                return high, low
            low = high
        return time, low

    def next_dwell(
        self, pose: tuple[float, float, float], sense: int, before: float | None, elapsed: float = 0.0
    ) -> tuple[float, bool]:
        """Compute the length of the dwell that began at `pose`, and whether the path ends in it.

        `elapsed` is the time since then: the motor cannot flip before it. The last dwell is trimmed. If it were
        too short for the motor, it is the shortest one or none at all, whichever ends nearer to the path's end.
        """
        time, ended = self.next_flip(pose, sense, before, elapsed)
        if ended and time < self._dwell and before is not None:
            time = self._dwell if 2 * time > self._dwell else 0.0
        return time, ended

    def next_flip(
        self, pose: tuple[float, float, float], sense: int, before: float | None, elapsed: float = 0.0
    ) -> tuple[float, bool]:
        """Compute the length of the dwell that began at `pose`, and whether the path ends in it."""
        rate = abs(self._twist[0 if sense > 0 else 1][2])
        place, longest, largest = self.place, TURNS / rate, LARGEST_STEP / rate
        time, low = self.approach(pose, sense, before, max(self._dwell, elapsed))
        value = self._excess(self.pose_after(pose, sense, before, time), sense)
        low_value, slope = None, rate
        for _ in range(MOST_LOOKS):
            if self.ended:
                return self._end(pose, sense, before, low, time), True
            if value >= 0 and (low_value is None or value < EXACT):
                return time, False
            if value >= 0:  # between two evaluations
                return self._root(pose, sense, before, (low, low_value or 0.0), (time, value)), False
            if -value < EXACT:
                return time, False
            low, low_value = time, value
            time += min(-1.02 * value / max(slope, 0.1 * rate), largest)
            if time > longest:
                if self.place <= place:
                    break
                place, longest = self.place, longest + TURNS / rate  # its circles lead along the path
            value = self._excess(self.pose_after(pose, sense, before, time), sense)
            slope = (value - low_value) / (time - low)
        raise InputError("the robot turns in circles and does not reach the path; check the path's scale")

    def _root(
        self,
        pose: tuple[float, float, float],
        sense: int,
        before: float | None,
        low: tuple[float, float],
        high: tuple[float, float],
    ) -> float:
        """Find the root between a value below zero and one above, by regula falsi (Illinois)."""
        (a, fa), (b, fb) = low, high
        for _ in range(HALVINGS):
            time = a - fa * (b - a) / (fb - fa)
            value = self._excess(self.pose_after(pose, sense, before, time), sense)
            if abs(value) < EXACT:
                break
            if value < 0:
                a, fa, fb = time, value, fb / 2
            else:
                b, fb, fa = time, value, fa / 2
        return time

    def _end(self, pose: POSE, sense: int, before: float | None, low: float, high: float) -> float:
        """Find the time at which the path ends, by bisection between a time before its end and one after it."""
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            self._excess(self.pose_after(pose, sense, before, middle), sense)
            low, high = (low, middle) if self.ended else (middle, high)
        return high


def arc_terms(rate: float, time: float) -> tuple[float, float, float]:
    """Return sin Ω T/Ω, (1 − cos Ω T)/Ω and Ω T."""
    angle = rate * time
    half = math.sin(angle / 2)
    return math.sin(angle) / rate, 2 * half * half / rate, angle


def _knot_below(before: float) -> tuple[int, float]:
    """Find the knot below the length of the dwell before, and the share of the step to the next knot."""
    if before >= _KNOTS[-1]:
        return len(_KNOTS) - 2, 1.0
    k = 0
    while before > _KNOTS[k + 1]:
        k += 1
    return k, max((before - _KNOTS[k]) / (_KNOTS[k + 1] - _KNOTS[k]), 0.0)


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
            switches = Switches(start.sense, np.array(dwells), np.array(poses))
            _check_duration(switches, reference, vehicle)
            return switches
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
