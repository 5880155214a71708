"""Line-of-sight guidance: the equation for the next flip, which `planner.planning.schedule` explains.

`planner.planning.schedule` plans with it and `planner.tracking.tracker` keeps a robot on its path with it. Both
ask for one flip at a time, so it computes with plain numbers, in the order of operations of
`planner/c/follower.h`. A pose is x, y and heading of the head's centre. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planner.paths.tractrix import Reference
from planner.vehicle.vehicle import BEFORE_KNOTS, STEP, Vehicle
from sim.arrays import Floats
from sim.io.errors import InputError

EXACT = 1e-7  # rad, of the heading at a flip
LARGEST_STEP = 0.4  # rad that the robot turns between two evaluations
TURNS = 4 * math.pi  # a dwell that turns further than this leads nowhere
MOST_BIAS = 0.3  # rad
HALVINGS = 30
MOST_LOOKS = 500  # evaluations of the equation for one dwell; about four are needed
_KNOTS: list[float] = BEFORE_KNOTS.tolist()


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
    def _ended(self) -> bool:
        return self.place >= self._last and self.share >= 1

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
        longest, largest = TURNS / rate, LARGEST_STEP / rate
        time = max(self._dwell, elapsed)
        value = self._excess(self.pose_after(pose, sense, before, time), sense)
        low, low_value, slope = 0.0, None, rate
        for _ in range(MOST_LOOKS):
            if self._ended:
                return self._end(pose, sense, before, time), True
            if value >= 0 and (low_value is None or value < EXACT):
                return time, False
            if value >= 0:  # between two evaluations
                return self._root(pose, sense, before, (low, low_value or 0.0), (time, value)), False
            if -value < EXACT:
                return time, False
            low, low_value = time, value
            time += min(-1.02 * value / max(slope, 0.1 * rate), largest)
            if time > longest:
                break
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

    def _end(self, pose: tuple[float, float, float], sense: int, before: float | None, time: float) -> float:
        """Find the time at which the path ends, by bisection."""
        low, high = 0.0, time
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            self._excess(self.pose_after(pose, sense, before, middle), sense)
            low, high = (low, middle) if self._ended else (middle, high)
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
