"""Which places are worth a fit: every place and every set of inputs, ranked by BIC in the linear model.

With the columns d of a place at the fit without laws, the law is the span of d (if it is a term) and of d x_i for
the chosen inputs i. It is fitted together with the coefficients and the nuisance parameters by generalised least
squares, and each such model has its own scatter of the sessions:

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

from calibration.laws.law_model import EXPONENTS, logarithms
from calibration.laws.places import Place
from calibration.statistics.fit import Fit
from calibration.statistics.statistical_model import Sums, inverse_root, least_squares, sums, with_prior
from calibration.swimmer.swimmer import SwimmerModel
from sim.arrays import Flags, Floats

_PASSES = 3  # iterations for the scatter of the sessions
_POWERS_AT_START = 2.0  # largest exponent with which a fit starts


@dataclass(frozen=True)
class Ranked:
    """The best linear model of one place."""

    place: Place
    gain: float  # BIC of the model without a law less that with it
    size: float  # of its term at the geometric mean of the runs; 0 for a factor
    exponents: tuple[float, ...]  # of EXPONENTS; 0 where the input is not in the model

    @property
    def chosen(self) -> tuple[str, ...]:
        """Names of the exponents in the model."""
        return tuple(name for name, value in zip(EXPONENTS, self.exponents, strict=True) if value)

    @property
    def start(self) -> dict[str, float]:
        """Exponents with which a fit starts."""
        limited = np.clip(self.exponents, -_POWERS_AT_START, _POWERS_AT_START)
        return dict(zip(EXPONENTS, limited.tolist(), strict=True))


def rank(
    model: SwimmerModel, base: Fit, used: Flags, candidates: Sequence[Place], *, title: str = ""
) -> list[Ranked]:
    """Rank places by the gain in BIC of their best linear model, the best first.

    Args:
        base: the fit without laws.
        used: (n,) runs to which it was fitted.
        title: of the progress bar for the derivatives; empty for none.
    """
    directions = _directions(model, base, candidates, title)  # (n, k, places)
    inputs_of_runs = logarithms(model.runs)
    x = np.column_stack([np.ones(len(model.runs)), inputs_of_runs - inputs_of_runs.mean(0)])
    varied = [0, *(i for i in range(1, x.shape[1]) if np.ptp(x[used, i]) > 0)]
    by_place = directions[..., None] * x[:, None, None, varied]  # (n, k, places, columns)
    columns = by_place.reshape(*directions.shape[:2], -1)
    products = _products(model, base, used, columns)
    fitted = len(base.names)
    values = int(used.sum()) * directions.shape[1]
    without = _deviance(products, [*range(fitted)])[0]
    best = []
    for number, place in enumerate(candidates):
        first = fitted + number * len(varied)
        models = []
        for inputs in _subsets(range(1, len(varied)), at_least=0 if place.is_term else 1):
            places = [*([0] if place.is_term else []), *inputs]
            deviance, step = _deviance(products, [*range(fitted), *(first + j for j in places)])
            gain = without - deviance - len(places) * math.log(values)
            models.append(_ranked(place, gain, dict(zip((varied[j] for j in places), step[fitted:], strict=True))))
        best.append(max(models, key=lambda ranked: ranked.gain))
    return sorted(best, key=lambda ranked: -ranked.gain)


def _directions(model: SwimmerModel, base: Fit, candidates: Sequence[Place], title: str) -> Floats:
    """Compute ∂f/∂F of terms and ∂f/∂ln m of factors at the fit, (n, k, places)."""
    names = tuple(dict.fromkeys(name for place in candidates for name, _ in place.moves))
    terms = {name for place in candidates if place.is_term for name, _ in place.moves}
    table = model.derivatives({**base.parameters, **dict.fromkeys(terms, 1.0)}, names, title=title)[1]
    slopes = [sum(power * table[..., names.index(name)] for name, power in place.moves) for place in candidates]
    return np.stack([np.asarray(slope) for slope in slopes], -1)


def _products(model: SwimmerModel, base: Fit, used: Flags, columns: Floats) -> Sums:
    """Multiply the columns of the fit, those of the places, and the residual with each other."""
    data = model.runs
    residual = (data.y - base.prediction)[..., None]
    table = np.concatenate([base.jacobian, columns, residual], -1)[used]
    root = inverse_root(base.noise.run)
    products = sums(root @ table, data.session[used], len(root), data.scale[used])
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


def _ranked(place: Place, gain: float, weights: dict[int, float]) -> Ranked:
    """Read a size and exponents from the weights of the columns; column 0 is the term itself."""
    size = weights.pop(0, 0.0)
    scale = (size or 1.0) if place.is_term else 1.0
    exponents = [weights.get(i, 0.0) / scale for i in range(1, len(EXPONENTS) + 1)]
    return Ranked(place, gain, size, tuple(exponents))


def _subsets(items: Sequence[int] | range, *, at_least: int) -> list[tuple[int, ...]]:
    return [s for count in range(at_least, len(items) + 1) for s in itertools.combinations(items, count)]
