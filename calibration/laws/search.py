"""Which places are worth a fit: every place and every set of inputs, ranked by BIC in the linear model.

With the columns d of a place at the fit without laws, the law is the span of d (if it is a term) and of d x_i for
the chosen inputs i, at most three. A side force elsewhere than at the disc is ranked with a few levers, each of
which has columns of its own; its lever counts as one parameter more. A place is ranked by its best model whose
exponents are within their bounds.

**Linear models**, for many residuals at once. A model has the p columns J of the coefficients and nuisance
parameters and q columns X of one place. Each residual has its own S, and each place the scatter of sessions that
all of its columns leave (`calibration.linear.gls`). With this Σ the J are absorbed once for all models of a
place,

    C = Xᵀ Σ⁻¹ X − Xᵀ Σ⁻¹ J A⁻¹ Jᵀ Σ⁻¹ X,   b = Xᵀ Σ⁻¹ r − Xᵀ Σ⁻¹ J A⁻¹ Jᵀ Σ⁻¹ r,   A = Jᵀ Σ⁻¹ J + P⁻¹,

so that a model costs the inverse of its q × q matrix: weights C⁻¹ b, of covariance C⁻¹, and

    BIC = rᵀ Σ⁻¹ r − aᵀ A⁻¹ a − bᵀ C⁻¹ b + ln |Σ|/|S ⊗ I| + q ln(n k),   a = Jᵀ Σ⁻¹ r.

What the choice among the places costs, the p-value of the search tells. Tables are drawn from the fit without
laws: noise of the runs and of the sessions, and nuisance parameters from their priors (`Regression.draw`). The
whole search runs on each. With the largest gain in BIC of the runs, and those of B drawn tables,

    p = (1 + number of tables that gain as much)/(1 + B).

Source: Schwarz (1978) for BIC; Westfall and Young (1993) for the largest of many statistics.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.laws.law_model import LEVER, lever_arms, moved_parameter
from calibration.laws.places import Place
from calibration.laws.readings import EXPONENTS, logarithms, noted_values, parameter_of
from calibration.linear.gls import Regression, schur_complement, solve_normal
from calibration.statistics.fit import Fit
from calibration.statistics.forward import derivatives
from calibration.statistics.statistical_model import precisions, prior_offsets
from calibration.swimmer.swimmer import SwimmerModel
from common.arrays import Flags, Floats, Integers
from sim.effects import effect_named, is_effect
from sim.model.laws import STEEPEST

_AT_ONCE = 25  # residuals
_PASSES = 3  # iterations for the scatter of the sessions
_ABSORBED = 1e-6  # of a column's square, added to it: what is left of one that others explain is rounding
_POWERS_AT_START = 2.0  # largest exponent with which a fit starts
_MOST_INPUTS = 3  # of one law
DRAWS = 999  # tables without a law


@dataclass(frozen=True)
class LinearFits:
    """All models fitted to B residuals; M models, P places with v columns."""

    gain: Floats  # (B, M) BIC of the model without a place less that with it
    weights: Floats  # (B, M, v) of the place's columns; 0 where the column is not in the model
    base_session_ratio: Floats  # (B, k) ρ without a place


class LinearModels:
    """The columns of a search, which stay the same for every residual."""

    def __init__(
        self,
        absorbed: Floats,
        precision: Floats,
        columns: Floats,
        models: Sequence[tuple[int, tuple[int, ...]]],
        session: Integers,
        repeated: Integers | Floats,
        *,
        scale: Floats | None = None,
        further: Sequence[int] = (),
    ):
        """Multiply the columns with each other.

        Args:
            absorbed: J, (n, k, p).
            precision: 1/σ² of their priors, 0 for those that are free, (p,).
            columns: (n, k, P, v) of P places.
            models: place and columns of each.
            session: (n,) numbers of the runs' sessions.
            repeated: what tells repeats, see `Runs.repeats`.
            scale: (n,) roots of the weights of the runs; default 1.
            further: parameters that a model has beside its columns; default none.
        """
        self.columns, self.models = columns, tuple(models)
        self.p, (self._places, self._count) = absorbed.shape[-1], columns.shape[2:]
        table = np.concatenate([absorbed, columns.reshape(*columns.shape[:2], -1)], -1)
        self.design = Regression(table, precision, session, scale, repeated)
        self._further = np.array(further if len(further) else [0] * len(self.models))

    def fit(self, residuals: Floats) -> LinearFits:
        """Fit all models to residuals (B, n, k) from the parameters as given."""
        parts = [self._fit(residuals[i : i + _AT_ONCE]) for i in range(0, len(residuals), _AT_ONCE)]
        return LinearFits(*(np.concatenate([getattr(part, f) for part in parts]) for f in vars(parts[0])))

    def _fit(self, residual: Floats) -> LinearFits:
        p, own, absorbed = self.p, np.arange(self._count), list(range(self.p))
        products = self.design.products(residual)
        base = products.take(np.array([[*absorbed, -1]]))
        base_session_ratio = base.session_ratio(passes=_PASSES)
        without = schur_complement(base.at(base_session_ratio), p)[..., 0, 0] + base.determinant(
            base_session_ratio
        )  # (B, 1)
        firsts = range(p, p + self._places * self._count, self._count)
        places = products.take(np.array([[*absorbed, *(first + own), -1] for first in firsts]))
        session_ratio = places.session_ratio(passes=_PASSES)
        normal, determinant = places.at(session_ratio), places.determinant(session_ratio)
        left = schur_complement(normal, p)  # (B, P, v + 1, v + 1)
        left[..., own, own] += _ABSORBED * normal[..., p + own, p + own]
        shape = len(residual), len(self.models)
        gain, weights = np.empty(shape), np.zeros((*shape, self._count))
        for q in sorted({len(chosen) for _, chosen in self.models}):
            which = np.array([i for i, (_, chosen) in enumerate(self.models) if len(chosen) == q])
            place, chosen = (np.array([self.models[i][part] for i in which]) for part in (0, 1))
            at = np.column_stack([chosen, np.full(len(which), -1)])
            of_models = left[:, place[:, None, None], at[:, :, None], at[:, None, :]]  # (B, models, q + 1, q + 1)
            step = solve_normal(of_models)[0]
            deviance = of_models[..., -1, -1] - (step * of_models[..., :-1, -1]).sum(-1) + determinant[:, place]
            price = (q + self._further[which]) * math.log(residual[0].size)
            gain[:, which] = without - deviance - price
            weights[:, which[:, None], chosen] = step
        return LinearFits(gain, weights, base_session_ratio[:, 0])


@dataclass(frozen=True)
class Ranked:
    """The best linear model of one place."""

    place: Place
    gain: float  # BIC of the model without a law less that with it
    size: float  # of its term at the geometric mean of the runs; 0 for a factor
    exponents: dict[str, float]  # of the inputs in the model
    lever: float = 0.0  # of a place that has one

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


@dataclass(frozen=True)
class Search:
    """All linear models of all places, fitted to the residual of a fit without laws."""

    places: tuple[Place, ...]  # those with one name are variants of a place, of which the best counts
    levers: tuple[float, ...]  # of each
    models: LinearModels
    exponents: tuple[str, ...]  # of a place's columns, after that of the term itself
    residual: Floats  # (n, k) of the fitted runs from the parameters as given
    fits: LinearFits  # of this residual

    @property
    def ranked(self) -> list[Ranked]:
        """The best model of every place, the largest gain first."""
        best: dict[str, Ranked] = {}
        for model in np.argsort(-self.fits.gain[0], kind="stable"):
            ranked = self._ranked(int(model))
            if all(abs(value) <= STEEPEST for value in ranked.exponents.values()):
                best.setdefault(ranked.place.name, ranked)
        return list(best.values())

    def _ranked(self, model: int) -> Ranked:
        number, chosen = self.models.models[model]
        weights = self.fits.weights[0, model]
        place = self.places[number]
        size = float(weights[0]) if place.is_term else 0.0
        scale = (size or 1.0) if place.is_term else 1.0
        exponents = {self.exponents[j - 1]: float(weights[j]) / scale for j in chosen if j}
        return Ranked(place, float(self.fits.gain[0, model]), size, exponents, self.levers[number])


def search(model: SwimmerModel, base: Fit, used: Flags, candidates: Sequence[Place], *, title: str = "") -> Search:
    """Fit every linear model of places to the residual of a fit without laws to the runs in `used` (n,)."""
    directions, variants = _directions(model, base, candidates, title)  # (n, k, variants)
    noted = model.runs.noted_names
    inputs_of_runs = np.concatenate([logarithms(model.runs), noted_values(model.runs, noted)], 1)
    x = np.column_stack([np.ones(len(model.runs)), inputs_of_runs - inputs_of_runs.mean(0)])
    varied = (0, *(i for i in range(1, x.shape[1]) if np.ptp(x[used, i]) > 0))
    names = (*EXPONENTS, *map(parameter_of, noted))
    columns = directions[..., None] * x[:, None, None, varied]  # (n, k, variants, columns)
    kinds = [
        (number, (*([0] if place.is_term else []), *inputs))
        for number, (place, _) in enumerate(variants)
        for inputs in _subsets(range(1, len(varied)), at_least=0 if place.is_term else 1)
    ]
    with_lever = [int(bool(variants[number][0].lever_unit)) for number, _ in kinds]
    data, absorbed = model.runs, base.tangents[used]
    models = LinearModels(
        absorbed,
        precisions(base.fitted),
        columns[used],
        kinds,
        data.session[used],
        data.repeats(used),
        scale=data.scale[used],
        further=with_lever,
    )
    residual = (data.y - base.prediction)[used] + absorbed @ prior_offsets(base.fitted, base.parameters)
    places, levers = zip(*variants, strict=True)
    exponents = tuple(names[i - 1] for i in varied[1:])
    return Search(places, levers, models, exponents, residual, models.fit(residual[None]))


def _directions(
    model: SwimmerModel, base: Fit, candidates: Sequence[Place], title: str
) -> tuple[Floats, list[tuple[Place, float]]]:
    """Compute ∂f/∂F of terms and ∂f/∂ln m of factors (n, k, variants), with the place and the lever of each."""
    names = tuple(dict.fromkeys(name for place in candidates for name, _ in place.moves))
    slopes: dict[str, Floats] = {}
    # What is odd needs both directions simulated, and what is not local more phases: each on its own.
    for group in _by_cost(names):
        along = [moved_parameter(model.robot, name) for name in group]
        table = derivatives(model, base.parameters, along, title=title)[1]
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
        known = [effect_named(name)] if is_effect(name) else []
        key = (any(e.symmetry == "odd" for e in known), any(e.reach == "nonlocal" for e in known))
        groups.setdefault(key, []).append(name)
    return [tuple(group) for group in groups.values()]


def _subsets(items: Sequence[int] | range, *, at_least: int) -> list[tuple[int, ...]]:
    counts = range(at_least, min(len(items), _MOST_INPUTS) + 1)
    return [chosen for count in counts for chosen in itertools.combinations(items, count)]


def search_p_value(search: Search, *, seed: int) -> float:
    """Estimate the probability that noise alone gains as much in a search; `seed` of the draws."""
    models, fits = search.models, search.fits
    run_covariance, session_ratio = (
        models.design.noise(search.residual),
        np.tile(fits.base_session_ratio, (DRAWS, 1)),
    )
    null = models.fit(models.design.draw(np.random.default_rng(seed), run_covariance, session_ratio))
    as_large = int(np.count_nonzero(null.gain.max(1) >= fits.gain.max()))
    return (1 + as_large) / (1 + DRAWS)
