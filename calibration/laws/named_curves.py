"""Curves with a name, fitted to the factors that runs at each value of an input ask for.

With u the input, each family has a scale A, and one to three numbers:

    power         A u^p                       p
    exponential   A exp(k u)                  k
    saturation    A u/(1 + u/u0)              u0
    threshold     A max(u/u0 − 1, 0)          u0; of a term alone, because no coefficient is zero
    kink          A (1 + b max(u/u0 − 1, 0))  u0, b
    resonance     A g²/((u − u0)² + g²)       u0, g; of a coefficient A (1 + b g²/((u − u0)² + g²)), with b

u0 of a threshold, a kink or a resonance lies between the values of the input. A curve is fitted by weighted least
squares in the information W of the shifts (`calibration.laws.group_factors`), from a grid of starts; A, which is
linear, is eliminated. It is acceptable if χ² leaves p ≥ 5 %, which needs a value more than it has numbers. The
interval of a resonance's u0 must be inside the range of the input: at an end nothing shows that the factor falls.
Curves are compared by χ² + q ln(n k), BIC with q numbers for n runs of k outputs.

Source: variable projection, Golub and Pereyra (1973); Schwarz (1978) for BIC.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2 as chi_square

from calibration.attribution.refits import INDISTINGUISHABLE
from calibration.laws.group_factors import GroupFactors
from sim.arrays import Floats
from sim.model.power_law import STEEPEST

POWER = "power"
_ACCEPTED = 0.05  # p-value
_STARTS = (16, 16, 11)  # along each number
_POLISHED = 3  # best starts
_NARROWEST = 0.02  # of a resonance, in ranges of the input
_STEEPEST_KINK = 50.0  # b
_HIGHEST = 50.0  # of a resonance, in the constant
_TINY = 1e-12


@dataclass(frozen=True)
class NamedCurve:
    """A fitted family."""

    name: str
    words: str
    numbers: dict[str, float]  # u0 and g in the unit of the input, k in its inverse
    intervals: dict[str, tuple[float, float]]  # 95 %, for a curve that is right
    factor: Callable[[Floats], Floats]  # of inputs (m,), over that of the law at its centre; of a factor up to A
    chi2: float
    freedom: int  # degrees of freedom of χ²
    bic: float
    at_an_end: bool = False  # of a resonance: the interval of u0 reaches an end of the input's range

    @property
    def p_value(self) -> float:
        """Of χ²; 0 where there are too few values to tell."""
        return float(chi_square.sf(self.chi2, self.freedom)) if self.freedom > 0 else 0.0

    @property
    def acceptable(self) -> bool:
        """Whether the runs agree with it, and show it."""
        return self.p_value >= _ACCEPTED and not self.at_an_end


@dataclass(frozen=True)
class _Family:
    name: str
    words: str
    numbers: tuple[str, ...]
    shape: Callable[[Floats, Floats], Floats]  # of inputs (G,) and numbers
    of_terms: bool = True
    of_factors: bool = True


def _peak(u: Floats, numbers: Floats) -> Floats:
    """Compute the curve of a resonance at numbers[0] of half width numbers[1], with height 1."""
    return np.asarray(numbers[1] ** 2 / ((u - numbers[0]) ** 2 + numbers[1] ** 2))


_FAMILIES = (
    _Family(POWER, "a power law", ("p",), lambda u, a: u ** a[0]),
    _Family("exponential", "an exponential", ("k",), lambda u, a: np.exp(a[0] * (u - u[0]))),
    _Family("saturation", "a saturation", ("u0",), lambda u, a: u / (1 + u / a[0])),
    _Family("threshold", "a threshold", ("u0",), lambda u, a: np.maximum(u / a[0] - 1, 0.0), of_factors=False),
    _Family("kink", "a constant with a kink", ("u0", "b"), lambda u, a: 1 + a[1] * np.maximum(u / a[0] - 1, 0.0)),
    _Family("resonance", "a resonance", ("u0", "g"), lambda u, a: _peak(u, a), of_factors=False),
    _Family("resonance", "a resonance", ("u0", "g", "b"), lambda u, a: 1 + a[2] * _peak(u, a), of_terms=False),
)


def named_curves(groups: GroupFactors, values: int) -> list[NamedCurve]:
    """Fit every family for which there are enough values of the input, the least BIC first.

    Args:
        groups: along one input.
        values: n k, that the law was fitted to.
    """
    families = [family for family in _FAMILIES if (family.of_terms if groups.is_term else family.of_factors)]
    fits = [_fitted(family, groups, values) for family in families if _freedom(family, groups) > 0]
    return sorted(fits, key=lambda curve: curve.bic)


def chosen(curves: list[NamedCurve]) -> list[NamedCurve]:
    """Choose the acceptable curves that the runs cannot tell from the best, best first.

    None is chosen unless the best beats the power law by more than one number can gain by chance.
    """
    power = next(curve for curve in curves if curve.name == POWER)
    acceptable = [curve for curve in curves if curve.acceptable and curve.name != POWER]
    if not acceptable or power.bic - acceptable[0].bic <= INDISTINGUISHABLE:
        return []
    return [curve for curve in acceptable if curve.bic - acceptable[0].bic < INDISTINGUISHABLE]


def _freedom(family: _Family, groups: GroupFactors) -> int:
    return len(groups.x) - 1 - len(family.numbers)


def _fitted(family: _Family, groups: GroupFactors, values: int) -> NamedCurve:
    """Fit a family from the best of a grid of starts."""
    low, high = _bounds(family, groups.inputs)
    weights, vectors = np.linalg.eigh(groups.information)
    root = np.sqrt(np.maximum(weights, 0.0))[:, None] * vectors.T

    def residual(numbers: Floats) -> Floats:
        return root @ (_shifts(family, groups, numbers)[0] - groups.shifts)

    axes = [_starts(a, b, count) for a, b, count in zip(low, high, _STARTS, strict=False)]
    starts = sorted((np.array(s) for s in itertools.product(*axes)), key=lambda s: float((residual(s) ** 2).sum()))
    fits = [least_squares(residual, s, bounds=(low, high), x_scale=high - low) for s in starts[:_POLISHED]]
    best = min(fits, key=lambda fit: fit.cost)
    scale = _shifts(family, groups, best.x)[1]
    lowest = groups.inputs[0]

    def factor(inputs: Floats) -> Floats:
        with_first = family.shape(np.concatenate([[lowest], inputs]), best.x)  # an exponential begins at the first
        return scale * with_first[1:]

    chi2, numbers = 2 * float(best.cost), len(family.numbers) + 1
    slopes = np.asarray(best.jac, float)
    half = 1.96 * np.sqrt(np.diag(np.linalg.pinv(slopes.T @ slopes, hermitian=True)))
    ends = {
        name: (max(float(value - h), float(a)), min(float(value + h), float(b)))
        for name, value, h, a, b in zip(family.numbers, best.x, half, low, high, strict=True)
    }
    return NamedCurve(
        name=family.name,
        words=family.words,
        numbers=dict(zip(family.numbers, best.x.tolist(), strict=True)),
        intervals=ends,
        factor=factor,
        chi2=chi2,
        freedom=_freedom(family, groups),
        bic=chi2 + numbers * math.log(values),
        at_an_end=family.name == "resonance" and not low[0] < ends["u0"][0] < ends["u0"][1] < high[0],
    )


def _starts(low: float, high: float, count: int) -> Floats:
    """Space starts between two bounds, densely near 0 where it is inside and near the lower of positive ones."""
    inside = np.linspace(-1, 1, count + 2)[1:-1]
    if low < 0 < high:
        return np.where(inside < 0, -low, high) * np.sign(inside) * np.abs(inside) ** 3
    return np.asarray(low * (high / low) ** ((inside + 1) / 2))


def _shifts(family: _Family, groups: GroupFactors, numbers: Floats) -> tuple[Floats, float]:
    """Compute the shifts (G,) of a family and its scale A; of a factor, whose A is free, it is chosen."""
    law = np.exp(groups.exponent * groups.x)
    ratio = family.shape(groups.inputs, numbers) / law
    if not groups.is_term:
        shifts = np.log(np.maximum(ratio, _TINY))
        middle = float((shifts - groups.shifts).mean())
        return shifts, math.exp(-middle)
    weighted = groups.information @ ratio
    scale = float(weighted @ (1 + groups.shifts)) / max(float(weighted @ ratio), _TINY)
    return scale * ratio - 1, scale


def _bounds(family: _Family, inputs: Floats) -> tuple[Floats, Floats]:
    """Return the least and largest numbers of a family."""
    first, last = float(inputs[0]), float(inputs[-1])
    range_ = last - first
    edge = 1e-3 * range_
    bounds = {
        POWER: [(-STEEPEST, STEEPEST)],
        "exponential": [(-STEEPEST / first, STEEPEST / first)],
        "saturation": [(first / 30, 30 * last)],
        "threshold": [(first, float(inputs[-2]))],
        "kink": [(first + edge, float(inputs[-2]) - edge), (-_STEEPEST_KINK, _STEEPEST_KINK)],
        "resonance": [(first + edge, last - edge), (_NARROWEST * range_, 2 * range_), (-0.99, _HIGHEST)],
    }[family.name]
    low, high = np.array(bounds[: len(family.numbers)]).T
    return low, high
