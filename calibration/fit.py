"""Generalised least squares of the forward model: coefficients on a log scale, effects on their own.

Gauss-Newton with a Jacobian by finite differences in the simulator (all perturbed models in one batch):

    θ ← θ + (JᵀΣ⁻¹J)⁻¹ JᵀΣ⁻¹ (y − f(θ)),   θ = (ln C_t, ln C_r, ln C_yr, ε_1, …).

Effect sizes stay within their bounds, coefficients within `SANE`. The covariance of the parameters is
(JᵀΣ⁻¹J)⁻¹; intervals are 95 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.forward import COEFFICIENTS, Parameters, Swimmer
from calibration.noise import Noise, repeat_covariance, session_variance
from sim.effects import catalogue
from sim.errors import InputError
from surrogate.export import load

Floats = NDArray[np.float64]

_STEP = 0.05  # finite difference in ln C
_EFFECT_STEP = 0.1  # finite difference in units of an effect's typical size
_MOST_STEPS = 8
_MOST_GUESSES = 12
_FEWEST_COVERED = 24  # runs
_SHORT = 0.1  # a step below this in ln C (or in ε) keeps the Jacobian
_SMALL = 0.1  # in standard deviations: a step below this ends the iteration
SANE = (0.1, 20.0)  # coefficients stay within: beyond, they say that the model lacks something
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
            width = _EFFECT_STEP * abs(effect.typical)
            width = width if value + width <= effect.bounds[1] else -width
            moved = value + width
        sets.append({**parameters, name: moved})
        widths.append(width)
    found = model.predict(sets, title=title)
    return found[0], np.moveaxis((found[1:] - found[0]) / np.array(widths)[:, None, None], 0, -1)


def first_guess(model: Swimmer, start: Parameters, used: NDArray[np.bool_]) -> dict[str, float]:
    """Coefficients fitted with the look-up table to the runs that it covers; `start` if those are too few."""
    lookup = load()
    covered = used & model.inside(lookup, start)
    parameters = dict(start)
    if covered.sum() < _FEWEST_COVERED:
        return parameters
    data = model.data.subset(covered)
    part = replace(model, data=data)
    noise = Noise(repeat_covariance(data.y, data.condition), np.zeros(data.y.shape[1]))
    whiten = noise.whitener(data.session)
    for _ in range(_MOST_GUESSES):
        moved = [{**parameters, name: parameters[name] * math.exp(_STEP)} for name in COEFFICIENTS]
        try:
            found = part.predict([parameters, *moved], lookup=lookup)
        except InputError:  # a coefficient left the table's domain on the way
            return dict(start)
        J = whiten(np.moveaxis(found[1:] - found[0], 0, -1) / _STEP)
        step: Floats = np.asarray(np.linalg.lstsq(J, whiten(data.y - found[0]), rcond=None)[0])
        parameters = _move(parameters, COEFFICIENTS, step)
        if np.abs(step).max() < 1e-3:
            break
    return parameters


def fit(
    model: Swimmer,
    start: Parameters,
    names: tuple[str, ...],
    used: NDArray[np.bool_],
    *,
    title: str = "fit",
) -> Fit:
    """Fit `names` to the runs in `used` (n,), starting at `start`; other parameters stay.

    The Jacobian is computed anew after a long step and kept after a short one.
    """
    data = model.data
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
        moved = _move(parameters, names, step)
        stuck = all(abs(moved[name] / parameters[name] - 1) < 1e-3 for name in names if parameters[name])
        if ((size < _SMALL or stuck) and count > 1) or count == _MOST_STEPS:
            break
        parameters = moved
        fresh = bool(np.abs(step).max() > _SHORT) and count + 1 < _MOST_STEPS
    r = noise.whitener(data.session[used])(residual[used])
    return Fit(parameters, names, covariance, prediction, derivative, noise, float(r @ r), count)


def _move(parameters: dict[str, float], names: tuple[str, ...], step: Floats) -> dict[str, float]:
    moved = dict(parameters)
    for name, change in zip(names, step.tolist(), strict=True):
        if name in COEFFICIENTS:
            value = moved[name] * math.exp(max(-_LARGEST, min(_LARGEST, change)))
            moved[name] = max(SANE[0], min(SANE[1], value))
        else:
            low, high = catalogue()[name].bounds
            moved[name] = max(low, min(high, moved[name] + change))
    return moved
