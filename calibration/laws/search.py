"""Which places are worth a fit: every place and every set of inputs, ranked by BIC in the linear model.

With the columns d of a place at the fit without laws, the law is the span of d (if it is a term) and of d x_i for
the chosen inputs i, at most three. A side force elsewhere than at the disc is ranked with a few levers, each of
which has columns of its own; its lever counts as one parameter more. The law is fitted together with the
coefficients and the nuisance parameters by generalised least squares (`calibration.laws.linear_models`). A place
is ranked by its best model whose exponents are within their bounds.

Source: Schwarz (1978).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.laws.inputs import EXPONENTS, logarithms, noted_values, parameter_of
from calibration.laws.law_model import LEVER, lever_arms
from calibration.laws.linear_models import LinearFits, LinearModels
from calibration.laws.places import Place
from calibration.statistics.fit import Fit
from calibration.statistics.statistical_model import changes, precisions
from calibration.swimmer.swimmer import SwimmerModel
from sim.arrays import Flags, Floats, Integers
from sim.effects import catalogue, effect_named
from sim.model.power_law import STEEPEST

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


def _subsets(items: Sequence[int] | range, *, at_least: int) -> list[tuple[int, ...]]:
    counts = range(at_least, min(len(items), _MOST_INPUTS) + 1)
    return [chosen for count in counts for chosen in itertools.combinations(items, count)]
