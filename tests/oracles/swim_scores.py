"""How much of an effect the track of a swim shows.

The size λ of an effect is in standard deviations of its score in the first two thirds of a swim, under the true
covariance of the camera's noise and of the kicks, beside all that is fitted anyway: coefficients, start, marker
and current are free, the robot's numbers and the camera's scale have their priors.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from calibration.linear.memory import Memory
from calibration.swimmer.influences import CAMERA, SLIP, TABLE_DEFAULTS, influences
from common.arrays import Floats
from sim.knowledge import COEFFICIENTS, NUMBERS
from sim.mechanics import planar
from sim.model.robot import Robot
from sim.motion.run import Resolution
from tests.oracles.drawn_swims import LabSwim
from tests.oracles.swims import swum

FITTED = 2 / 3  # of a swim
_STEP, _OF_SIGMA, _TYPICAL = 0.01, 0.5, 0.2  # of ln C, of a number in σ, of an effect's typical size
_C, _N = len(COEFFICIENTS), len(NUMBERS)


class SwimScores:
    """Derivatives of a swim's track in all that is fitted anyway, white under the true covariance."""

    def __init__(self, swim: LabSwim):
        self.plan, self.camera, truth = swim.plan, swim.disturbed["camera"], swim.truth
        self.resolution = Resolution.fitting(truth.omega_bar)
        plain = swum(truth, self.plan, self.resolution)
        self.time = np.arange(0, FITTED * plain.flips[-1], self.camera.every)
        self.poses = plain.at(self.time)
        steps = np.diag([_STEP] * _C + [_OF_SIGMA] * _N)
        numbers = np.stack([self._track(moved(truth, x)) - self.poses for x in steps], -1) / np.diag(steps)
        free = self._white(np.concatenate([numbers[..., :_C], self._seen()], -1))
        self.free, self.root = np.linalg.qr(free)
        scale = self.poses * [1.0, 1.0, 0.0] * TABLE_DEFAULTS[CAMERA]
        flips = plain.flips[(plain.flips > 0) & (plain.flips < self.time[-1])]
        kicks = rigid(self.poses, plain.at(flips)) * (self.time[:, None] >= flips)[:, None, None]
        kicks = kicks * np.array(swim.disturbed["kick"])[[0, 0, 1], None]
        known = [numbers[..., _C:], scale[..., None], kicks.reshape(*scale.shape, -1)]
        white = self._white(np.concatenate(known, -1))
        self.both = self.free.T @ white
        self.known = white - self.free @ self.both
        self.factor = cho_factor(np.eye(white.shape[1]) + self.known.T @ self.known)

    def strength(self, robot: Robot) -> float:
        """Compute λ of what makes another robot differ: two steps of Gauss and Newton fit the rest."""
        x, length = np.zeros(_C + _N), 0.0
        for _ in range(2):
            white = self._white((self._track(moved(robot, x)) - self.poses)[..., None])[:, 0]
            absorbed = self.free.T @ white
            left, pull = white - self.free @ absorbed, np.zeros(self.known.shape[1])
            pull[:_N] = x[_C:]
            step = -cho_solve(self.factor, self.known.T @ left + pull)
            length = math.hypot(*(np.linalg.norm(each) for each in (left + self.known @ step, pull + step)))
            free = -solve_triangular(self.root, absorbed + self.both @ step)
            x = x + np.concatenate([free[:_C], step[:_N]])
        return length

    def _track(self, robot: Robot) -> Floats:
        return swum(robot, self.plan, self.resolution).at(self.time)

    def _seen(self) -> Floats:
        """Derivatives of the track in start, marker and current, (n, 3, 8)."""
        t, c, s = self.time, np.cos(self.poses[:, 2]), np.sin(self.poses[:, 2])
        none, one = np.zeros_like(t), np.ones_like(t)
        marker = [(c, s, none), (-s, c, none), (none, none, one)]
        drift = [np.stack(each, 1) for each in (*marker, (t, none, none), (none, t, none))]
        return np.concatenate([rigid(self.poses, self.poses[:1])[..., 0], np.stack(drift, -1)], -1)

    def _white(self, table: Floats) -> Floats:
        """Whiten changes (n, 3, m) with the covariance of the camera, (3 n, m)."""
        parts, of_one = [], np.zeros(len(table), dtype=int)
        for axes, white, slow in zip((slice(2), slice(2, 3)), self.camera.white, self.camera.slow, strict=True):
            noise = Memory(of_one, self.time, slow**2 / (white**2 + slow**2), self.camera.memory)
            parts.append(noise.whiten(table[:, axes]) / math.hypot(white, slow))
        return np.concatenate(parts, 1).reshape(-1, table.shape[-1])


def moved(robot: Robot, x: Floats) -> Robot:
    """Return a robot with other coefficients, by x in their logarithm, and numbers, in standard deviations."""
    numbers: dict[str, Any] = {n: getattr(robot, n) * math.exp(by) for n, by in zip(COEFFICIENTS, x, strict=False)}
    for name, by in zip(NUMBERS, x[_C:], strict=True):
        numbers[name] = robot.number(name) + by * robot.sigma(name).of(robot.number(name))
    return replace(robot, **numbers)


def rigid(poses: Floats, about: Floats) -> Floats:
    """Derivatives of poses (n, 3) in rigid motions about K others: along x, along y, turned, (n, 3, 3, K)."""
    motion = np.zeros((len(poses), 3, 3, len(about)))
    motion[:, [0, 1, 2], [0, 1, 2]] = 1.0
    motion[:, :2, 2] = np.moveaxis(planar.turn(poses[:, None, :2] - about[:, :2], math.pi / 2), 1, 2)
    return motion


def with_influence(robot: Robot, name: str, value: float) -> Robot:
    """Return a robot with an effect or another influence of one size."""
    influence, part = influences()[name], 1 - value / robot.tails
    if influence.effect is not None:
        return replace(robot, effects={influence.effect: value})
    if name == SLIP:
        return replace(robot, motor_speed=robot.motor_speed * (1 - value))
    numbers: dict[str, Any] = {n: getattr(robot, n) * part**power for n, power in influence.one_tail.items()}
    return replace(robot, **numbers)


def sized(truth: Robot, name: str, side: int, scores: SwimScores, strength: float) -> Robot | None:
    """Return a robot with an effect at λ = `strength` on one side of its null; None if that is not plausible."""
    effect = influences()[name].parameter
    low, high = effect.plausible or effect.bounds
    size = side * _TYPICAL * abs(effect.typical)
    for _ in range(5):
        if not low <= effect.start + size <= high:
            return None
        robot = with_influence(truth, name, effect.start + size)
        level = scores.strength(robot)
        if abs(level / strength - 1) < 0.08:
            return robot
        size *= min(strength / max(level, 1e-3), 10.0)
    return None
