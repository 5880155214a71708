"""Kalman filter of the tracker: thirteen numbers of the robot and their covariance, estimated from poses.

    x, y, heading    of the head's centre at the last flip
    yaw rates        relative errors of the plan's, left and right
    surge, sway      relative errors of the speeds forward and to the side
    lag angle        error of the angle that a flip adds to the heading
    current x, y     beside the plan's
    marker x, y      its place in the robot, forward and left of the head's centre: poses are those of the marker
    marker angle     by which it is turned on the robot, to the left: headings are those of the marker

A dwell moves the pose by lag and arc of the robot as estimated so far. The estimates follow a random walk, a small
step in each dwell, so that changes are tracked. All derivatives are exact, and only arithmetic, sin, cos and sqrt
are used: `planner/c/estimate.h` does the same in C. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import mul
from typing import NamedTuple

import numpy as np

from planner.planning.line_of_sight import arc_terms
from planner.planning.planned import Plan
from planner.tracking.guidance import LearnedDrift, TrackerGuidance
from planner.vehicle.vehicle import interpolated

POSE = tuple[float, float, float]
ROWS = list[list[float]]
NAMES = ("x", "y", "heading", "yaw rate, left", "yaw rate, right", "surge", "sway", "lag angle",
         "current x", "current y", "marker, forward", "marker, left", "marker, angle")  # fmt: skip
STATES = len(NAMES)
PRIOR = (0.03, 0.03, 0.03, 0.03)  # standard deviations beside the plan's own: yaw rates, surge, sway
CHANGES = (1.5e-3, 1.5e-3, 5e-4, 5e-4)  # their process noise, standard deviation per dwell
WALK = 3e-4  # process noise of the pose per dwell [l, rad]
MOST = (0.5, 0.5, 0.5, 0.5, 0.3)  # bounds of the estimated yaw rates, surge, sway, lag angle
CURRENT = 0.07  # standard deviation of a current beside the plan's, in net speeds
MOST_CURRENT = 0.5  # of the net speed
MARKER = (0.05, 0.05, 0.2)  # standard deviations of the marker's place [l] and angle [rad] before the first pose
MOST_MARKER = (0.5, 0.5, 1.0)


class Dwell(NamedTuple):
    """A dwell of the past; `before` is None for the first one."""

    start: float
    sense: int
    before: float | None
    length: float


class Estimate:
    """State (13,) and covariance (13, 13) at the last flip.

    Args:
        plan: gives the robot and where it starts.
        law: guidance of the same plan; its vehicle is updated with the estimates.
        noise: standard deviations of a pose: of x and y [l], of the heading [rad].
        start: pose at rest if it is not the plan's; known like a measured one.
    """

    def __init__(self, plan: Plan, law: TrackerGuidance, noise: tuple[float, float], start: POSE | None = None):
        self._twist: ROWS = plan.tracked.vehicle.twist.tolist()
        self._current: list[float] = plan.tracked.vehicle.current.tolist()
        self._speed, self._drift = float(plan.straight.speed), float(plan.straight.drift)
        self._law = law
        self.noise = (noise[0] ** 2, noise[0] ** 2, noise[1] ** 2)  # variances
        self._most = most(plan)
        self.state: list[float] = [*plan.start, *[0.0] * (STATES - 3)]
        self.covariance = prior(plan)
        if start is not None:
            self.relocate(start)

    @property
    def pose(self) -> POSE:
        return self.state[0], self.state[1], self.state[2]

    def apply(self) -> None:
        """Let the guidance law use the learned robot."""
        state = self.state
        current_x, current_y = self._current[0] + state[8], self._current[1] + state[9]
        self._law.update_vehicle([self._learned(0), self._learned(1)], state[7], [current_x, current_y])
        speed = self._speed * (1 + state[5])
        sideways = self._drift + self._sideways()
        self._law.update_drift(LearnedDrift(sideways / speed, current_x / speed, current_y / speed))

    def advance(self, dwell: Dwell) -> None:
        """Advance to the flip at the end of a dwell."""
        change = self._change(self.state[2], dwell, dwell.length)
        self.covariance = _propagated(self.covariance, _after(_identity(), change))
        for i in range(3):
            self.state[i] += change.move[i]

    def seen_from(self, when: float, now: Dwell, past: Sequence[Dwell]) -> tuple[POSE, ROWS] | None:
        """Predict what is seen at `when`, and its derivatives (3, 13) in the state; None if it is too long ago.

        Args: as for `pose_at`.
        """
        prediction = self.pose_at(when, now, past)
        if prediction is None:
            return None
        (x, y, heading), D = prediction
        c, s, (forward, left, angle) = math.cos(heading), math.sin(heading), self.state[10:]
        marker_x, marker_y = c * forward - s * left, s * forward + c * left
        for k in range(STATES):
            D[0][k], D[1][k] = D[0][k] - marker_y * D[2][k], D[1][k] + marker_x * D[2][k]
        D[0][10], D[0][11] = D[0][10] + c, D[0][11] - s
        D[1][10], D[1][11] = D[1][10] + s, D[1][11] + c
        D[2][12] += 1
        return (x + marker_x, y + marker_y, heading + angle), D

    def pose_at(self, when: float, now: Dwell, past: Sequence[Dwell]) -> tuple[POSE, ROWS] | None:
        """Predict the pose at `when`, and its derivatives (3, 13) in the state; None if it is too long ago.

        Args:
            when: the time.
            now: the present dwell; its length does not count.
            past: the dwells before it, the latest last.
        """
        x, y, heading = self.pose
        D, dwell, back = _identity(), now, len(past)
        while when < dwell.start:
            if back == 0:
                return None
            back -= 1
            dwell = past[back]
            heading -= self._change(0.0, dwell, dwell.length).move[2]
            change = self._change(heading, dwell, dwell.length)
            x, y = x - change.move[0], y - change.move[1]
            D = _before(D, change)
        change = self._change(heading, dwell, when - dwell.start)
        x, y, heading = x + change.move[0], y + change.move[1], heading + change.move[2]
        return (x, y, heading), _after(D, change)

    def residual(self, pose: POSE, when: float, now: Dwell, past: Sequence[Dwell], base: POSE) -> POSE | None:
        """Subtract from a pose what would be seen if the robot had been at `base` at the last flip."""
        own, self.state[:3] = self.state[:3], base
        prediction = self.seen_from(when, now, past)
        self.state[:3] = own
        return None if prediction is None else difference(pose, prediction[0])

    def turned_back(self, pose: POSE, when: float, now: Dwell, past: Sequence[Dwell]) -> POSE | None:
        """Return the pose at the last flip from which `pose` would be seen."""
        prediction = self.seen_from(when, now, past)
        if prediction is None:
            return None
        (x, y, heading), turn = self.pose, pose[2] - prediction[0][2]
        c, s, dx, dy = math.cos(turn), math.sin(turn), x - prediction[0][0], y - prediction[0][1]
        return pose[0] + c * dx - s * dy, pose[1] + s * dx + c * dy, heading + turn

    def spread(self, D: ROWS, direction: float, lever: float) -> float:
        """Compute the standard deviation of a point in a direction.

        Args:
            D: derivatives (3, 13) of the pose.
            direction: in the lab [rad].
            lever: what a turn of the robot by one rad moves the point in this direction.
        """
        x, y = math.cos(direction), math.sin(direction)
        g = [x * D[0][k] + y * D[1][k] + lever * D[2][k] for k in range(STATES)]
        return math.sqrt(max(_dot([_dot(row, g) for row in self.covariance], g), 0.0))

    def moved(self, pose: POSE, dwell: Dwell) -> POSE:
        """Return the pose after a dwell that began at `pose`."""
        x, y, turned = self._change(pose[2], dwell, dwell.length).move
        return pose[0] + x, pose[1] + y, pose[2] + turned

    def relocate(self, pose: POSE) -> None:
        """Put the robot at another pose, known like one of the marker; what was learned stays."""
        self.state[:3] = pose
        for i in range(3):
            for j in range(STATES):
                self.covariance[i][j] = self.covariance[j][i] = 0.0
            self.covariance[i][i] = self.noise[i] + self.covariance[10 + i][10 + i]

    def update(self, residual: POSE, H: ROWS, largest: float) -> float:
        """Update the state with a measured pose, unless its squared residual exceeds `largest`.

        Args:
            residual: measured pose less the expected one.
            H: derivatives (3, 13) of the expected pose.
            largest: squared size above which the pose is rejected.

        Returns:
            The squared size of the residual in its standard deviations: χ² with three degrees of freedom.
        """
        P, size = [row[:] for row in self.covariance], 0.0
        moved = [0.0] * STATES
        for m in range(3):
            h = H[m]
            gain = [_dot(row, h) for row in P]
            spread = _dot(h, gain) + self.noise[m]
            innovation = residual[m] - _dot(h, moved)
            size += innovation * innovation / spread
            for i in range(STATES):
                moved[i] += gain[i] * innovation / spread
                for j in range(STATES):
                    P[i][j] -= gain[i] * gain[j] / spread
        if size <= largest:
            self.covariance = P
            for i in range(STATES):
                self.state[i] += moved[i]
            for i, limit in enumerate(self._most):
                self.state[3 + i] = min(max(self.state[3 + i], -limit), limit)
        return size

    def _learned(self, side: int) -> list[float]:
        """Return the learned twist of a direction."""
        forward, left, rate = self._twist[side]
        return [forward * (1 + self.state[5]), left * (1 + self.state[6]), rate * (1 + self.state[3 + side])]

    def _sideways(self) -> float:
        """Compute the mean leftward speed, beside the plan's, that comes from unequal turns."""
        (_, left, fast), (_, right, slow) = self._twist
        a, b = fast * (1 + self.state[3]), -slow * (1 + self.state[4])
        learned = (b * left + a * right) * (1 + self.state[6]) / (a + b)
        return learned - (-slow * left + fast * right) / (fast - slow)

    def _change(self, heading: float, dwell: Dwell, time: float) -> _Change:
        """Compute what a time in a dwell that began with `heading` adds to the pose."""
        state, sense = self.state, dwell.sense
        side = 0 if sense > 0 else 1
        z, x, turned = self._law.lag_after(side, dwell.before, time)
        turned += sense * state[7]
        forward, left, rate = self._learned(side)
        along, across, angle = arc_terms(rate, time)
        more = 1 + state[3 + side]
        along_r, across_r = (time * math.cos(angle) - along) / more, (time * math.sin(angle) - across) / more
        ahead_r, aside_r = along_r * forward - across_r * left, across_r * forward + along_r * left
        c, s = math.cos(heading), math.sin(heading)
        lag_x, lag_y = c * z - s * x, s * z + c * x
        c, s = math.cos(heading + turned), math.sin(heading + turned)
        surge_x, surge_y = (c * along - s * across) * forward, (s * along + c * across) * forward
        sway_x, sway_y = -(c * across + s * along) * left, (c * along - s * across) * left
        arc_x, arc_y = surge_x + sway_x, surge_y + sway_y
        B = [[0.0] * STATES for _ in range(3)]
        B[0][3 + side], B[1][3 + side] = c * ahead_r - s * aside_r, s * ahead_r + c * aside_r
        B[2][3 + side] = angle / more
        B[0][5], B[1][5] = surge_x / (1 + state[5]), surge_y / (1 + state[5])
        B[0][6], B[1][6] = sway_x / (1 + state[6]), sway_y / (1 + state[6])
        B[0][7], B[1][7], B[2][7] = -sense * arc_y, sense * arc_x, float(sense)
        B[0][8] = B[1][9] = time
        x, y = lag_x + arc_x, lag_y + arc_y
        current_x, current_y = self._current[0] + state[8], self._current[1] + state[9]
        return _Change((x + current_x * time, y + current_y * time, turned + angle), (-y, x), B)


class _Change(NamedTuple):
    """What is added to a pose; its derivatives in the heading before (x, y), and in the state (3, 13)."""

    move: POSE
    lever: tuple[float, float]
    B: ROWS


def prior(plan: Plan) -> ROWS:
    """Compute the covariance (13, 13) before the first pose, from what is uncertain of the start and the plan."""
    vehicle = plan.tracked.vehicle
    P = np.diag([0.02**2, 0.02**2, 0.03**2, *(s**2 for s in PRIOR), 1e-6, 1e-12, 1e-12,
                 *(s**2 for s in MARKER)])  # fmt: skip
    speed = math.hypot(vehicle.twist[0, 0], vehicle.twist[0, 1])
    dwell = plan.minimum_dwell
    for mode in vehicle.modes:
        direction = np.zeros(STATES)
        direction[3:5] = mode.twist[:, 2] / vehicle.twist[:, 2]
        direction[5:7] = (
            mode.twist[0, :2] * vehicle.twist[0, :2] / np.maximum(vehicle.twist[0, :2] ** 2, 1e-6 * speed**2)
        )
        if mode.lag is not None:
            direction[7] = interpolated(mode.lag[0], dwell, dwell)[2]
        direction[8:10] = mode.current
        P += np.outer(direction, direction)
    P[8, 8] += (CURRENT * plan.straight.net_speed) ** 2
    P[9, 9] += (CURRENT * plan.straight.net_speed) ** 2
    return [[float(value) for value in row] for row in P]


def most(plan: Plan) -> tuple[float, ...]:
    """Return the largest absolute values (10,) of the learned numbers."""
    current = MOST_CURRENT * plan.straight.net_speed
    return *MOST, current, current, *MOST_MARKER


def difference(pose: POSE, expected: POSE) -> POSE:
    """Subtract two poses; the difference of the headings is between −π and π."""
    angle = pose[2] - expected[2]
    angle -= 2 * math.pi * math.floor((angle + math.pi) / (2 * math.pi))
    return pose[0] - expected[0], pose[1] - expected[1], angle


def _identity() -> ROWS:
    return [[float(i == j) for j in range(STATES)] for i in range(3)]


def _after(D: ROWS, change: _Change) -> ROWS:
    """Compute derivatives of the pose after a change from those before it."""
    B, lever = change.B, change.lever
    return [
        [D[0][k] + B[0][k] + lever[0] * D[2][k] for k in range(STATES)],
        [D[1][k] + B[1][k] + lever[1] * D[2][k] for k in range(STATES)],
        [D[2][k] + B[2][k] for k in range(STATES)],
    ]


def _before(D: ROWS, change: _Change) -> ROWS:
    """Compute derivatives of the pose before a change from those after it."""
    B, lever = change.B, change.lever
    turned = [D[2][k] - B[2][k] for k in range(STATES)]
    return [
        [D[0][k] - B[0][k] - lever[0] * turned[k] for k in range(STATES)],
        [D[1][k] - B[1][k] - lever[1] * turned[k] for k in range(STATES)],
        turned,
    ]


def _propagated(P: ROWS, F: ROWS) -> ROWS:
    """Propagate a covariance: the first three rows of the transition are F, the others keep the state."""
    n = STATES
    half = [[sum(F[i][k] * P[k][j] for k in range(n)) for j in range(n)] for i in range(3)] + P[3:]
    full = [row[:] for row in half]
    for i in range(n):
        for j in range(3):
            full[i][j] = _dot(half[i], F[j])
    for i in range(3):
        full[i][i] += WALK**2
    for i, change in enumerate(CHANGES):
        full[3 + i][3 + i] += change**2
    return full


def _dot(a: list[float], b: list[float]) -> float:
    return sum(map(mul, a, b))
