"""The noise of the poses of a swim: a camera's, with a memory, and steps by which the robot itself is moved.

A pose is that of the model, and beside it

    white noise       of each reading, w² of places, w² of headings,
    slow noise        Ornstein-Uhlenbeck, s² exp(−|Δt|/τ): lights, waves, a marker that is seen askew,
    random steps      q² at each flip of the motor, of place and heading: what disturbs a robot adds up. A step of
                      the heading carries all of the path that follows, as a lever.

This is a linear state space of six numbers, the deviation of the pose and the slow noise. So the innovations of a
Kalman filter, each over its standard deviation, are white: L⁻¹ y with the Cholesky factor L of the covariance of
all poses, in linear time. With q = 0 poses are compared as they are, with large q their changes from flip to flip
are. Each part of a swim starts from a pose that is fitted.

The variances have the largest restricted likelihood of what the richest model leaves, with all of its columns
projected out (Patterson and Thompson 1971); steps are at their mean. What the model cannot describe is noise then,
mostly of the steps.
Source of the filter: e.g. Anderson and Moore (1979), chapter 5.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from common.arrays import Flags, Floats, Integers
from sim.jit import compiled

_LEAST, _MOST = 1e-4, 1e3  # of standard deviations, over the scatter of neighbouring poses
_RIDGE = 1e-9  # of the products of columns, each of length 1
_WIDE, _SIZES = 3.0, 25  # of the logarithm of a step on either side, and values there
_STARTS = ((1.0, 1.0, 0.1), (1.0, 0.1, 1.0))  # white, slow, steps, over the scatter of neighbouring poses


class Sizes(NamedTuple):
    """Standard deviations of places and of headings, each (2,), and τ [s]."""

    white: Floats
    slow: Floats
    step: Floats
    tau: float


@dataclass(frozen=True)
class PoseNoise:
    """The covariance of n poses, as a filter."""

    part: Integers  # (n,) of swims, sorted; each starts from a pose of its own
    time: Floats  # (n,) [s]
    flips: Integers  # (n,) of the motor since the pose before
    moved: Floats  # (n, 2) place since the pose before, in the lab
    sizes: Sizes

    def whiten(self, table: Floats) -> Floats:
        """Compute L⁻¹ of a table (n, 3, …)."""
        return self._run(table, colour=False)

    def colour(self, table: Floats) -> Floats:
        """Compute L of a table (n, 3, …)."""
        return self._run(table, colour=True)

    def of(self, rows: Flags) -> PoseNoise:
        """Take some poses (n,): all up to some time of each part."""
        changes = {name: getattr(self, name)[rows] for name in ("part", "time", "flips", "moved")}
        return replace(self, **changes)

    @property
    def log_determinant(self) -> float:
        """Compute ln |L|."""
        return float(np.log(np.diagonal(self._filter[1], axis1=1, axis2=2)).sum())

    @cached_property
    def _decay(self) -> Floats:
        """The share of the slow noise that is left from the pose before, (n,); below 0 where a part begins."""
        same = np.append(False, np.diff(self.part) == 0)
        since = np.where(same, np.diff(self.time, prepend=self.time[0]), 0.0)  # clocks of swims may go back
        return np.where(same, np.exp(-since / self.sizes.tau), -1.0)

    @cached_property
    def _filter(self) -> tuple[Floats, Floats]:
        """Gains (n, 6, 3), and Cholesky factors (n, 3, 3) of the covariance of the innovations."""
        white, slow, step = (np.array([s[0], s[0], s[1]]) ** 2 for s in self.sizes[:3])
        return _gains(self._decay, self.flips.astype(float), self.moved, white, slow, step)

    def _run(self, table: Floats, *, colour: bool) -> Floats:
        flat = np.ascontiguousarray(table, dtype=float).reshape(len(table), 3, -1)
        return np.asarray(_filtered(flat, *self._filter, self._decay, self.moved, colour)).reshape(table.shape)


@compiled
def _gains(
    decay: Floats, flips: Floats, moved: Floats, white: Floats, slow: Floats, step: Floats
) -> tuple[Floats, Floats]:
    """Run the covariance of the state along the poses, see `PoseNoise._filter`."""
    n = len(decay)
    gains, roots, P = np.zeros((n, 6, 3)), np.zeros((n, 3, 3)), np.zeros((6, 6))
    for i in range(n):
        if decay[i] < 0:
            P[:] = 0.0
            for a in range(3):
                P[3 + a, 3 + a] = slow[a]
        else:
            _advance(P, decay[i], flips[i], moved[i], slow, step)
        _update(P, white, gains[i], roots[i])
    return gains, roots


@compiled
def _advance(P: Floats, decay: float, flips: float, moved: Floats, slow: Floats, step: Floats) -> None:
    """Take the covariance of the state to the next pose."""
    for a in range(3):
        P[a, a] += flips * step[a]
    for b in range(6):  # a turned robot goes on in another direction
        P[0, b] -= moved[1] * P[2, b]
        P[1, b] += moved[0] * P[2, b]
    for a in range(6):
        P[a, 0] -= moved[1] * P[a, 2]
        P[a, 1] += moved[0] * P[a, 2]
        for b in range(3):
            P[a, 3 + b] *= decay
    for a in range(3):
        for b in range(6):
            P[3 + a, b] *= decay
        P[3 + a, 3 + a] += (1 - decay**2) * slow[a]


@compiled
def _update(P: Floats, white: Floats, gain: Floats, root: Floats) -> None:
    """Learn from a pose: the covariance of the state, the gain and the root of the innovation's covariance."""
    ahead = np.zeros((6, 3))  # of the state and the pose
    for a in range(6):
        for b in range(3):
            ahead[a, b] = P[a, b] + P[a, 3 + b]
    for a in range(3):  # Cholesky factor of what is expected of the pose
        for b in range(a + 1):
            total = ahead[a, b] + ahead[3 + a, b] + (white[a] if a == b else 0.0)
            for c in range(b):
                total -= root[a, c] * root[b, c]
            root[a, b] = math.sqrt(max(total, 1e-300)) if a == b else total / root[b, b]
    for a in range(6):
        for b in range(3):
            for c in range(b):
                ahead[a, b] -= ahead[a, c] * root[b, c]
            ahead[a, b] /= root[b, b]
    for a in range(6):
        for b in range(6):
            for c in range(3):
                P[a, b] -= ahead[a, c] * ahead[b, c]
    for a in range(6):
        for b in range(2, -1, -1):
            gain[a, b] = ahead[a, b]
            for c in range(b + 1, 3):
                gain[a, b] -= gain[a, c] * root[c, b]
            gain[a, b] /= root[b, b]


@compiled
def _filtered(table: Floats, gains: Floats, roots: Floats, decay: Floats, moved: Floats, colour: bool) -> Floats:
    """Turn poses (n, 3, m) into innovations over their standard deviations, or back."""
    n, _, m = table.shape
    result, state, new = np.empty((n, 3, m)), np.zeros((6, m)), np.zeros((3, m))
    for i in range(n):
        if decay[i] < 0:
            state[:] = 0.0
        else:
            _predict(state, decay[i], moved[i])
        if colour:
            _coloured(table[i], roots[i], state, new, result[i])
        else:
            _whitened(table[i], roots[i], state, new, result[i])
        for a in range(6):
            for c in range(3):
                for j in range(m):
                    state[a, j] += gains[i, a, c] * new[c, j]
    return result


@compiled
def _predict(state: Floats, decay: float, moved: Floats) -> None:
    """Take the state to the next pose."""
    for j in range(state.shape[1]):
        state[0, j] -= moved[1] * state[2, j]
        state[1, j] += moved[0] * state[2, j]
        for a in range(3, 6):
            state[a, j] *= decay


@compiled
def _whitened(pose: Floats, root: Floats, state: Floats, new: Floats, result: Floats) -> None:
    """Compute innovations (3, m), and solve for white numbers."""
    for a in range(3):
        for j in range(pose.shape[1]):
            new[a, j] = pose[a, j] - state[a, j] - state[3 + a, j]
            result[a, j] = new[a, j]
            for c in range(a):
                result[a, j] -= root[a, c] * result[c, j]
            result[a, j] /= root[a, a]


@compiled
def _coloured(white: Floats, root: Floats, state: Floats, new: Floats, result: Floats) -> None:
    """Compute innovations (3, m) of white numbers, and the pose."""
    for a in range(3):
        for j in range(white.shape[1]):
            new[a, j] = 0.0
            for c in range(a + 1):
                new[a, j] += root[a, c] * white[c, j]
            result[a, j] = new[a, j] + state[a, j] + state[3 + a, j]


def estimate_noise(rough: PoseNoise, residual: Floats, columns: Floats) -> PoseNoise:
    """Estimate the sizes of the noise from what a model leaves.

    Args:
        rough: its parts, times and flips; its τ is where the search begins.
        residual: (n, 3).
        columns: (n, 3, m) by which the residual may change to any amount.
    """
    lengths = np.sqrt((columns**2).sum((0, 1)))
    table = np.concatenate([columns[..., lengths > 0] / lengths[lengths > 0], residual[..., None]], -1)
    neighbours = np.diff(residual, axis=0)[np.diff(rough.part) == 0]
    scatter = np.array([np.sqrt(np.mean(neighbours[:, :2] ** 2) / 2), np.sqrt(np.mean(neighbours[:, 2] ** 2) / 2)])
    step = float(np.median(np.diff(rough.time)[np.diff(rough.part) == 0]))
    longest = float(np.ptp(rough.time)) / 3

    def noise(at: Floats) -> PoseNoise:
        white, slow, steps = (scatter * np.exp(at[i : i + 2]) for i in (0, 2, 4))
        return replace(rough, sizes=Sizes(white, slow, steps, math.exp(at[6])))

    def cost(at: Floats) -> float:
        tried = noise(at)
        white = tried.whiten(table).reshape(-1, table.shape[-1])
        products = white.T @ white
        size = np.sqrt(np.diag(products)[:-1])
        inner = products[:-1, :-1] / np.outer(size, size) + _RIDGE * np.eye(len(size))
        across = products[:-1, -1] / size
        left = products[-1, -1] - across @ np.linalg.solve(inner, across)
        determinant = np.linalg.slogdet(inner)[1] + 2 * np.log(size).sum()
        return float(tried.log_determinant + (left + determinant) / 2)

    ends = [(math.log(_LEAST), math.log(_MOST))] * 6 + [(math.log(step), math.log(max(longest, 2 * step)))]
    searches = [
        minimize(
            cost,
            np.append(np.repeat(np.log(start), 2), math.log(min(10 * step, longest))),
            method="L-BFGS-B",
            bounds=ends,
            options={"maxiter": 40, "ftol": 1e-9, "eps": 1e-3},
        )
        for start in _STARTS
    ]
    return noise(_mean_steps(cost, min(searches, key=lambda search: search.fun).x))


def _mean_steps(cost: Callable[[Floats], float], best: Floats) -> Floats:
    """Replace the likeliest size of each step by its mean, with all sizes as likely before (Gelman 2006).

    A few dwells hardly tell small steps from none, and steps that are too small make a path look too certain.
    """
    changed, around = best.copy(), np.linspace(-_WIDE, _WIDE, _SIZES)
    for place in (4, 5):
        tried = np.tile(best, (_SIZES, 1))
        tried[:, place] += around
        costs = np.array([cost(at) for at in tried])
        weights = np.exp(costs.min() - costs + around)
        changed[place] += math.log((weights * np.exp(2 * around)).sum() / weights.sum()) / 2
    return changed
