"""The curve that the runs ask for along an input where a power law leaves a residual, and its name if it has one.

The shifts δ(x) of the load from the power law (`calibration.laws.group_factors`) are smoothed by a natural cubic
spline in the logarithm x of the input, with a knot at each of its values:

    minimise (δ − δ̂)ᵀ W (δ − δ̂) + λ ∫ δ″(x)² dx.

With a large λ, δ is a straight line, which is another power law. λ has the least BIC with tr (W + λK)⁻¹W effective
degrees of freedom. The 95 % band is that of the posterior covariance (W + λK)⁻¹ (Wahba 1983). It counts the noise;
what happens between two values of the input is unknown.

A level that the runs hardly determine, such as a constant that a coefficient of the head can replace, is taken
from the law (`GroupFactors.levelled`); the name of a curve does not depend on it.

A power law is rejected if its lack of fit is significant at half of the level α, divided by the number of inputs
that were tested, and if free factors leave no more than noise; otherwise a wrong place may be the cause. Only then
is a name given.

**Names.** With u the input, each family has a scale A, and one to three numbers:

    power         A u^p                       p
    exponential   A exp(k u)                  k
    saturation    A u/(1 + u/u0)              u0
    threshold     A max(u/u0 − 1, 0)          u0; of a term alone, because no coefficient is zero
    kink          A (1 + b max(u/u0 − 1, 0))  u0, b
    resonance     A g²/((u − u0)² + g²)       u0, g; of a coefficient A (1 + b g²/((u − u0)² + g²)), with b

u0 of a threshold, a kink or a resonance lies between the values of the input. A curve is fitted by weighted least
squares in the information W of the shifts from a grid of starts; A, which is linear, is eliminated. It is
acceptable if χ² leaves p ≥ 5 %, which needs a value more than it has numbers. The interval of a resonance's u0
must be inside the range of the input: at an end nothing shows that the factor falls. Curves are compared by χ² + q
ln(n k), BIC with q numbers for n runs of k outputs.

Source: Green and Silverman (1994), chapter 2; Golub and Pereyra (1973), variable projection; Schwarz (1978), BIC.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.stats import chi2 as chi_square

from calibration.attribution.refits import INDISTINGUISHABLE
from calibration.laws.group_factors import DRAWS, GroupFactors, group_factors, with_shifts
from calibration.laws.law_model import LawModel
from calibration.statistics.fit import Fit
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.study import Study
from common.arrays import Floats
from sim.model.laws import STEEPEST

POWER = "power"
_ACCEPTED = 0.05  # p-value
_STARTS = (16, 16, 11)  # along each number
_POLISHED = 3  # best starts
_NARROWEST = 0.02  # of a resonance, in ranges of the input
_STEEPEST_KINK = 50.0  # b
_HIGHEST = 50.0  # of a resonance, in the constant
_TINY = 1e-12
UNITS = {"ω": (30 / math.pi, "rpm", "omega_rpm"), "l": (100.0, "cm", "l_cm"), "N": (1.0, "tails", "N")}
_POINTS = 121  # of a curve
_SMOOTHNESS = np.logspace(-8, 6, 57)  # λ over tr W/tr K
_DRAWS = 400  # of the bootstrap, for the residual that a curve leaves
_BAND = 1.96  # standard errors
_INVERSE = {"k"}  # numbers in the inverse unit of the input
_PURE = {"p", "b"}  # numbers without a unit


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


@dataclass(frozen=True)
class Curve:
    """The factor of a law's load along one input, over that at the mean of the runs, without a power law."""

    groups: GroupFactors
    level: float  # below this p-value the power law is contradicted
    complete_from: float  # from this p-value on, what the curve leaves is noise
    inputs: Floats  # (m,) along the curve: rad/s, m, or a number of tails
    factor: Floats  # (m,) of the spline
    low: Floats  # (m,) 95 % band
    high: Floats
    freedom: float  # effective degrees of freedom of the spline
    turn: tuple[str, float] | None  # "maximum" or "minimum" inside, beyond the noise, and the input where it is
    fits: tuple[NamedCurve, ...]  # curves with a name, least BIC first; none unless the power law is contradicted
    left: float = math.nan  # p-value of the residual with free factors along this input, if it is contradicted

    @property
    def symbol(self) -> str:
        """The input, of INPUTS."""
        return self.groups.symbol

    @property
    def p_value(self) -> float:
        """Of the power law."""
        return self.groups.p_value

    @property
    def contradicted(self) -> bool:
        """Whether the lack of fit of the power law is significant, be it a wrong place that causes it."""
        return self.p_value < self.level

    @property
    def rejected(self) -> bool:
        """Whether the power law is contradicted, and free factors in its place leave no more than noise."""
        return self.contradicted and self.left >= self.complete_from

    @cached_property
    def named(self) -> tuple[NamedCurve, ...]:
        """Curves that the runs agree with and do not tell apart, best first; none where there is no simple one."""
        return tuple(chosen(list(self.fits))) if self.rejected else ()

    @property
    def words(self) -> str:
        """What follows "Along ω it is"; empty where the power law is not rejected."""
        if not self.rejected:
            return ""
        course = f"no power law (p = {self.p_value:.2g}): the runs ask for a factor that {self._course}"
        return f"{course}{self._name}; with it no more than noise is left (p = {self.left:.2g})"

    @property
    def _course(self) -> str:
        if self.turn is None:
            return "rises" if self.factor[-1] > self.factor[0] else "falls"
        verb = "rises to a maximum" if self.turn[0] == "maximum" else "falls to a minimum"
        return f"{verb} near {_shown(self.turn[1], self.symbol)}"

    @property
    def _name(self) -> str:
        if not self.named:
            return ", and agree with no simple curve"
        first, *others = [_described(curve, self.symbol) for curve in self.named]
        return f", like {first}" + (f", or as well like {' or '.join(others)}" if others else "")

    def to_dict(self) -> dict[str, Any]:
        """Return the record for laws.json and verdict.json; inputs in the unit that the column's name says."""
        scale, _, column = UNITS[self.symbol]
        return {
            "input": column,
            "p_value": self.p_value,
            "power_law_rejected": self.rejected,
            "p_value_with_curve": self.left if self.contradicted else None,
            "words": self.words,
            "values": (scale * self.groups.inputs).tolist(),
            "factors": factors(self.groups).tolist(),
            "errors": [list(pair) for pair in error_bars(self.groups).T.tolist()],
            "spline": {
                "degrees_of_freedom": self.freedom,
                "at": (scale * self.inputs).tolist(),
                "factor": self.factor.tolist(),
                "low": self.low.tolist(),
                "high": self.high.tolist(),
            },
            "named": [curve.name for curve in self.named],
            "curves": [
                {
                    "name": curve.name,
                    "numbers": {
                        name: {
                            "value": _in_unit(name, curve.numbers[name], scale),
                            "interval": [_in_unit(name, end, scale) for end in curve.intervals[name]],
                        }
                        for name in curve.numbers
                    },
                    "chi2": curve.chi2,
                    "degrees_of_freedom": curve.freedom,
                    "p_value": curve.p_value,
                    "bic": curve.bic,
                }
                for curve in self.fits
            ],
        }


def find_curves(study: Study, fitted: Fit, *, draws: int = DRAWS) -> tuple[Curve, ...]:
    """Find the curve along each input whose exponent is fitted and that has three values or more.

    Args:
        study: of a `LawModel`; half of its level is α of a rejection of any of the power laws of this law.
        fitted: to the runs that the study uses.
        draws: of the bootstrap of the power law.
    """
    model, used = study.model, study.split.fitted
    if not isinstance(model, LawModel):
        raise TypeError("a curve is looked for in a LawModel")
    tested = group_factors(model, fitted, used, seed=study.seed, draws=draws)
    curves = [_curve(groups, study.values, study.level, len(tested)) for groups in tested]
    return tuple(
        replace(one, left=_left(study, model, fitted, one)) if one.contradicted else one for one in curves
    )


def _left(study: Study, model: LawModel, fitted: Fit, curve: Curve) -> float:
    """Compute the p-value of the residual that free shifts along the input of a curve leave."""
    refit = with_shifts(model, fitted, study.split.fitted, curve.symbol)
    none = Directions.plain(np.empty((*model.runs.y.shape, 0)))
    return examine_residual(study, refit, none, draws=_DRAWS).general_p


def factors(groups: GroupFactors) -> Floats:
    """Compute the factor that the runs at each value ask for, (G,)."""
    return _factor(groups, groups.x, groups.shifts)


def error_bars(groups: GroupFactors) -> Floats:
    """Compute one standard error of these factors below and above, (2, G)."""
    middle = factors(groups)
    ends = [_factor(groups, groups.x, groups.shifts + side * groups.errors) for side in (-1, 1)]
    return np.stack([middle - ends[0], ends[1] - middle])


def _factor(groups: GroupFactors, x: Floats, shifts: Floats) -> Floats:
    law = np.exp(groups.exponent * x)
    return np.asarray(law * (1 + shifts) if groups.is_term else law * np.exp(np.clip(shifts, -20, 20)))


def _curve(groups: GroupFactors, values: int, alpha: float, tests: int) -> Curve:
    """Smooth the shifts, and name the curve where the power law is contradicted, in so many tests."""
    level = alpha / 2 / tests
    fits = tuple(named_curves(groups, values)) if groups.p_value < level else ()
    groups = groups.levelled()
    x, W = groups.x, groups.information
    K = _roughness(x)
    unit = float(np.trace(W) / np.trace(K))
    smoothed = [_smoothed(groups, K * unit * smoothness) for smoothness in _SMOOTHNESS]
    shifts, covariance, freedom = min(smoothed, key=lambda s: _bic(groups, s, values))
    fine = np.linspace(x[0], x[-1], _POINTS)
    basis = CubicSpline(x, np.eye(len(x)), bc_type="natural")(fine)  # (m, G)
    at, spread = basis @ shifts, basis @ covariance @ basis.T
    half = _BAND * np.sqrt(np.maximum(np.diag(spread), 0.0))
    return Curve(
        groups=groups,
        level=level,
        complete_from=alpha / 2,
        inputs=np.exp(fine + groups.centre),
        factor=_factor(groups, fine, at),
        low=_factor(groups, fine, at - half),
        high=_factor(groups, fine, at + half),
        freedom=freedom,
        turn=_turn(groups, fine, at, spread),
        fits=fits,
    )


def _roughness(x: Floats) -> Floats:
    """Compute K (G, G): δᵀ K δ is ∫ δ″² of the natural cubic spline through δ at x."""
    second = CubicSpline(x, np.eye(len(x)), bc_type="natural")(x, 2)  # (G, G), linear between the knots
    first, last, width = second[:-1], second[1:], np.diff(x)[:, None, None]
    product = first[:, :, None] * first[:, None] + last[:, :, None] * last[:, None]
    mixed = first[:, :, None] * last[:, None]
    return np.asarray((width * (2 * product + mixed + np.swapaxes(mixed, 1, 2)) / 6).sum(0))


def _smoothed(groups: GroupFactors, penalty: Floats) -> tuple[Floats, Floats, float]:
    """Return the spline at the knots, its covariance, and its effective degrees of freedom."""
    covariance = np.linalg.pinv(groups.information + penalty, rcond=1e-12, hermitian=True)
    smoother = covariance @ groups.information
    return smoother @ groups.shifts, np.asarray(covariance), float(np.trace(smoother))


def _bic(groups: GroupFactors, smoothed: tuple[Floats, Floats, float], values: int) -> float:
    left = smoothed[0] - groups.shifts
    return float(left @ groups.information @ left) + smoothed[2] * math.log(values)


def _turn(groups: GroupFactors, x: Floats, shifts: Floats, spread: Floats) -> tuple[str, float] | None:
    """Find an extreme of the curve inside that differs from both ends by more than noise; else None."""
    slope = np.exp(groups.exponent * x) if groups.is_term else np.ones_like(x)
    height = slope * (1 + shifts) if groups.is_term else groups.exponent * x + shifts
    covariance = slope[:, None] * spread * slope
    extremes = {}
    for kind, sign in (("maximum", 1.0), ("minimum", -1.0)):
        at = int(np.argmax(sign * height))
        variance = [covariance[at, at] + covariance[end, end] - 2 * covariance[at, end] for end in (0, -1)]
        beyond = [
            sign * (height[at] - height[end]) / math.sqrt(max(v, 1e-30))
            for end, v in zip((0, -1), variance, strict=True)
        ]
        if 0 < at < len(x) - 1 and min(beyond) > _BAND:
            extremes[kind] = (min(beyond), float(np.exp(x[at] + groups.centre)))
    if not extremes:
        return None
    kind = max(extremes, key=lambda name: extremes[name][0])
    return kind, extremes[kind][1]


def _shown(value: float, symbol: str) -> str:
    scale, unit, _ = UNITS[symbol]
    return f"{scale * value:.3g} {unit}"


def _described(curve: NamedCurve, symbol: str) -> str:
    """Say a curve's name, with the input that belongs to it."""
    if "u0" not in curve.numbers:
        return curve.words
    low, high = curve.intervals["u0"]
    scale = UNITS[symbol][0]
    return f"{curve.words} at {_shown(curve.numbers['u0'], symbol)} ({scale * low:.3g} to {scale * high:.3g})"


def _in_unit(name: str, value: float, scale: float) -> float:
    if name in _PURE:
        return value
    return value / scale if name in _INVERSE else value * scale
