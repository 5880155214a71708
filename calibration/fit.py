"""Generalised least squares of the forward model: coefficients on a log scale, effects on their own.

Gauss-Newton with a Jacobian by finite differences in the simulator (all perturbed models in one batch):

    θ ← θ + (JᵀΣ⁻¹J)⁻¹ JᵀΣ⁻¹ (y − f(θ)),   θ = (ln C_t, ln C_r, ln C_yr, ε_1, …).

Effect sizes stay within their bounds; one that ends on a bound is said to. The covariance of the parameters is
(JᵀΣ⁻¹J)⁻¹; intervals are 95 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.forward import COEFFICIENTS, Parameters, Swimmer
from calibration.noise import Noise, repeat_covariance, session_variance
from sim.effects import catalogue

Floats = NDArray[np.float64]

_STEP = 0.05  # finite difference in ln C
_EFFECT_STEP = 0.1  # finite difference in units of an effect's typical size
_MOST_STEPS = 8
_SMALL = 0.1  # in standard deviations: a step below this ends the iteration
_LARGEST = 0.7  # change of ln C in one step
Z95 = 1.96


@dataclass(frozen=True)
class Fit:
    """A fitted model; arrays over all runs of the table, used or not."""

    parameters: dict[str, float]
    names: tuple[str, ...]  # fitted, in the order of the covariance
    covariance: Floats  # (p, p) of (ln C, ε)
    prediction: Floats  # (n, k)
    jacobian: Floats  # (n, k, p)
    noise: Noise
    chi_square: float  # rᵀ Σ⁻¹ r over the fitted runs
    steps: int

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of a parameter."""
        value = self.parameters[name]
        half = Z95 * math.sqrt(self.covariance[self.names.index(name), self.names.index(name)])
        if name in COEFFICIENTS:
            return value * math.exp(-half), value * math.exp(half)
        return value - half, value + half


def jacobian(
    model: Swimmer, parameters: Parameters, names: tuple[str, ...], *, title: str = ""
) -> tuple[Floats, Floats]:
    """Prediction (n, k) and its derivative (n, k, p) in ln C and ε at `parameters`."""
    sets, widths = [dict(parameters)], []
    for name in names:
        value = parameters[name]
        if name in COEFFICIENTS:
            width, moved = _STEP, value * math.exp(_STEP)
        else:
            effect = catalogue()[name]
            width = _EFFECT_STEP * effect.typical
            width = width if value + width <= effect.bounds[1] else -width
            moved = value + width
        sets.append({**parameters, name: moved})
        widths.append(width)
    found = model.predict(sets, title=title)
    return found[0], np.moveaxis((found[1:] - found[0]) / np.array(widths)[:, None, None], 0, -1)


def fit(
    model: Swimmer,
    start: Parameters,
    names: tuple[str, ...],
    used: NDArray[np.bool_],
    *,
    title: str = "fit",
) -> Fit:
    """Fit `names` to the runs in `used` (n,), starting at `start`; other parameters stay."""
    data = model.data
    run = repeat_covariance(data.y[used], data.condition[used])
    parameters = dict(start)
    for count in range(1, _MOST_STEPS + 1):
        prediction, derivative = jacobian(model, parameters, names, title=f"{title}, step {count}")
        residual = data.y - prediction
        # Linear fit; near the end with the session variance that its own residuals imply. Far from the
        # solution every session looks shifted, and a large τ² would hide what pulls towards it.
        noise = Noise(run, np.zeros(len(run)))
        for _ in range(1 if count == 1 else 3):
            white = noise.whitener(data.session[used])
            J, r = white(derivative[used]), white(residual[used])
            covariance: Floats = np.asarray(np.linalg.pinv(J.T @ J), dtype=np.float64)
            step = covariance @ (J.T @ r)
            left = residual[used] - derivative[used] @ step
            noise = Noise(run, session_variance(left, data.session[used], run))
        size = float(np.max(np.abs(step) / np.sqrt(np.diag(covariance))))
        moved = _move(parameters, names, step)
        if (size < _SMALL and count > 1) or count == _MOST_STEPS:
            break
        parameters = moved
    r = noise.whitener(data.session[used])(residual[used])
    return Fit(parameters, names, covariance, prediction, derivative, noise, float(r @ r), count)


def _move(parameters: dict[str, float], names: tuple[str, ...], step: Floats) -> dict[str, float]:
    moved = dict(parameters)
    for name, change in zip(names, step.tolist(), strict=True):
        if name in COEFFICIENTS:
            moved[name] *= math.exp(max(-_LARGEST, min(_LARGEST, change)))
        else:
            low, high = catalogue()[name].bounds
            moved[name] = max(low, min(high, moved[name] + change))
    return moved
