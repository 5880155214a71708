"""Which places are worth a fit: every place and every set of inputs, ranked by BIC in the linear model.

With the columns d of a place at the fit without laws, the law is the span of d (if it is a term) and of d x_i for
the chosen inputs i, at most three. A side force elsewhere than at the disc is ranked with a few levers, each of
which has columns of its own; its lever counts as one parameter more. A place is ranked by its best model whose
exponents are within their bounds.

**Linear models**, for many residuals at once. A model has the p columns J of the coefficients and nuisance
parameters and q columns X of one place. Each residual has its own S, and each place the scatter of sessions that
all of its columns leave (`calibration.statistics.gls`). With this Σ the J are absorbed once for all models of a
place,

    C = Xᵀ Σ⁻¹ X − Xᵀ Σ⁻¹ J A⁻¹ Jᵀ Σ⁻¹ X,   b = Xᵀ Σ⁻¹ r − Xᵀ Σ⁻¹ J A⁻¹ Jᵀ Σ⁻¹ r,   A = Jᵀ Σ⁻¹ J + P⁻¹,

so that a model costs the inverse of its q × q matrix: weights C⁻¹ b, of covariance C⁻¹, and

    BIC = rᵀ Σ⁻¹ r − aᵀ A⁻¹ a − bᵀ C⁻¹ b + ln |Σ|/|S ⊗ I| + q ln(n k),   a = Jᵀ Σ⁻¹ r.

What the choice among the places costs, `examine_selection` tells.

**p-value of the search.** Tables are drawn from the fit without laws: noise of the runs and of the sessions, and
nuisance parameters from their priors (`Gls.draw`). The whole search runs on each. With the largest gain in BIC of
the runs, and those of B drawn tables,

    p = (1 + number of tables that gain as much)/(1 + B).

**EBIC** counts the models among which one with q columns was chosen, with γ = 1:

    EBIC = BIC + 2 γ ln(number of models with q columns).

**Selection frequency.** Tables are drawn in the same way from laws: from the best linear model of every place, in
proportion to its probability e^(−BIC/2) among them. The search runs on each. The share of tables in which a place
ranks first, or within `INDISTINGUISHABLE` of the first, says how far other runs of the same design would choose
it. Whole sessions are not resampled: there are three to six, which differ in their tails.

**Intervals after selection.** K is the 95 % quantile over the tables without a law of the largest |z| of all
weights of all models. Estimates ± K standard errors cover all weights of all models at once, and so those of any
model that was chosen by its fit (Berk et al. 2013), to first order in the law.

Source: Schwarz (1978); Westfall and Young (1993) for the largest of many statistics; Chen and Chen (2008) for
EBIC; Kass and Raftery (1995) for BIC as a probability; Efron (2014) for the bootstrap of a choice.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.attribution.refits import INDISTINGUISHABLE
from calibration.laws.law_model import LEVER, lever_arms
from calibration.laws.places import Place
from calibration.laws.readings import EXPONENTS, logarithms, noted_values, parameter_of
from calibration.statistics.fit import Fit
from calibration.statistics.gls import Gls, eliminated, solved
from calibration.statistics.statistical_model import changes, precisions
from calibration.swimmer.swimmer import SwimmerModel
from common.arrays import Flags, Floats, Integers
from sim.effects import effect_named, is_effect
from sim.model.laws import STEEPEST

_AT_ONCE = 25  # residuals
_PASSES = 3  # iterations for the scatter of the sessions
_ABSORBED = 1e-6  # of a column's square, added to it: what is left of one that others explain is rounding
_POWERS_AT_START = 2.0  # largest exponent with which a fit starts
_MOST_INPUTS = 3  # of one law
_NULL_DRAWS = 999  # tables without a law
_LAW_DRAWS = 400  # tables with one
_COVERED = 0.95
_GAMMA = 1.0  # of EBIC


@dataclass(frozen=True)
class LinearFits:
    """All models fitted to B residuals; M models, P places with v columns."""

    gain: Floats  # (B, M) BIC of the model without a place less that with it
    weights: Floats  # (B, M, v) of the place's columns; 0 where the column is not in the model
    errors: Floats  # (B, M, v) their standard errors; infinite where the column is not in the model
    share: Floats  # (B, P, k) ρ
    base_share: Floats  # (B, k) ρ without a place


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
        self.design = Gls(table, precision, session, scale, repeated)
        self._further = np.array(further if len(further) else [0] * len(self.models))

    def fit(self, residuals: Floats) -> LinearFits:
        """Fit all models to residuals (B, n, k) from the parameters as given."""
        parts = [self._fit(residuals[i : i + _AT_ONCE]) for i in range(0, len(residuals), _AT_ONCE)]
        return LinearFits(*(np.concatenate([getattr(part, f) for part in parts]) for f in vars(parts[0])))

    def _fit(self, residual: Floats) -> LinearFits:
        p, own, absorbed = self.p, np.arange(self._count), list(range(self.p))
        products = self.design.products(residual)
        base = products.take(np.array([[*absorbed, -1]]))
        base_share = base.share(passes=_PASSES)
        without = eliminated(base.at(base_share), p)[..., 0, 0] + base.determinant(base_share)  # (B, 1)
        firsts = range(p, p + self._places * self._count, self._count)
        places = products.take(np.array([[*absorbed, *(first + own), -1] for first in firsts]))
        share = places.share(passes=_PASSES)
        normal, determinant = places.at(share), places.determinant(share)
        left = eliminated(normal, p)  # (B, P, v + 1, v + 1)
        left[..., own, own] += _ABSORBED * normal[..., p + own, p + own]
        shape = len(residual), len(self.models)
        gain, weights = np.empty(shape), np.zeros((*shape, self._count))
        errors = np.full_like(weights, np.inf)
        for q in sorted({len(chosen) for _, chosen in self.models}):
            which = np.array([i for i, (_, chosen) in enumerate(self.models) if len(chosen) == q])
            place, chosen = (np.array([self.models[i][part] for i in which]) for part in (0, 1))
            at = np.column_stack([chosen, np.full(len(which), -1)])
            of_models = left[:, place[:, None, None], at[:, :, None], at[:, None, :]]  # (B, models, q + 1, q + 1)
            step, covariance = solved(of_models)
            deviance = of_models[..., -1, -1] - (step * of_models[..., :-1, -1]).sum(-1) + determinant[:, place]
            price = (q + self._further[which]) * math.log(residual[0].size)
            gain[:, which] = without - deviance - price
            weights[:, which[:, None], chosen] = step
            errors[:, which[:, None], chosen] = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
        return LinearFits(gain, weights, errors, share, base_share[:, 0])


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
    def columns(self) -> int:
        """Number of its columns."""
        return len(self.chosen) + self.place.is_term

    @property
    def start(self) -> dict[str, float]:
        """Exponents and lever with which a fit starts."""
        limited = {
            name: min(max(value, -_POWERS_AT_START), _POWERS_AT_START) for name, value in self.exponents.items()
        }
        return {**dict.fromkeys(EXPONENTS, 0.0), **limited, LEVER: self.lever}

    @property
    def is_bounded(self) -> bool:
        """Whether the exponents are within their bounds."""
        return all(abs(value) <= STEEPEST for value in self.exponents.values())


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
            if ranked.is_bounded:
                best.setdefault(ranked.place.name, ranked)
        return list(best.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the places."""
        return tuple(dict.fromkeys(place.name for place in self.places))

    def best(self, gain: Floats) -> Integers:
        """Find the best model of every name, by the gains (B, M) of all models; (B, names)."""
        of_model = np.array([self.places[number].name for number, _ in self.models.models])
        members = [np.flatnonzero(of_model == name) for name in self.names]
        return np.stack([which[gain[:, which].argmax(1)] for which in members], 1)

    def _ranked(self, model: int) -> Ranked:
        number, chosen = self.models.models[model]
        weights = self.fits.weights[0, model]
        place = self.places[number]
        size = float(weights[0]) if place.is_term else 0.0
        scale = (size or 1.0) if place.is_term else 1.0
        exponents = {self.exponents[j - 1]: float(weights[j]) / scale for j in chosen if j}
        return Ranked(place, float(self.fits.gain[0, model]), size, exponents, self.levers[number])


def search(model: SwimmerModel, base: Fit, used: Flags, candidates: Sequence[Place], *, title: str = "") -> Search:
    """Fit every linear model of places to the residual of a fit.

    Args:
        base: the fit without laws.
        used: (n,) runs to which it was fitted.
        title: of the progress bar for the derivatives; empty for none.
    """
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
    data, absorbed = model.runs, base.jacobian[used]
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
    residual = (data.y - base.prediction)[used] + absorbed @ changes(base.fitted, base.parameters)
    places, levers = zip(*variants, strict=True)
    exponents = tuple(names[i - 1] for i in varied[1:])
    return Search(places, levers, models, exponents, residual, models.fit(residual[None]))


def _directions(
    model: SwimmerModel, base: Fit, candidates: Sequence[Place], title: str
) -> tuple[Floats, list[tuple[Place, float]]]:
    """Compute ∂f/∂F of terms and ∂f/∂ln m of factors at the fit, with each lever, (n, k, variants).

    Returns:
        These, and the place and the lever of each variant.
    """
    names = tuple(dict.fromkeys(name for place in candidates for name, _ in place.moves))
    slopes: dict[str, Floats] = {}
    # What is odd needs both directions simulated, and what is not local more phases: each on its own.
    for group in _by_cost(names):
        table = model.derivatives(base.parameters, group, title=title)[1]
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


@dataclass(frozen=True)
class Selection:
    """What the choice among the places costs."""

    p_value: float  # of the largest gain in BIC
    first: dict[str, float]  # place -> share of tables with a law in which it ranks first
    near: dict[str, float]  # place -> share in which it is within INDISTINGUISHABLE of the first
    widest: float  # K: standard errors that cover all weights of all models in 95 %
    models: dict[int, int]  # number of columns -> number of models

    def ebic_gain(self, gain: float, columns: int) -> float:
        """Compute the gain in EBIC of a law with so many columns, by its gain in BIC."""
        return gain - 2 * _GAMMA * math.log(self.models[min(columns, max(self.models))])

    def to_dict(self) -> dict[str, Any]:
        """Return the record for laws.json."""
        return {
            "search_p_value": self.p_value,
            "tables_without_law": _NULL_DRAWS,
            "tables_with_law": _LAW_DRAWS,
            "simultaneous_z": self.widest,
        }


def examine_selection(search: Search, *, seed: int) -> Selection:
    """Draw tables without and with laws, and run the whole search on each; `seed` of the draws."""
    rng, models, fits = np.random.default_rng(seed), search.models, search.fits
    run = models.design.noise(search.residual)
    null = models.fit(models.design.draw(rng, run, np.tile(fits.base_share, (_NULL_DRAWS, 1))))
    as_large = int(np.count_nonzero(null.gain.max(1) >= fits.gain.max()))
    largest = np.abs(null.weights / null.errors).max((1, 2))
    best: Integers = search.best(fits.gain)[0]
    gain = fits.gain[0, best]
    probability = np.exp((gain - gain.max()) / 2)
    true = rng.choice(best, _LAW_DRAWS, p=probability / probability.sum())  # the law of each table
    place = np.array([models.models[m][0] for m in true])
    law = np.einsum("nkbv,bv->bnk", models.columns[:, :, place], fits.weights[0, true])
    gains = models.fit(law + models.design.draw(rng, run, fits.share[0, place])).gain
    of_places = np.take_along_axis(gains, search.best(gains), 1)  # (tables, names)
    behind = of_places.max(1)[:, None] - of_places
    first, near = (dict(zip(search.names, chosen.mean(0).tolist(), strict=True))
                   for chosen in (behind == 0, behind < INDISTINGUISHABLE))  # fmt: skip
    return Selection(
        p_value=(1 + as_large) / (1 + _NULL_DRAWS),
        first=first,
        near=near,
        widest=float(np.quantile(largest, _COVERED)),
        models=dict(Counter(len(chosen) for _, chosen in models.models)),
    )
