"""How large the load of a law is at each value of an input, by the runs at that value.

With c = ∂f/∂ ln(load), the derivative along the logarithm of a law's load, and the residual r of the fit with the
law, the runs g at one value of an input ask for a load that differs by the factor exp(δ_g),

    δ_g = Σ_g cᵀ S⁻¹ r/Σ_g cᵀ S⁻¹ c,

with the standard error (Σ_g cᵀ S⁻¹ c)^(−1/2). The other parameters stay as they were fitted.
Source: partial residuals (Larsen and McCleary 1972).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.laws.law_fits import Law
from calibration.laws.law_model import EXPONENTS, SIZE, logarithms
from calibration.laws.readings import INPUTS
from calibration.statistics.statistical_model import inverse_root
from sim.arrays import Flags, Floats

_LARGEST = 20.0  # logarithm of a factor
_MOST_VALUES = 12  # of an input; with more, neighbouring runs are put together


@dataclass(frozen=True)
class Dependence:
    """The load of a law along one input, over that at the mean of the runs, the other inputs at their means."""

    symbol: str  # of INPUTS
    inputs: Floats  # (m,) along the curve: rad/s, m, or a number of tails
    factor: Floats  # (m,) of the law
    low: Floats  # (m,) 95 % band of the law
    high: Floats
    groups: Floats  # (g,) inputs at which there are runs
    by_runs: Floats  # (g,) the factor that these runs ask for
    errors: Floats  # (g,) one standard error of its logarithm


def dependences(law: Law, used: Flags) -> list[Dependence]:
    """Compute how a law depends on each input that differs between the runs in `used` (n,)."""
    fitted, model = law.fit, law.model
    x = logarithms(model.runs) - np.array(model.centre)
    along = _along_load(law)
    white = inverse_root(fitted.noise.run)
    scale = model.runs.scale[used, None]
    columns = scale * (along @ white.T)[used]
    residual = scale * ((model.runs.y - fitted.prediction) @ white.T)[used]
    results = []
    for place, (name, symbol) in enumerate(zip(EXPONENTS, INPUTS, strict=True)):
        if name not in fitted.names:
            continue
        power, at = fitted.parameters[name], fitted.names.index(name)
        curve = np.linspace(x[used, place].min(), x[used, place].max(), 60)
        half = fitted.half_width(at) * np.abs(curve)
        members = _grouped(x[used, place])
        weights = np.maximum([(columns[rows] ** 2).sum() for rows in members], np.finfo(float).tiny)
        shifts = np.array([(columns[rows] * residual[rows]).sum() for rows in members]) / weights
        middle = np.array([x[used, place][rows].mean() for rows in members])
        results.append(
            Dependence(
                symbol,
                np.exp(curve + model.centre[place]),
                _factor(power * curve),
                _factor(power * curve - half),
                _factor(power * curve + half),
                np.exp(middle + model.centre[place]),
                _factor(power * middle + shifts),
                np.minimum(weights**-0.5, _LARGEST),
            )
        )
    return results


def _factor(logarithm: Floats) -> Floats:
    """Compute e to a power that is limited: what the runs do not determine may be of any size."""
    return np.asarray(np.exp(np.clip(logarithm, -_LARGEST, _LARGEST)))


def _along_load(law: Law) -> Floats:
    """Compute ∂f/∂ ln(load) of every run, (n, k)."""
    fitted = law.fit
    if law.place.is_term:
        return fitted.jacobian[..., fitted.names.index(SIZE)] * fitted.parameters[SIZE]
    columns = [power * fitted.jacobian[..., fitted.names.index(name)] for name, power in law.place.moves]
    return np.asarray(sum(columns))


def _grouped(values: Floats) -> list[Flags]:
    """Put runs of equal value together, or of neighbouring values where there are many; (n,) each."""
    distinct, which = np.unique(values.round(6), return_inverse=True)
    if len(distinct) > _MOST_VALUES:
        edges = np.quantile(values, np.linspace(0, 1, _MOST_VALUES + 1)[1:-1])
        which = np.searchsorted(edges, values)
    return [which == group for group in np.unique(which)]
