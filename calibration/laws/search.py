"""Which places are worth a fit: every place and every set of inputs, ranked by BIC in the linear model.

With the columns d of a place at the fit without laws, the law is the span of d (if it is a term) and of d x_i for
the chosen inputs i. It is fitted together with the coefficients and the nuisance parameters by generalised least
squares (`calibration.laws.linear_models`).

Source: Schwarz (1978).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.laws.law_model import EXPONENTS, logarithms
from calibration.laws.linear_models import LinearFits, LinearModels
from calibration.laws.places import Place
from calibration.statistics.fit import Fit
from calibration.statistics.statistical_model import changes, precisions
from calibration.swimmer.swimmer import SwimmerModel
from sim.arrays import Flags, Floats, Integers

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
    def columns(self) -> int:
        """Number of its columns."""
        return len(self.chosen) + self.place.is_term

    @property
    def start(self) -> dict[str, float]:
        """Exponents with which a fit starts."""
        limited = np.clip(self.exponents, -_POWERS_AT_START, _POWERS_AT_START)
        return dict(zip(EXPONENTS, limited.tolist(), strict=True))


@dataclass(frozen=True)
class Search:
    """All linear models of all places, fitted to the residual of a fit without laws."""

    places: tuple[Place, ...]  # those with one name are variants of a place, of which the best counts
    models: LinearModels
    varied: tuple[int, ...]  # of a place's columns: 0 is the term itself, the others are of EXPONENTS, from 1
    residual: Floats  # (n, k) of the fitted runs from the parameters as given
    fits: LinearFits  # of this residual

    @property
    def ranked(self) -> list[Ranked]:
        """The best model of every place, the largest gain first."""
        best = [self._ranked(model) for model in self.best(self.fits.gain)[0]]
        return sorted(best, key=lambda ranked: -ranked.gain)

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
        weights = {self.varied[j]: float(self.fits.weights[0, model, j]) for j in chosen}
        return _ranked(self.places[number], float(self.fits.gain[0, model]), weights)


def search(model: SwimmerModel, base: Fit, used: Flags, candidates: Sequence[Place], *, title: str = "") -> Search:
    """Fit every linear model of places to the residual of a fit.

    Args:
        base: the fit without laws.
        used: (n,) runs to which it was fitted.
        title: of the progress bar for the derivatives; empty for none.
    """
    directions = _directions(model, base, candidates, title)  # (n, k, places)
    inputs_of_runs = logarithms(model.runs)
    x = np.column_stack([np.ones(len(model.runs)), inputs_of_runs - inputs_of_runs.mean(0)])
    varied = (0, *(i for i in range(1, x.shape[1]) if np.ptp(x[used, i]) > 0))
    columns = directions[..., None] * x[:, None, None, varied]  # (n, k, places, columns)
    kinds = [
        (number, (*([0] if place.is_term else []), *inputs))
        for number, place in enumerate(candidates)
        for inputs in _subsets(range(1, len(varied)), at_least=0 if place.is_term else 1)
    ]
    data, absorbed = model.runs, base.jacobian[used]
    models = LinearModels(
        absorbed, precisions(base.fitted), columns[used], kinds, data.session[used], data.condition[used]
    )
    residual = (data.y - base.prediction)[used] + absorbed @ changes(base.fitted, base.parameters)
    return Search(tuple(candidates), models, varied, residual, models.fit(residual[None]))


def _directions(model: SwimmerModel, base: Fit, candidates: Sequence[Place], title: str) -> Floats:
    """Compute ∂f/∂F of terms and ∂f/∂ln m of factors at the fit, (n, k, places)."""
    names = tuple(dict.fromkeys(name for place in candidates for name, _ in place.moves))
    terms = {name for place in candidates if place.is_term for name, _ in place.moves}
    table = model.derivatives({**base.parameters, **dict.fromkeys(terms, 1.0)}, names, title=title)[1]
    slopes = [sum(power * table[..., names.index(name)] for name, power in place.moves) for place in candidates]
    return np.stack([np.asarray(slope) for slope in slopes], -1)


def _ranked(place: Place, gain: float, weights: dict[int, float]) -> Ranked:
    """Read a size and exponents from the weights of the columns; column 0 is the term itself."""
    size = weights.pop(0, 0.0)
    scale = (size or 1.0) if place.is_term else 1.0
    exponents = [weights.get(i, 0.0) / scale for i in range(1, len(EXPONENTS) + 1)]
    return Ranked(place, gain, size, tuple(exponents))


def _subsets(items: Sequence[int] | range, *, at_least: int) -> list[tuple[int, ...]]:
    return [s for count in range(at_least, len(items) + 1) for s in itertools.combinations(items, count)]
