"""Generalised least squares of a forward model, each parameter on its own scale.

Gauss-Newton with the model's own derivatives:

    θ ← θ + (JᵀΣ⁻¹J)⁻¹ JᵀΣ⁻¹ (y − f(θ)),   θ = (ln C_1, …, ε_1, …).

Parameters stay within their bounds. The covariance of the parameters is V = (JᵀΣ⁻¹J)⁻¹, more for an
estimated S (`_inflation`); intervals are 95 %, by
Student's t with the degrees of freedom that the scatter ρ of a few sessions leaves (Satterthwaite 1946),

    ν = 2 V² / (V′² Var ρ),   Var ρ ≈ 2 (ρ + 1/n)² / (k (s − 1)),   n runs in each of s sessions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from calibration.model import Floats, Model, Parameter, Parameters, moved, parameter
from calibration.noise import Noise, Sums, inverse_root, least_squares, repeat_covariance, sums

_MOST_STEPS = 8
_SHORT = 0.1  # a step below this in ln C (or in ε) keeps the Jacobian
_SMALL = 0.1  # in standard deviations: a step below this ends the iteration
_LARGEST = 0.7  # change of ln C in one step
_PASSES = 3  # of the scatter of the sessions


@dataclass(frozen=True)
class Fit:
    """A fitted model; arrays over all runs of the table, used or not."""

    parameters: dict[str, float]
    fitted: tuple[Parameter, ...]  # in the order of the covariance
    covariance: Floats  # (p, p) of (ln C, ε)
    inflation: float  # in the covariance, for S being estimated
    freedom: Floats  # (p,) degrees of freedom of the intervals
    prediction: Floats  # (n, k)
    jacobian: Floats  # (n, k, p)
    noise: Noise
    deviance: float  # rᵀ Σ⁻¹ r + ln |Σ|/|S ⊗ I| over the fitted runs
    steps: int

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(p.name for p in self.fitted)

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of a parameter."""
        value = self.parameters[name]
        place = self.names.index(name)
        half = float(student.ppf(0.975, self.freedom[place])) * math.sqrt(self.covariance[place, place])
        if self.fitted[place].logarithmic:
            return value * math.exp(-half), value * math.exp(half)
        return value - half, value + half


def fit(
    model: Model,
    start: Parameters,
    names: tuple[str, ...],
    used: NDArray[np.bool_],
    *,
    title: str = "fit",
) -> Fit:
    """Fit `names` to the runs in `used` (n,), starting at `start`; other parameters stay.

    The Jacobian is computed anew after a long step and kept after a short one.
    """
    data = model.runs
    run = repeat_covariance(data.y[used], data.condition[used])
    root = inverse_root(run)
    parameters = dict(start)
    derivative = np.empty(0)
    fresh = True  # the Jacobian must be computed
    for count in range(1, _MOST_STEPS + 1):
        label = f"{title}, step {count}" if title else ""
        if fresh:
            prediction, derivative = model.derivatives(parameters, names, title=label)
        else:
            prediction = model.predict([parameters], title=label)[0]
        residual = data.y - prediction
        # Near the end with the scatter of sessions that the fit's own residuals imply. Far from the solution
        # every session looks shifted, and a large ρ would hide what pulls towards it.
        table = np.concatenate([derivative, residual[..., None]], -1)[used]
        products = sums(root @ table, data.session[used], len(run))
        linear = least_squares(products, passes=0 if count == 1 else _PASSES)
        covariance, step = linear.covariance, linear.step
        size = float(np.max(np.abs(step) / np.sqrt(np.diag(covariance))))
        new = _move(model, parameters, names, step)
        stuck = all(abs(new[name] / parameters[name] - 1) < 1e-3 for name in names if parameters[name])
        if ((size < _SMALL or stuck) and count > 1) or count == _MOST_STEPS:
            break
        parameters = new
        fresh = bool(np.abs(step).max() > _SHORT) and count + 1 < _MOST_STEPS
    noise = Noise(run, float(linear.share))
    spread = len(run) * np.log1p(linear.share * products.sizes).sum()
    deviance = float(products.at(linear.share)[-1, -1] + spread)
    fitted = tuple(parameter(model, name) for name in names)
    freedom = _freedom(products, float(linear.share), len(names))
    inflation = _inflation(data.condition[used], len(run))
    return Fit(
        parameters,
        fitted,
        inflation * covariance,
        inflation,
        freedom,
        prediction,
        derivative,
        noise,
        deviance,
        count,
    )


def _inflation(condition: NDArray[np.int64], outputs: int) -> float:
    """By how much the variance grows because S is known from ν repeats of k outputs only.

    ν/(ν − k − 1), since 1/S is overestimated, times 1 + (k − 1)/(ν − k), since its weights are not the best ones.
    """
    repeats = len(condition) - len(np.unique(condition))
    if repeats <= outputs + 1:
        return 2.0 * repeats
    return repeats / (repeats - outputs - 1) * (1 + (outputs - 1) / (repeats - outputs))


def _freedom(products: Sums, share: float, count: int) -> Floats:
    """Degrees of freedom of the parameters' variances, (p,)."""
    step = 0.01 * share + 1e-3 / products.sizes.mean()
    inverse = [
        np.linalg.pinv(products.at(np.array(s))[:count, :count], hermitian=True) for s in (share, share + step)
    ]
    V, moved = (np.maximum(np.diag(i), 1e-300) for i in inverse)
    sessions = len(products.sizes)
    spread = 2 * (share + 1 / products.sizes.mean()) ** 2 / (products.outputs * max(sessions - 1, 1))
    return np.asarray(np.clip(2 * V**2 / np.maximum(((moved - V) / step) ** 2 * spread, 1e-12 * V**2), 1.0, 1e6))


def _move(model: Model, parameters: dict[str, float], names: tuple[str, ...], step: Floats) -> dict[str, float]:
    new = dict(parameters)
    for name, change in zip(names, step.tolist(), strict=True):
        one = parameter(model, name)
        if one.logarithmic:
            change = max(-_LARGEST, min(_LARGEST, change))
        new[name] = moved(one, new[name], change)
    return new
