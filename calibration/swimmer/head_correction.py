"""The best predictive model of a swimmer whose runs no effect explains: a correction of the head's load.

`sim.model.correction` says what is corrected: coefficients and two effects (knobs). Each has the same few terms
in N, l/R and the motor's rate. With J_i the derivatives of run i in the knobs, the residual is

    y_i − f_i ≈ J_i g(x_i),   g = W φ(x_i),

which is linear in the weights W. Terms are added one at a time, as long as left-out sessions are predicted better.
Weights have Gaussian priors (`_SIGMA`), so knobs that the runs do not show stay at rest. Then the weights are
corrected a few times with the simulator itself. Source: ridge regression, forward selection by cross-validation.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from calibration.statistics.forward_model import Predictive
from calibration.statistics.noise import inverse_root
from calibration.statistics.splits import groups
from sim.arrays import Flags, Floats, Integers
from sim.io.errors import InputError
from sim.model.correction import Correction, inputs_of, monomials

if TYPE_CHECKING:
    from calibration.statistics.fit import Fit
    from calibration.swimmer.swimmer import Swimmer

Powers = tuple[tuple[int, ...], ...]

_SIGMA = {"C_t": 0.5, "C_r": 0.5, "C_yr": 0.5, "surface_couple": 0.5, "anisotropic_head_drag": 0.3}
_CONSTANT = (0, 0, 0)
_MOST = 7  # terms
_GAIN = 0.02  # share of the left-out error that a term must save
_CORRECTIONS = 4  # of the weights, with the simulator
_SETTLED = 1e-3  # share of the remaining error


@dataclass(frozen=True)
class Corrected:
    """What is handed on to corrected.toml."""

    correction: Correction  # learnt from all runs
    covariance: Floats  # (q t, q t) of the weights, knob by knob
    slopes: Floats  # (n, k, q) of the runs' outputs in the knobs
    inputs: Floats  # (n, 3)
    beyond: float  # what is left on runs that were not learnt from, beyond noise; relative rms

    def knob_covariance(self, values: dict[str, float]) -> Floats:
        """Covariance (q, q) of the knobs at a robot given by its groups: of the weights, and of what is left."""
        x = np.array(inputs_of(values))
        knobs = tuple(self.correction.weights)
        phi = np.kron(np.eye(len(knobs)), self.correction.terms(x[None]))  # (q, q t)
        J = self.slopes[int(np.argmin((((self.inputs - x) / np.array(self.correction.scale)) ** 2).sum(1)))]
        prior = np.diag([_SIGMA[name] ** -2 for name in knobs])
        left = np.zeros_like(prior)
        if self.beyond > 0:
            left = np.linalg.inv(J.T @ J / self.beyond**2 + prior)
        return np.asarray(phi @ self.covariance @ phi.T + left)


@dataclass(frozen=True)
class _Task:
    """The calibrated model, and whitened residuals, derivatives and inputs of all runs."""

    model: Swimmer
    base: Fit
    knobs: tuple[str, ...]
    root: Floats  # (k, k) whitens outputs
    slopes: Floats  # (n, k, q) of the outputs in the knobs
    inputs: Floats  # (n, 3)
    centre: Floats  # (3,)
    scale: Floats
    group: Integers

    def white(self, prediction: Floats) -> Floats:
        """Residual (n, k) of a prediction."""
        return np.asarray((self.model.runs.y - prediction) @ self.root.T)

    def design(self, powers: Powers) -> Floats:
        """Derivatives of the whitened outputs in the weights, (n, k, q t)."""
        phi = monomials((self.inputs - self.centre) / self.scale, powers)
        A = np.einsum("ab,nbq,nt->naqt", self.root, self.slopes, phi, optimize=True)
        return np.asarray(A.reshape(*A.shape[:2], -1))

    def precision(self, count: int) -> Floats:
        """1/σ² of `count` weights."""
        sigma = np.array([_SIGMA[name] for name in self.knobs])
        return np.asarray(np.repeat(sigma**-2, count // len(sigma)))

    def step(self, A: Floats, residual: Floats, rows: Flags, weights: Floats) -> tuple[Floats, Floats]:
        """Change of the weights, and their covariance."""
        own, precision = A[rows].reshape(-1, A.shape[-1]), self.precision(A.shape[-1])
        covariance = np.linalg.inv(own.T @ own + np.diag(precision))
        change = covariance @ (own.T @ residual[rows].ravel() - precision * weights)
        return np.asarray(change), np.asarray(covariance)

    def left_out(self, powers: Powers, used: Flags) -> float:
        """Mean square left on groups of runs that the weights have not seen; without terms, of the residual."""
        residual = self.white(self.base.prediction)
        if not powers:
            return float((residual[used] ** 2).mean())
        A, left = self.design(powers), []
        for own in np.unique(self.group[used]):
            learn, out = used & (self.group != own), used & (self.group == own)
            w = self.step(A, residual, learn, np.zeros(A.shape[-1]))[0]
            left.append(residual[out] - A[out] @ w)
        return float((np.concatenate(left) ** 2).mean())

    def correction(self, powers: Powers, weights: Floats, rows: Flags) -> Correction:
        """The correction with these weights, whose range is that of the runs in `rows`; without errors."""
        table = weights.reshape(len(self.knobs), len(powers)).tolist()
        ends = (self.inputs[rows].min(0), self.inputs[rows].max(0))
        centre, scale, low, high = (tuple(v.tolist()) for v in (self.centre, self.scale, *ends))
        named = {k: tuple(row) for k, row in zip(self.knobs, table, strict=True)}
        return Correction(centre, scale, low, high, powers, named, 0.0, 0.0)

    def learnt(
        self, powers: Powers, weights: Floats, prediction: Floats, rows: Flags
    ) -> tuple[Floats, Floats, Floats]:
        """Weights after a few corrections with the simulator, the prediction with them, and their covariance.

        Args:
            weights, prediction: to begin with.
            rows: (n,) runs to learn from.
        """
        A, every = self.design(powers), np.ones(len(self.inputs), bool)
        covariance = self.step(A, self.white(prediction), rows, weights)[1]

        def cost(w: Floats, found: Floats) -> float:
            return float((self.white(found)[rows] ** 2).sum() + (self.precision(len(w)) * w**2).sum())

        best = cost(weights, prediction)
        for _ in range(_CORRECTIONS):
            change = self.step(A, self.white(prediction), rows, weights)[0]
            before = best
            for share in (1.0, 0.5, 0.25):
                tried = weights + share * change
                robot = replace(self.model.robot, correction=self.correction(powers, tried, every))
                try:
                    found = replace(self.model, robot=robot).predict([self.base.parameters])[0]
                except InputError:  # no motion with these weights
                    continue
                if cost(tried, found) < best:
                    weights, prediction, best = tried, found, cost(tried, found)
                    break
            if before - best < _SETTLED * before:
                break
        return weights, prediction, covariance


def predictive(model: Swimmer, base: Fit, used: Flags, rows: Flags, test: Flags) -> Predictive | None:
    """Learn a correction of `base`, if there is one that predicts left-out sessions better.

    Args:
        used: (n,) runs to learn from and to choose the terms.
        rows: (n,) runs from which the correction that is handed on is learnt in the end.
        test: (n,) runs on which its error is stated.
    """
    here = {p.name for p in (*model.coefficients, *model.effects)}
    knobs = tuple(name for name in _SIGMA if name in here)
    robots, place = model.robots(base.parameters)
    inputs = np.array([inputs_of(robot.group_values()) for robot in robots])[place]
    spread = inputs[used].std(0)
    task = _Task(
        model=model,
        base=base,
        knobs=knobs,
        root=inverse_root(base.noise.run),
        slopes=model.derivatives(base.parameters, knobs)[1],
        inputs=inputs,
        centre=inputs[used].mean(0),
        scale=np.where(spread > 1e-6, spread, 1.0),
        group=groups(model.runs)[0],
    )
    powers = _chosen(task, used)
    if not powers:
        return None
    none = np.zeros(len(knobs) * len(powers))
    weights, prediction, _ = task.learnt(powers, none, base.prediction, used)
    last, fitted, covariance = task.learnt(powers, weights, prediction, rows)
    error, without = (
        float(np.sqrt(((model.runs.y - found)[test] ** 2).mean())) for found in (prediction, base.prediction)
    )
    noise = float(np.trace(base.noise.run) / len(base.noise.run))
    content = Corrected(
        correction=replace(task.correction(powers, last, rows), error=error, error_without=without),
        covariance=covariance * max(1.0, float((task.white(fitted)[rows] ** 2).mean())),
        slopes=task.slopes,
        inputs=inputs,
        beyond=math.sqrt(max(error**2 - noise, 0.0)),
    )
    return Predictive(prediction, tuple(_words(term) for term in powers), content)


def _chosen(task: _Task, used: Flags) -> Powers:
    """Powers of the terms, in the order in which they were added; none if they do not predict better."""
    levels = [len(np.unique(column[used].round(6))) for column in task.inputs.T]
    possible = [
        p for p in itertools.product(range(4), repeat=3)
        if (sum(p) <= 2 or max(p) == sum(p)) and all(q < m for q, m in zip(p, levels, strict=True))
    ]  # fmt: skip
    chosen: Powers = ()
    error = task.left_out(chosen, used)
    while len(chosen) < _MOST:
        rest = [tuple(dict.fromkeys((_CONSTANT, *chosen, p))) for p in possible if p not in chosen]
        if not rest:
            break
        tried = [task.left_out(powers, used) for powers in rest]
        best = int(np.argmin(tried))
        if tried[best] > (1 - _GAIN) * error:
            break
        chosen, error = rest[best], tried[best]
    return chosen


def _words(term: tuple[int, ...]) -> str:
    """A term in words."""
    symbols = ("N", "ln l/R", "ln ω")
    parts = [s if p == 1 else f"({s})^{p}" for s, p in zip(symbols, term, strict=True) if p]
    return " × ".join(parts) or "constant"
