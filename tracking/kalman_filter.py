"""Kalman filter of the tracker: thirteen numbers of the robot and their covariance, estimated from poses.

    x, y, heading    of the head's centre at the last flip
    yaw rates        relative errors of the plan's, left and right
    surge, sway      relative errors of the speeds forward and to the side
    lag angle        error of the angle that a flip adds to the heading
    current x, y     beside the plan's
    marker x, y      its place in the robot, forward and left of the head's centre: poses are those of the marker
    marker angle     by which it is turned on the robot, to the left: headings are those of the marker

A dwell moves the pose by lag and arc of the robot as estimated so far. The estimates follow a random walk, a small
step in each dwell, so that changes are tracked. All derivatives are exact. Vectors in the
plane are complex numbers. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from common.arrays import Floats
from planner.guidance.law import arc_terms
from planner.paths.tractrix import Drift
from planner.planning.plan import Plan
from planner.vehicle.vehicle import interpolated
from sim.mechanics.planar import POSE
from tracking.guidance import TrackerGuidance

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
_PROCESS = np.diag([*[WALK**2] * 3, *(change**2 for change in CHANGES), *[0.0] * 6])


class Dwell(NamedTuple):
    """A dwell of the past; `before` is REST for the first one."""

    start: float
    sense: int
    before: float
    length: float


class Change(NamedTuple):
    """What a time in a dwell adds to a pose, and its derivatives."""

    move: POSE
    by_pose: Floats  # (3, 3), of the pose after it by the pose before it
    by_state: Floats  # (3, 13), of what is added

    def after(self, D: Floats) -> Floats:
        """Compute derivatives (3, 13) of the pose after the change from those before it."""
        return np.asarray(self.by_pose @ D + self.by_state)

    def before(self, D: Floats) -> Floats:
        """Compute derivatives (3, 13) of the pose before the change from those after it."""
        return np.asarray((2 * np.eye(3) - self.by_pose) @ (D - self.by_state))  # by_pose − 1 is nilpotent


class Estimate:
    """State (13,) and covariance (13, 13) at the last flip.

    Args:
        plan: gives the robot and where it starts.
        law: guidance of the same plan; its vehicle is updated with the estimates.
        noise: standard deviations of a pose: of x and y [l], of the heading [rad].
        start: pose at rest if it is not the plan's; known like a measured one.
    """

    def __init__(self, plan: Plan, law: TrackerGuidance, noise: tuple[float, float], start: POSE | None = None):
        self._twist: list[list[float]] = plan.tracked.vehicle.twist.tolist()
        self._current: list[float] = plan.tracked.vehicle.current.tolist()
        self._speed, self._drift = float(plan.straight.speed), float(plan.straight.drift)
        self._law = law
        self.noise = np.square([noise[0], noise[0], noise[1]])  # variances
        current = MOST_CURRENT * plan.straight.net_speed
        self._most = np.array([*MOST, current, current, *MOST_MARKER])  # of the learned numbers, in size
        self.state = np.array([*plan.start, *[0.0] * (STATES - 3)])
        self.covariance = prior(plan)
        if start is not None:
            self.relocate(start)

    @property
    def pose(self) -> POSE:
        x, y, heading = self.state[:3].tolist()
        return x, y, heading

    def apply(self) -> None:
        """Let the guidance law use the learned robot."""
        state = self.state.tolist()
        current_x, current_y = self._current[0] + state[8], self._current[1] + state[9]
        self._law.update_vehicle([self._learned(0), self._learned(1)], state[7], [current_x, current_y])
        speed = self._speed * (1 + state[5])
        sideways = self._drift + self._sideways()
        self._law.update_drift(Drift(sideways / speed, (current_x / speed, current_y / speed)))

    def advance(self, dwell: Dwell) -> None:
        """Advance to the flip at the end of a dwell."""
        change = self._change(self.pose[2], dwell, dwell.length)
        F = np.eye(STATES)
        F[:3] = change.after(F[:3])
        self.covariance = F @ self.covariance @ F.T + _PROCESS
        self.state[:3] += change.move

    def seen_from(
        self, when: float, now: Dwell, past: Sequence[Dwell], base: POSE | None = None
    ) -> tuple[POSE, Floats] | None:
        """Predict what is seen at `when`, and its derivatives (3, 13) in the state; None if it is too long ago.

        Args: as for `pose_at`.
        """
        prediction = self.pose_at(when, now, past, base)
        if prediction is None:
            return None
        (x, y, heading), D = prediction
        axis, (forward, left, angle) = _direction(heading), self.state[10:].tolist()
        marker = axis * complex(forward, left)
        H = _levered(marker) @ D
        H[:, 10:] += [[axis.real, -axis.imag, 0.0], [axis.imag, axis.real, 0.0], [0.0, 0.0, 1.0]]
        return (x + marker.real, y + marker.imag, heading + angle), H

    def pose_at(
        self, when: float, now: Dwell, past: Sequence[Dwell], base: POSE | None = None
    ) -> tuple[POSE, Floats] | None:
        """Predict the pose at `when`, and its derivatives (3, 13) in the state; None if it is too long ago.

        Args:
            when: the time.
            now: the present dwell; its length does not count.
            past: the dwells before it, the latest last.
            base: pose at the last flip; default: the estimated one.
        """
        x, y, heading = self.pose if base is None else base
        D, dwell, back = np.eye(3, STATES), now, len(past)
        while when < dwell.start:
            if back == 0:
                return None
            back -= 1
            dwell = past[back]
            heading -= self._change(0.0, dwell, dwell.length).move[2]
            change = self._change(heading, dwell, dwell.length)
            x, y = x - change.move[0], y - change.move[1]
            D = change.before(D)
        change = self._change(heading, dwell, when - dwell.start)
        return (x + change.move[0], y + change.move[1], heading + change.move[2]), change.after(D)

    def residual(self, pose: POSE, when: float, now: Dwell, past: Sequence[Dwell], base: POSE) -> POSE | None:
        """Subtract from a pose what would be seen if the robot had been at `base` at the last flip."""
        prediction = self.seen_from(when, now, past, base)
        return None if prediction is None else difference(pose, prediction[0])

    def turned_back(self, pose: POSE, when: float, now: Dwell, past: Sequence[Dwell]) -> POSE | None:
        """Return the pose at the last flip from which `pose` would be seen."""
        prediction = self.seen_from(when, now, past)
        if prediction is None:
            return None
        (x, y, heading), turn = self.pose, pose[2] - prediction[0][2]
        moved = _direction(turn) * complex(x - prediction[0][0], y - prediction[0][1])
        return pose[0] + moved.real, pose[1] + moved.imag, heading + turn

    def spread(self, D: Floats, direction: float, lever: float) -> float:
        """Compute the standard deviation of a point in a direction.

        Args:
            D: derivatives (3, 13) of the pose.
            direction: in the lab [rad].
            lever: what a turn of the robot by one rad moves the point in this direction.
        """
        g = np.array([math.cos(direction), math.sin(direction), lever]) @ D
        return math.sqrt(max(float(g @ self.covariance @ g), 0.0))

    def moved(self, pose: POSE, dwell: Dwell) -> POSE:
        """Return the pose after a dwell that began at `pose`."""
        x, y, turned = self._change(pose[2], dwell, dwell.length).move
        return pose[0] + x, pose[1] + y, pose[2] + turned

    def relocate(self, pose: POSE) -> None:
        """Put the robot at another pose, known like one of the marker; what was learned stays."""
        self.state[:3] = pose
        self.covariance[:3], self.covariance[:, :3] = 0.0, 0.0
        self.covariance[:3, :3] = np.diag(self.noise + self.covariance.diagonal()[10:])

    def update(self, residual: POSE, H: Floats, largest: float) -> float:
        """Update the state with a measured pose, unless its squared residual exceeds `largest`.

        Args:
            residual: measured pose less the expected one.
            H: derivatives (3, 13) of the expected pose.
            largest: squared size above which the pose is rejected.

        Returns:
            The squared size of the residual in its standard deviations: χ² with three degrees of freedom.
        """
        innovation, PH = np.array(residual), self.covariance @ H.T
        weight = np.linalg.inv(H @ PH + np.diag(self.noise))
        with np.errstate(over="ignore", invalid="ignore"):  # a pose may be as far away as numbers go
            size = float(innovation @ weight @ innovation)
        if size <= largest:
            gain = PH @ weight
            kept = np.eye(STATES) - gain @ H  # Joseph's form: the covariance stays symmetric and positive
            self.covariance = kept @ self.covariance @ kept.T + gain * self.noise @ gain.T
            self.state += gain @ innovation
            self.state[3:] = np.clip(self.state[3:], -self._most, self._most)
        return size

    def _learned(self, side: int) -> list[float]:
        """Return the learned twist of a direction."""
        forward, left, rate = self._twist[side]
        errors = self.state.tolist()
        return [forward * (1 + errors[5]), left * (1 + errors[6]), rate * (1 + errors[3 + side])]

    def _sideways(self) -> float:
        """Compute the mean leftward speed, beside the plan's, that comes from unequal turns."""
        (_, left, fast), (_, right, slow) = self._twist
        a, b = self._learned(0)[2], -self._learned(1)[2]
        learned = (b * left + a * right) * (1 + float(self.state[6])) / (a + b)
        return learned - (-slow * left + fast * right) / (fast - slow)

    def _change(self, heading: float, dwell: Dwell, time: float) -> Change:
        """Compute what a time in a dwell that began with `heading` adds to the pose."""
        state, sense = self.state.tolist(), dwell.sense
        side = 0 if sense > 0 else 1
        z, x, turned = self._law.lag_after(side, dwell.before, time)
        turned += sense * state[7]
        forward, left, rate = self._learned(side)
        along, across, angle = arc_terms(rate, time)
        more = 1 + state[3 + side]
        axis = _direction(heading + turned)
        surge, sway = axis * complex(along, across) * forward, axis * complex(along, across) * 1j * left
        by_rate = complex(time * math.cos(angle) - along, time * math.sin(angle) - across) / more
        place = _direction(heading) * complex(z, x) + surge + sway
        plane, turn = np.zeros(STATES, dtype=complex), np.zeros(STATES)
        plane[3 + side] = axis * by_rate * complex(forward, left)
        plane[5:10] = surge / (1 + state[5]), sway / (1 + state[6]), 1j * sense * (surge + sway), time, 1j * time
        turn[3 + side], turn[7] = angle / more, sense
        drift = time * complex(self._current[0] + state[8], self._current[1] + state[9])
        move = (place + drift).real, (place + drift).imag, turned + angle
        return Change(move, _levered(place), np.stack([plane.real, plane.imag, turn]))


def prior(plan: Plan) -> Floats:
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
    P[[8, 9], [8, 9]] += (CURRENT * plan.straight.net_speed) ** 2
    return P


def difference(pose: POSE, expected: POSE) -> POSE:
    """Subtract two poses; the difference of the headings is between −π and π."""
    angle = pose[2] - expected[2]
    angle -= 2 * math.pi * math.floor((angle + math.pi) / (2 * math.pi))
    return pose[0] - expected[0], pose[1] - expected[1], angle


def _direction(angle: float) -> complex:
    return complex(math.cos(angle), math.sin(angle))


def _levered(arm: complex) -> Floats:
    """Return the derivatives (3, 3) of a pose at the end of an arm by the pose at its beginning."""
    return np.array([[1.0, 0.0, -arm.imag], [0.0, 1.0, arm.real], [0.0, 0.0, 1.0]])
