"""Tracker: keeps a robot on its plan with poses from a camera, and learns the robot while it swims.

    tracker = Tracker(plan)
    advice = tracker.feed(now)                              # no pose
    advice = tracker.feed(now, (x, y, heading), seen_at)    # a pose, and when it was true

Every call says the direction of the motor and when to flip next. At most one flip can have happened since the
last call: the one that was announced. The tracker estimates nine numbers with a Kalman filter: the pose at the
last flip, relative errors of the two yaw rates and of the speed, an error of the lag's angle, and the current. A
pose may be late: it is compared with the place where the robot was then, counted back from now. Poses that cannot
be are left out; so are values that are not finite, and times that go back. A pose may be missing for as long as
you like.

The next flip is the root of the same equation as in planning (`planner.schedule`), from the estimated pose and
with the learned robot. It is never before the shortest dwell, whatever is fed.

Poses are those of the head's centre in l and rad; times in μ0 l⁴/EI. `planner.tracker_pipe` has seconds.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from planner.follower import Follower
from planner.plan import Plan
from sim.io.errors import InputError

POSE = tuple[float, float, float]
NAMES = ("x", "y", "heading", "yaw rate, left", "yaw rate, right", "speed", "lag angle", "current x", "current y")
STATES = len(NAMES)
FALSE_ALARM = 1e-3  # chance of an alarm per WINDOW poses, for a robot of this model
WINDOW = 40
KEPT = 12  # dwells that are remembered for late poses
LONGEST_GAP = 1e5  # time units; a clock that jumps further is not believed
_GATE = float(chi2.ppf(0.9999, 3))
_LOST = 10  # poses left out one after another, from which the pose is taken to be unknown
_STEPS = (1e-4, 1e-4, 1e-4, 1e-5, 1e-6, 1e-6)  # for derivatives by the learned numbers
_DOUBT = (0.03, 0.03, 0.03)  # standard deviations beside the plan's own: yaw rates, speed
_CHANGES = (1.5e-3, 1.5e-3, 5e-4)  # yaw rates and speed: what a dwell adds to their standard deviation
_WALK = 3e-4  # l and rad that a dwell adds to what is unknown of the pose


class Advice(NamedTuple):
    """What the motor does now, and when it must flip next."""

    direction: int  # +1 or −1; 0 at the end
    flip_at: float  # time of the next flip, or of the end
    finished: bool
    alarm: bool  # the robot behaves like no robot of this model: calibrate again
    error: float  # 95 % of the distance from the path that is now possible, zigzag included [l]


class _Dwell(NamedTuple):
    start: float
    sense: int
    before: float | None
    length: float


class Tracker:
    """See the module.

    Args:
        plan: the plan.
        noise: standard deviations of a pose: of x and y [l], of the heading [rad].
        latency: time from when a pose is true to when it is fed, if `seen_at` is not given.
        begin: time at which the motor starts.

    Example:
        >>> from softflagella import Tracker, circle, load_robot, plan
        >>> tracker = Tracker(plan(circle(2.0), load_robot("paper-control")))
        >>> advice = tracker.feed(0.0)
        >>> advice.direction, advice.flip_at > 0.2
        (1, True)
    """

    def __init__(
        self, plan: Plan, *, noise: tuple[float, float] = (0.01, 0.01), latency: float = 0.0, begin: float = 0.0
    ):
        vehicle = plan.vehicle
        self.shortest = plan.minimum_dwell
        self._follower = Follower(
            plan.guide, vehicle, plan.ahead, plan.pivot_distance, plan.offset, plan.minimum_dwell, plan.swing
        )
        self._twist: list[list[float]] = vehicle.twist.tolist()
        self._current: list[float] = vehicle.current.tolist()
        self._noise = (noise[0] ** 2, noise[0] ** 2, noise[1] ** 2)
        self._latency = latency
        self._speed = plan.net_speed
        self._swing_error = plan.predicted_max
        self.state: list[float] = [*plan.start, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        self.covariance = prior(plan)
        self._now = begin
        self._flip_time, self._sense = begin, plan.first_direction
        self._before: float | None = None
        self._past: deque[_Dwell] = deque(maxlen=KEPT)
        self._finished = False
        self._rejected = 0
        self._score, self._scored = 0.0, 0
        self._alarm_at = float(chi2.ppf(1 - FALSE_ALARM, 3 * WINDOW))
        self.alarm = False
        self._flip_at, self._ends = self._next()

    def feed(self, now: float, pose: POSE | None = None, seen_at: float | None = None) -> Advice:
        """Tell the time, and a pose if there is one.

        Args:
            now: the time; one that goes back, jumps too far or is not finite is taken for the last one.
            pose: x, y [l] and heading [rad] of the head's centre.
            seen_at: when the pose was true; default: `latency` ago.
        """
        if self._now < now < self._now + LONGEST_GAP:
            self._now = now
        if not self._finished and self._now >= self._flip_at:
            self._flip()
        if pose is not None:
            when = self._now - self._latency if seen_at is None else seen_at
            if (
                len(pose) == 3
                and all(map(math.isfinite, (*pose, when)))
                and when <= self._now
                and self._see(pose, when)
            ):
                self._plan_flip()
        return self.advice

    @property
    def advice(self) -> Advice:
        """The same answer again."""
        P = self.covariance
        error = self._swing_error + 1.96 * math.sqrt(max(P[0][0] + P[1][1], 0.0) / 2)
        return Advice(0 if self._finished else self._sense, self._flip_at, self._finished, self.alarm, error)

    @property
    def learned(self) -> dict[str, float]:
        """Estimates by name, see NAMES."""
        return dict(zip(NAMES, self.state, strict=True))

    def _flip(self) -> None:
        """The announced flip, or the end of the path."""
        if self._ends:
            self._finished = True
            return
        length = self._flip_at - self._flip_time
        x, F = self._carried(self.state, self._sense, self._before, length)
        self.state[:3] = x
        self.covariance = _propagated(self.covariance, F)
        self._follower.learn((x[0], x[1], x[2]), self._sense)
        self._past.append(_Dwell(self._flip_time, self._sense, self._before, length))
        self._flip_time, self._before, self._sense = self._flip_at, length, -self._sense
        self._plan_flip()

    def _plan_flip(self) -> None:
        at, self._ends = self._next()
        self._flip_at = max(at, self._now, self._flip_time + (0.0 if self._ends else self.shortest))

    def _next(self) -> tuple[float, bool]:
        """Time of the next flip, and whether the path ends there."""
        self._apply(self.state)
        place = self._follower.place
        x, y, heading = self.state[:3]
        try:
            length, ends = self._follower.next_dwell((x, y, heading), self._sense, self._before)
        except InputError:  # far off the path: swim on
            length, ends = self.shortest, False
        self._follower.place = place
        return self._flip_time + length, ends

    def _apply(self, state: list[float]) -> None:
        """Let the follower move like the learned robot."""
        speed = 1 + state[5]
        self._follower.set_robot(
            [
                [row[0] * speed, row[1] * speed, row[2] * (1 + state[3 + side])]
                for side, row in enumerate(self._twist)
            ],
            state[6],
            [self._current[0] + state[7], self._current[1] + state[8]],
            (self._sideways(state) / self._speed, state[7] / self._speed, state[8] / self._speed),
        )

    def _sideways(self, state: list[float]) -> float:
        """Mean speed to the left, beside the plan's, that comes from unequal turns."""
        (_, left, fast), (_, right, slow) = self._twist
        a, b = fast * (1 + state[3]), -slow * (1 + state[4])
        return ((b * left + a * right) * (1 + state[5]) / (a + b)) - (-slow * left + fast * right) / (fast - slow)

    def _moved(self, state: list[float], sense: int, before: float | None, time: float) -> POSE:
        self._apply(state)
        return self._follower.moved((state[0], state[1], state[2]), sense, before, time)

    def _carried(
        self, state: list[float], sense: int, before: float | None, time: float
    ) -> tuple[list[float], list[list[float]]]:
        """Pose after `time`, and its derivatives (3, 9) by the state."""
        pose = self._moved(state, sense, before, time)
        F = [[0.0] * STATES for _ in range(3)]
        F[0][0] = F[1][1] = F[2][2] = 1.0
        drift_x, drift_y = (self._current[i] * time + state[7 + i] * time for i in (0, 1))
        F[0][2], F[1][2] = -(pose[1] - state[1] - drift_y), pose[0] - state[0] - drift_x
        for k, step in enumerate(_STEPS):
            other = list(state)
            other[3 + k] += step
            end = self._moved(other, sense, before, time)
            for i in range(3):
                F[i][3 + k] = (end[i] - pose[i]) / step
        return list(pose), F

    def _seen_from(self, when: float) -> tuple[list[float], list[list[float]]] | None:
        """Pose at the time `when`, and its derivatives (3, 9) by the state; None if it is too long ago."""
        if when >= self._flip_time:
            return self._carried(self.state, self._sense, self._before, when - self._flip_time)
        needed = []
        for dwell in reversed(self._past):
            needed.append(dwell)
            if dwell.start <= when:
                break
        else:
            return None
        pose = self._back(self.state, needed, when)
        H = [[0.0] * STATES for _ in range(3)]
        for k in range(STATES):
            step = 1e-5 if k < 3 else _STEPS[k - 3]
            other = list(self.state)
            other[k] += step
            end = self._back(other, needed, when)
            for i in range(3):
                H[i][k] = (end[i] - pose[i]) / step
        return pose, H

    def _back(self, state: list[float], dwells: list[_Dwell], when: float) -> list[float]:
        """Pose at `when`, counted back over dwells (the latest first)."""
        now = list(state)
        for dwell in dwells:
            own = [0.0, 0.0, 0.0, *state[3:]]
            z, x, turned = self._moved(own, dwell.sense, dwell.before, dwell.length)
            cx, cy = ((self._current[i] + state[7 + i]) * dwell.length for i in (0, 1))
            now[2] -= turned
            c, s = math.cos(now[2]), math.sin(now[2])
            z, x = z - cx, x - cy
            now[0] -= c * z - s * x + cx
            now[1] -= s * z + c * x + cy
        last = dwells[-1]
        return list(self._moved(now, last.sense, last.before, when - last.start))

    def _see(self, pose: POSE, when: float) -> bool:
        """Learn from a pose; false if it was left out."""
        found = self._seen_from(when)
        if found is None:
            return False
        expected, H = found
        left = [pose[0] - expected[0], pose[1] - expected[1], _wrapped(pose[2] - expected[2])]
        state, P, size = _updated(self.state, self.covariance, left, H, self._noise)
        self._judge(min(size, 2 * _GATE))
        if not size <= _GATE:
            self._rejected += 1
            if self._rejected >= _LOST:  # many in a row: it is the estimate that is wrong
                self._rejected = 0
                for i in range(3):
                    self.covariance[i][i] += 0.3**2
            return False
        self._rejected = 0
        self.state, self.covariance = state, P
        return True

    def _judge(self, size: float) -> None:
        """Compare the sum over WINDOW poses with what a robot of this model gives."""
        self._score += size
        self._scored += 1
        if self._scored == WINDOW:
            self.alarm = self._score > self._alarm_at
            self._score, self._scored = 0.0, 0


def prior(plan: Plan) -> list[list[float]]:
    """Covariance (9, 9) before the first pose: how well the robot was put, and what the plan says of the rest."""
    vehicle = plan.vehicle
    P = np.diag([0.02**2, 0.02**2, 0.03**2, *(s**2 for s in _DOUBT), 1e-6, 1e-12, 1e-12])
    speed = np.hypot(vehicle.twist[0, 0], vehicle.twist[0, 1])
    for mode in vehicle.modes:
        one = np.zeros(STATES)
        one[3:5] = mode.twist[:, 2] / vehicle.twist[:, 2]
        one[5] = mode.twist[0, :2] @ vehicle.twist[0, :2] / speed**2
        one[6] = mode.lag[0, 2]
        one[7:] = mode.current
        P += np.outer(one, one)
    P[7, 7] += (0.05 * speed) ** 2 / 4
    P[8, 8] += (0.05 * speed) ** 2 / 4
    return [[float(value) for value in row] for row in P]


def _propagated(P: list[list[float]], F: list[list[float]]) -> list[list[float]]:
    """Covariance after a dwell: the first three rows of the transition are F, the others keep the state."""
    n = STATES
    half = [[sum(F[i][k] * P[k][j] for k in range(n)) for j in range(n)] for i in range(3)] + [
        row[:] for row in P[3:]
    ]
    full = [row[:] for row in half]
    for i in range(n):
        for j in range(3):
            full[i][j] = sum(half[i][k] * F[j][k] for k in range(n))
    for i in range(3):
        full[i][i] += _WALK**2
        full[3 + i][3 + i] += _CHANGES[i] ** 2
    return full


def _updated(
    state: list[float],
    P: list[list[float]],
    left: list[float],
    H: list[list[float]],
    noise: tuple[float, float, float],
) -> tuple[list[float], list[list[float]], float]:
    """State and covariance after three measured numbers, one by one, and the squared size of what was left."""
    n = STATES
    state, P, size = list(state), [row[:] for row in P], 0.0
    moved = [0.0] * n
    for m in range(3):
        h = H[m]
        gain = [sum(P[i][k] * h[k] for k in range(n)) for i in range(n)]
        spread = sum(h[k] * gain[k] for k in range(n)) + noise[m]
        rest = left[m] - sum(h[k] * moved[k] for k in range(n))
        size += rest * rest / spread
        for i in range(n):
            moved[i] += gain[i] * rest / spread
            for j in range(n):
                P[i][j] -= gain[i] * gain[j] / spread
    return [a + b for a, b in zip(state, moved, strict=True)], P, size


def _wrapped(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi
