"""Switching times by hysteresis about the line of sight.

The reference of the pivot and its heading (`planner.tractrix.Reference`) give the wanted heading at every place:

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

from planner.tractrix import Reference
from planner.vehicle import BEFORE_KNOTS, STEP, Vehicle
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.mechanics import planar

MOST_SWITCHES = 200_000
_EXACT = 1e-7  # rad, of the heading at a flip
_LARGEST_STEP = 0.4  # rad that the robot turns between two evaluations
_TURNS = 4 * math.pi  # a dwell that turns further than this leads nowhere
_MOST_BIAS = 0.3  # rad
_EVERY = 2_000  # switches between two calls of `progress`
_KNOTS: list[float] = BEFORE_KNOTS.tolist()


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
    follower = _Follower(reference, vehicle, ahead, offset - pivot_distance, dwell, swing)
    follower.place = start.place
    follower.begin()
    pose, sense, before = start.pose, start.sense, start.before
    dwells: list[float] = []
    poses = [pose]
    while len(dwells) < most:
        time, ended = follower.next_flip(pose, sense, before)
        if ended and time < dwell and dwells:
            time = dwell if 2 * time > dwell else 0.0  # nearest that the motor may do
        if time > 0:
            pose = follower.moved(pose, sense, before, time)
            follower.learn(pose, sense)
            dwells.append(time)
            poses.append(pose)
            sense, before = -sense, time
        if ended:
            break
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
    heading = float(reference.heading[0]) - sense * float(_hysteresis(reference, vehicle, swing)[0])
    ahead = reference.p[0] - reference.q[0]
    rod = math.hypot(*ahead.tolist()) - offset
    x, y = (reference.q[0] + rod * np.array([math.cos(heading), math.sin(heading)])).tolist()
    return Start((x, y, heading), 0, sense)


def _hysteresis(reference: Reference, vehicle: Vehicle, swing: float) -> Floats:
    """h at every step of the reference; see the module."""
    bend = np.minimum(np.abs(reference.curvature) * vehicle.pivot_radius, 1.0)
    return np.asarray(swing * (1 + bend) / 2)


class _Follower:
    """The equation for the next flip, in plain numbers, because one switch at a time is asked for."""

    def __init__(self, reference: Reference, vehicle: Vehicle, ahead: float, behind: float, dwell: float,
                 swing: float):  # fmt: skip
        self._x, self._y = reference.q[:, 0].tolist(), reference.q[:, 1].tolist()
        self._heading: list[float] = reference.heading.tolist()
        self._last = len(self._x) - 2
        self._ahead, self._behind, self._dwell = ahead, behind, dwell
        self._hysteresis: list[float] = _hysteresis(reference, vehicle, swing).tolist()
        self._twist: list[list[float]] = vehicle.twist.tolist()
        self._lag = vehicle.lag.tolist()
        self._rest = vehicle.rest.tolist()
        self._current: list[float] = vehicle.current.tolist()
        self.place = 0
        self.share = 0.0  # of the segment at the place
        self._arc: list[float] = reference.arc.tolist()
        self._error = self._before = self._bias = self._reached = 0.0

    def begin(self) -> None:
        self._reached = self._arc[self.place]

    def moved(
        self, pose: tuple[float, float, float], sense: int, before: float | None, time: float
    ) -> tuple[float, float, float]:
        """Pose of the head's centre after `time` in direction `sense`."""
        side = 0 if sense > 0 else 1
        u = time / STEP
        i = int(u)
        rest = self._rest[side]
        if i > len(rest) - 2:
            i, w = len(rest) - 2, 1.0
        else:
            w = u - i
        if before is None:
            (z0, x0, a0), (z1, x1, a1) = rest[i], rest[i + 1]
            z, x, turned = z0 + w * (z1 - z0), x0 + w * (x1 - x0), a0 + w * (a1 - a0)
        else:
            k, part = _between(before)
            near, far = self._lag[side][k], self._lag[side][k + 1]
            (z0, x0, a0), (z1, x1, a1) = near[i], near[i + 1]
            z, x, turned = z0 + w * (z1 - z0), x0 + w * (x1 - x0), a0 + w * (a1 - a0)
            if part:
                (z0, x0, a0), (z1, x1, a1) = far[i], far[i + 1]
                z += part * (z0 + w * (z1 - z0) - z)
                x += part * (x0 + w * (x1 - x0) - x)
                turned += part * (a0 + w * (a1 - a0) - turned)
        forward, left, rate = self._twist[side]
        angle = rate * time
        along, across = math.sin(angle) / rate, (1 - math.cos(angle)) / rate
        ahead, aside = along * forward - across * left, across * forward + along * left
        c, s = math.cos(turned), math.sin(turned)
        z, x = z + c * ahead - s * aside, x + s * ahead + c * aside
        c, s = math.cos(pose[2]), math.sin(pose[2])
        return (
            pose[0] + c * z - s * x + self._current[0] * time,
            pose[1] + s * z + c * x + self._current[1] * time,
            pose[2] + turned + angle,
        )

    def learn(self, pose: tuple[float, float, float], sense: int) -> None:
        """Add the mean error of the last two dwells to the integral; errors at flips alternate."""
        self._look(pose, sense)
        reached = self._arc[self.place]
        way, self._reached = reached - self._reached, reached
        self._bias += (self._error + self._before) * way / (4 * self._ahead**2)
        self._bias = min(max(self._bias, -_MOST_BIAS), _MOST_BIAS)
        self._before = self._error

    def _look(self, pose: tuple[float, float, float], sense: int) -> float:
        """σ(φ − φ_d) − h; moves the place to the nearest one."""
        x = pose[0] + self._behind * math.cos(pose[2])
        y = pose[1] + self._behind * math.sin(pose[2])
        i, xs, ys = self.place, self._x, self._y
        came = 0
        while True:
            dx, dy = xs[i + 1] - xs[i], ys[i + 1] - ys[i]
            away_x, away_y = x - xs[i], y - ys[i]
            square = dx * dx + dy * dy
            share = (away_x * dx + away_y * dy) / square if square > 0 else 2.0
            if share > 1 and i < self._last and came >= 0:
                i, came = i + 1, 1
            elif share < 0 and i > 0 and came <= 0:
                i, came = i - 1, -1
            else:
                break
        self.place, self.share = i, share
        error = (dx * away_y - dy * away_x) / math.sqrt(square) if square > 0 else 0.0
        inside = min(max(share, 0.0), 1.0)
        wanted = self._heading[i] + inside * (self._heading[i + 1] - self._heading[i])
        self._error = error
        wanted -= math.atan(error / self._ahead) + self._bias
        return sense * (pose[2] - wanted) - self._hysteresis[i]

    @property
    def _ended(self) -> bool:
        return self.place >= self._last and self.share >= 1

    def next_flip(self, pose: tuple[float, float, float], sense: int, before: float | None) -> tuple[float, bool]:
        """Length of the dwell that begins at `pose`, and whether the path ends in it."""
        rate = abs(self._twist[0 if sense > 0 else 1][2])
        longest, largest = _TURNS / rate, _LARGEST_STEP / rate
        time = self._dwell
        value = self._look(self.moved(pose, sense, before, time), sense)
        low, low_value, slope = 0.0, None, rate
        while not self._ended:
            if value >= 0 and (low_value is None or value < _EXACT):
                return time, False
            if value >= 0:  # between two evaluations
                return self._root(pose, sense, before, (low, low_value or 0.0), (time, value)), False
            if -value < _EXACT:
                return time, False
            low, low_value = time, value
            time += min(-1.02 * value / max(slope, 0.1 * rate), largest)
            if time > longest:
                raise InputError("the robot turns in circles and does not reach the path; check the path's scale")
            value = self._look(self.moved(pose, sense, before, time), sense)
            slope = (value - low_value) / (time - low)
        return self._end(pose, sense, before, time), True

    def _root(
        self,
        pose: tuple[float, float, float],
        sense: int,
        before: float | None,
        low: tuple[float, float],
        high: tuple[float, float],
    ) -> float:
        """Regula falsi (Illinois) between a value below zero and one above."""
        (a, fa), (b, fb) = low, high
        for _ in range(30):
            time = a - fa * (b - a) / (fb - fa)
            value = self._look(self.moved(pose, sense, before, time), sense)
            if abs(value) < _EXACT:
                break
            if value < 0:
                a, fa, fb = time, value, fb / 2
            else:
                b, fb, fa = time, value, fa / 2
        return time

    def _end(self, pose: tuple[float, float, float], sense: int, before: float | None, time: float) -> float:
        """The time at which the path ends, by halving."""
        low, high = 0.0, time
        for _ in range(30):
            middle = (low + high) / 2
            self._look(self.moved(pose, sense, before, middle), sense)
            low, high = (low, middle) if self._ended else (middle, high)
        return high


def _between(before: float) -> tuple[int, float]:
    """Knot below the length of the dwell before, and the share of the step to the next."""
    if before >= _KNOTS[-1]:
        return len(_KNOTS) - 2, 1.0
    k = 0
    while before > _KNOTS[k + 1]:
        k += 1
    return k, max((before - _KNOTS[k]) / (_KNOTS[k + 1] - _KNOTS[k]), 0.0)


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
