"""Generalised least squares of a forward model, each parameter on its own scale.

Gauss-Newton with a Jacobian by finite differences in the model (all perturbed models in one batch):

    θ ← θ + (JᵀΣ⁻¹J)⁻¹ JᵀΣ⁻¹ (y − f(θ)),   θ = (ln C_1, …, ε_1, …).

Parameters stay within their bounds. The covariance of the parameters is (JᵀΣ⁻¹J)⁻¹; intervals are 95 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.model import Floats, Model, Parameter, Parameters, moved, parameter
from calibration.noise import Noise, repeat_covariance, session_variance

_LOG_STEP, _STEP = 0.05, 0.1  # finite difference: in ln C, in units of a typical size
_MOST_STEPS = 8
_SHORT = 0.1  # a step below this in ln C (or in ε) keeps the Jacobian
_SMALL = 0.1  # in standard deviations: a step below this ends the iteration
_LARGEST = 0.7  # change of ln C in one step
Z95 = 1.96


@dataclass(frozen=True)
class Fit:
    """A fitted model; arrays over all runs of the table, used or not."""

    parameters: dict[str, float]
    fitted: tuple[Parameter, ...]  # in the order of the covariance
    covariance: Floats  # (p, p) of (ln C, ε)
    prediction: Floats  # (n, k)
    jacobian: Floats  # (n, k, p)
    noise: Noise
    chi_square: float  # rᵀ Σ⁻¹ r over the fitted runs
    steps: int

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(p.name for p in self.fitted)

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of a parameter."""
        value = self.parameters[name]
        place = self.names.index(name)
        half = Z95 * math.sqrt(self.covariance[place, place])
        if self.fitted[place].logarithmic:
            return value * math.exp(-half), value * math.exp(half)
        return value - half, value + half


def jacobian(
    model: Model, parameters: Parameters, names: tuple[str, ...], *, title: str = ""
) -> tuple[Floats, Floats]:
    """Prediction (n, k) and its derivative (n, k, p) on the parameters' own scales at `parameters`."""
    sets, widths = [dict(parameters)], []
    for name in names:
        one = parameter(model, name)
        width = _LOG_STEP if one.logarithmic else _STEP * abs(one.typical)
        if moved(one, parameters[name], 2 * width) == one.bounds[1]:  # downwards where the bound is near
            width = -width
        sets.append({**parameters, name: moved(one, parameters[name], width)})
        widths.append(width)
    found = model.predict(sets, title=title)
    return found[0], np.moveaxis((found[1:] - found[0]) / np.array(widths)[:, None, None], 0, -1)


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
    parameters = dict(start)
    derivative = np.empty(0)
    fresh = True  # the Jacobian must be computed
    for count in range(1, _MOST_STEPS + 1):
        label = f"{title}, step {count}" if title else ""
        if fresh:
            prediction, derivative = jacobian(model, parameters, names, title=label)
        else:
            prediction = model.predict([parameters], title=label)[0]
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
        new = _move(model, parameters, names, step)
        stuck = all(abs(new[name] / parameters[name] - 1) < 1e-3 for name in names if parameters[name])
        if ((size < _SMALL or stuck) and count > 1) or count == _MOST_STEPS:
            break
        parameters = new
        fresh = bool(np.abs(step).max() > _SHORT) and count + 1 < _MOST_STEPS
    r = noise.whitener(data.session[used])(residual[used])
    fitted = tuple(parameter(model, name) for name in names)
    return Fit(parameters, fitted, covariance, prediction, derivative, noise, float(r @ r), count)


def _move(model: Model, parameters: dict[str, float], names: tuple[str, ...], step: Floats) -> dict[str, float]:
    new = dict(parameters)
    for name, change in zip(names, step.tolist(), strict=True):
        one = parameter(model, name)
        if one.logarithmic:
            change = max(-_LARGEST, min(_LARGEST, change))
        new[name] = moved(one, new[name], change)
    return new
