"""How large the load of a law is at each value of an input, by the runs at that value.

With c = ∂f/∂ ln(load), the derivative along the logarithm of a law's load, and the residual r of the fit with the
law, the runs g at one value of an input ask for a load that differs by the factor exp(δ_g),

    δ_g = Σ_g cᵀ S⁻¹ r/Σ_g cᵀ S⁻¹ c,

with the standard error (Σ_g cᵀ S⁻¹ c)^(−1/2). A term, in which the motion is nearly linear, differs by 1 + δ_g
instead. The other parameters stay as they were fitted. Where the runs contradict a power law, they are fitted anew
(`calibration.laws.curves`).

Source: partial residuals (Larsen and McCleary 1972).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.laws.curves import Curve, error_bars, factors
from calibration.laws.group_factors import along_load, grouped
from calibration.laws.law import Law
from calibration.laws.readings import EXPONENTS, INPUTS, logarithms
from calibration.statistics.gls import inverse_root
from sim.arrays import Flags, Floats

_LARGEST = 20.0  # logarithm of a factor


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
    errors: Floats  # (2, g) one standard error of it, below and above
    curve: Curve | None  # what the runs ask for where they contradict the power law


def dependences(law: Law, used: Flags) -> list[Dependence]:
    """Compute how a law depends on each input that differs between the runs in `used` (n,)."""
    fitted, model = law.fit, law.model
    x = logarithms(model.runs) - np.array(model.centre[: len(EXPONENTS)])
    along = along_load(model, fitted)
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
        members = grouped(x[used, place])
        weights = np.maximum([(columns[rows] ** 2).sum() for rows in members], np.finfo(float).tiny)
        shifts = np.array([(columns[rows] * residual[rows]).sum() for rows in members]) / weights
        middle = np.array([x[used, place][rows].mean() for rows in members])
        by_runs, errors = _partial(power * middle, shifts, np.minimum(weights**-0.5, _LARGEST), law.place.is_term)
        asked = next((one for one in law.curves if one.symbol == symbol and one.rejected), None)
        if asked is not None:
            by_runs, errors = factors(asked.groups), error_bars(asked.groups)
        results.append(
            Dependence(
                symbol,
                np.exp(curve + model.centre[place]),
                _factor(power * curve),
                _factor(power * curve - half),
                _factor(power * curve + half),
                np.exp(middle + model.centre[place]),
                by_runs,
                errors,
                asked,
            )
        )
    return results


def _partial(law: Floats, shifts: Floats, errors: Floats, is_term: bool) -> tuple[Floats, Floats]:
    """Return the factor (g,) with these shifts from a law, and one standard error below and above (2, g)."""
    if is_term:
        m = _factor(law)
        return m * (1 + shifts), np.stack([m * errors, m * errors])
    middle = _factor(law + shifts)
    return middle, np.stack([middle * -np.expm1(-errors), middle * np.expm1(errors)])


def _factor(logarithm: Floats) -> Floats:
    """Compute e to a power that is limited: what the runs do not determine may be of any size."""
    return np.asarray(np.exp(np.clip(logarithm, -_LARGEST, _LARGEST)))
