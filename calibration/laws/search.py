"""Which places are worth a fit: every place and every set of inputs, ranked by BIC in the linear model.

With the columns d of a place at the fit without laws, the law is the span of d (if it is a term) and of d x_i for
the chosen inputs i, at most three, with exponents within their bounds. A side force elsewhere than at the disc is
ranked with a few levers, each of which has columns of its own; its lever counts as one parameter more. The law is
fitted together with the coefficients and the nuisance parameters by generalised least squares, and each such model
has its own scatter of the sessions:

    BIC = rᵀ Σ⁻¹ r + ln |Σ|/|S ⊗ I| + q ln(n k),   q columns, n runs of k outputs.

All products of columns are made once, so that a model costs the inverse of a small matrix.

Source: Schwarz (1978).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.laws.inputs import EXPONENTS, logarithms, noted_values, parameter_of
from calibration.laws.law_model import LEVER, lever_arms
from calibration.laws.places import Place
from calibration.statistics.fit import Fit
from calibration.statistics.statistical_model import Sums, inverse_root, least_squares, sums, with_prior
from calibration.swimmer.swimmer import SwimmerModel
from sim.arrays import Flags, Floats
from sim.effects import catalogue, effect_named
from sim.model.power_law import STEEPEST

_PASSES = 3  # iterations for the scatter of the sessions
_POWERS_AT_START = 2.0  # largest exponent with which a fit starts
_MOST_INPUTS = 3  # of one law


@dataclass(frozen=True)
class Ranked:
    """The best linear model of one place."""

    place: Place
    gain: float  # BIC of the model without a law less that with it
    size: float  # of its term at the geometric mean of the runs; 0 for a factor
    exponents: dict[str, float]  # of the inputs in the model
    lever: float = 0.0  # of a place that has one

    @property
    def chosen(self) -> tuple[str, ...]:
        """Names of the exponents in the model."""
        return tuple(self.exponents)

    @property
    def noted(self) -> tuple[str, ...]:
        """Noted inputs in the model."""
        return tuple(name.removeprefix("law_") for name in self.exponents if name not in EXPONENTS)

    @property
    def start(self) -> dict[str, float]:
        """Exponents and lever with which a fit starts."""
        limited = {
            name: min(max(value, -_POWERS_AT_START), _POWERS_AT_START) for name, value in self.exponents.items()
        }
        return {**dict.fromkeys(EXPONENTS, 0.0), **limited, LEVER: self.lever}


def rank(
    model: SwimmerModel, base: Fit, used: Flags, candidates: Sequence[Place], *, title: str = ""
) -> list[Ranked]:
    """Rank places by the gain in BIC of their best linear model, the best first.

    Args:
        base: the fit without laws.
        used: (n,) runs to which it was fitted.
        title: of the progress bar for the derivatives; empty for none.
    """
    directions, levers = _directions(model, base, candidates, title)  # (n, k, variants)
    noted = model.runs.noted_names
    names = (*EXPONENTS, *map(parameter_of, noted))
    inputs_of_runs = np.concatenate([logarithms(model.runs), noted_values(model.runs, noted)], 1)
    x = np.column_stack([np.ones(len(model.runs)), inputs_of_runs - inputs_of_runs.mean(0)])
    varied = [0, *(i for i in range(1, x.shape[1]) if np.ptp(x[used, i]) > 0)]
    by_variant = directions[..., None] * x[:, None, None, varied]  # (n, k, variants, columns)
    columns = by_variant.reshape(*directions.shape[:2], -1)
    products = _products(model, base, used, columns)
    fitted = len(base.names)
    values = int(used.sum()) * directions.shape[1]
    without = _deviance(products, [*range(fitted)])[0]
    best: dict[str, Ranked] = {}
    for number, (place, lever) in enumerate(levers):
        first = fitted + number * len(varied)
        for inputs in _subsets(range(1, len(varied)), at_least=0 if place.is_term else 1):
            places = [*([0] if place.is_term else []), *inputs]
            deviance, step = _deviance(products, [*range(fitted), *(first + j for j in places)])
            gain = without - deviance - (len(places) + bool(place.lever_unit)) * math.log(values)
            if place.name in best and gain <= best[place.name].gain:
                continue
            weights = dict(zip(places, step[fitted:].tolist(), strict=True))
            by_name = {names[varied[j] - 1]: weights[j] for j in inputs}
            law = _ranked(place, gain, weights.get(0, 0.0), by_name, lever)
            if all(abs(exponent) <= STEEPEST for exponent in law.exponents.values()):
                best[place.name] = law
    return sorted(best.values(), key=lambda ranked: -ranked.gain)


def _directions(
    model: SwimmerModel, base: Fit, candidates: Sequence[Place], title: str
) -> tuple[Floats, list[tuple[Place, float]]]:
    """Compute ∂f/∂F of terms and ∂f/∂ln m of factors at the fit, with each lever, (n, k, variants).

    Returns:
        These, and the place and the lever of each variant.
    """
    names = tuple(dict.fromkeys(name for place in candidates for name, _ in place.moves))
    terms = {name for place in candidates if place.is_term for name, _ in place.moves}
    start = {**base.parameters, **dict.fromkeys(terms, 1.0)}
    slopes: dict[str, Floats] = {}
    # What is odd needs both directions simulated, and what is not local more phases: each on its own.
    for group in _by_cost(names):
        table = model.derivatives(start, group, title=title)[1]
        slopes.update({name: table[..., j] for j, name in enumerate(group)})
    columns, variants = [], []
    for place in candidates:
        arms = lever_arms(model.robot, model.runs, place.lever_unit)[:, None] if place.lever_unit else None
        for lever in place.levers:
            moved = [power * slopes[name] for name, power in place.moves]
            columns.append(np.asarray(sum(moved) if arms is None else moved[0] + lever * arms * moved[1]))
            variants.append((place, lever))
    return np.stack(columns, -1), variants


def _by_cost(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Group parameters by what their derivatives need."""
    groups: dict[tuple[bool, bool], list[str]] = {}
    for name in names:
        known = [effect_named(name)] if name in catalogue() else []
        key = (any(e.symmetry == "odd" for e in known), any(e.reach == "nonlocal" for e in known))
        groups.setdefault(key, []).append(name)
    return [tuple(group) for group in groups.values()]


def _products(model: SwimmerModel, base: Fit, used: Flags, columns: Floats) -> Sums:
    """Multiply the columns of the fit, those of the places, and the residual with each other."""
    data = model.runs
    residual = (data.y - base.prediction)[..., None]
    table = np.concatenate([base.jacobian, columns, residual], -1)[used]
    products = sums(inverse_root(base.noise.run) @ table, data.session[used], len(base.noise.run))
    p, m = len(base.names), table.shape[-1]
    ends = np.r_[np.arange(p), m - 1]
    empty = Sums(np.zeros((p + 1, p + 1)), products.between[:, :1, :1], products.sizes, products.outputs)
    products.within[np.ix_(ends, ends)] += with_prior(empty, base.fitted, base.parameters).within
    return products


def _deviance(products: Sums, columns: Sequence[int]) -> tuple[float, Floats]:
    """Compute the least deviance with these columns, and their coefficients."""
    last = products.within.shape[-1] - 1
    part = products.take(np.array([[*columns, last]]))
    linear = least_squares(part, passes=_PASSES)
    normal, step = part.at(linear.share)[0], linear.step[0]
    left = normal[-1, -1] - step @ normal[:-1, -1]
    scatter = products.outputs * np.log1p(float(linear.share[0]) * products.sizes).sum()
    return float(left + scatter), step


def _ranked(place: Place, gain: float, size: float, weights: dict[str, float], lever: float) -> Ranked:
    """Read exponents from the weights of the columns d x_i; `size` is that of the column d."""
    scale = (size or 1.0) if place.is_term else 1.0
    return Ranked(place, gain, size, {name: weight / scale for name, weight in weights.items()}, lever)


def _subsets(items: Sequence[int] | range, *, at_least: int) -> list[tuple[int, ...]]:
    counts = range(at_least, min(len(items), _MOST_INPUTS) + 1)
    return [chosen for count in counts for chosen in itertools.combinations(items, count)]
