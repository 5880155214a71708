"""By which factor the load of a law differs at each value of an input, for the picture of a law.

Runs at the g-th value of an input are a group. With c = ∂f/∂ ln(load) at the fit with a law, the model is linear
in the shift δ_g of each group, with columns c 1_g, and in all other fitted parameters, with the priors of the
nuisance parameters.

The size of the law and the exponent of this input are left out, because the shifts contain them. The load of a
group is that of the law times 1 + δ_g where the law is a term, in which the motion is nearly linear, and times
exp(δ_g) where it is a factor. All are fitted together by generalised least squares, with a scatter of the sessions
of their own. The others are eliminated (Schur complement), which leaves

    χ²(δ) = (δ − δ̂)ᵀ W (δ − δ̂),

so that groups which share a parameter are correlated as they should be. A factor that all groups have in common is
another value of a coefficient: of a factor, W says nothing about it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calibration.laws.law_model import SIZE, LawModel
from calibration.laws.readings import EXPONENTS, INPUTS, logarithms
from calibration.linear.gls import Regression, schur_complement
from calibration.statistics.fit import Fit
from calibration.statistics.statistical_model import precisions, prior_offsets
from common.arrays import Flags, Floats

_PASSES = 3  # iterations for the scatter of the sessions
_MOST_VALUES = 12  # of an input; with more, neighbouring runs are put together
_LEVEL = 0.1  # share of the next information below which the least one is not used
_SEEN = 1e-9  # share of the largest information below which a direction is not determined
_POINTS = 60  # of the line of the law
_LARGEST = 20.0  # logarithm of a factor: what the runs do not determine may be of any size


@dataclass(frozen=True)
class GroupFactors:
    """What the runs at G values of an input ask for, the other inputs at their means, beside the law."""

    symbol: str  # of INPUTS
    x: Floats  # (G,) logarithm of the input, less that at the centre of the law
    centre: float  # logarithm of the input at the centre
    exponent: float  # of the law
    half_width: float  # of its 95 % interval
    is_term: bool  # the load is that of the law times 1 + δ; else times exp(δ)
    shifts: Floats  # (G,) δ̂; of a factor, their mean is 0
    information: Floats  # (G, G) W, less because S is estimated

    @property
    def inputs(self) -> Floats:
        """Values of the input, (G,): rad/s, m, or a number of tails."""
        return np.exp(self.x + self.centre)

    @property
    def factors(self) -> Floats:
        """The factors that these runs ask for, over that at the mean of all runs, (G,)."""
        return self._factors(self.shifts)

    @property
    def errors(self) -> Floats:
        """One standard error of the factors below and above, (2, G)."""
        error = np.sqrt(np.diag(np.linalg.pinv(self.information, rcond=_SEEN, hermitian=True)))
        ends = [self._factors(self.shifts + side * error) for side in (-1, 1)]
        return np.stack([self.factors - ends[0], ends[1] - self.factors])

    def _factors(self, shifts: Floats) -> Floats:
        of_shifts = 1 + shifts if self.is_term else np.exp(np.clip(shifts, -_LARGEST, _LARGEST))
        return np.asarray(np.exp(self.exponent * self.x) * of_shifts)

    def line(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Compute inputs (m,) between the first and the last, the factor of the law there, and its 95 % band."""
        x = np.linspace(self.x[0], self.x[-1], _POINTS)
        half = self.half_width * np.abs(x)
        factor, low, high = np.exp(np.clip(self.exponent * x + np.outer((0, -1, 1), half), -_LARGEST, _LARGEST))
        return np.exp(x + self.centre), factor, low, high

    def levelled(self) -> GroupFactors:
        """Take from the law what the runs determine far worse than all else, such as a constant.

        A coefficient of the head can take the place of a constant couple, so that all factors are uncertain
        together. The direction of the shifts with the least information is set to 0 if it has less than a tenth of
        the next one.
        """
        weights, vectors = np.linalg.eigh(self.information)
        if weights[0] > _LEVEL * weights[1]:
            return self
        level = vectors[:, 0]
        information = self.information + float(weights[-1]) / _SEEN**0.5 * np.outer(level, level)
        return replace(self, shifts=self.shifts - level * (level @ self.shifts), information=information)


def group_factors(model: LawModel, fitted: Fit, used: Flags) -> list[GroupFactors]:
    """Estimate the factors along each input that differs in the runs `used` (n,) and whose exponent is fitted."""
    x = (logarithms(model.runs) - np.array(model.centre[: len(EXPONENTS)]))[used]
    return [
        _along(model, fitted, used, place, x[:, place]).levelled()
        for place, name in enumerate(EXPONENTS)
        if name in fitted.names and np.ptp(x[:, place]) > 0
    ]


def _along(model: LawModel, fitted: Fit, used: Flags, place: int, x: Floats) -> GroupFactors:
    """Estimate the factors along an input, by its place in INPUTS and its logarithms x (n,) of the runs used."""
    data, is_term, name = model.runs, model.place.is_term, EXPONENTS[place]
    of_law = {SIZE, name} if is_term else {name}
    others = [i for i, each in enumerate(fitted.names) if each not in of_law]
    parameters = [fitted.fitted[i] for i in others]
    J, members = fitted.jacobian[used][..., others], np.stack(_grouped(x), 1).astype(float)  # (n, k, p), (n, G)
    columns = np.concatenate([J, _along_load(model, fitted)[used][..., None] * members[:, None]], -1)
    linear = Regression(columns, precisions(parameters), data.session[used], data.scale[used], data.repeats(used))
    as_given = (data.y - fitted.prediction)[used] + J @ prior_offsets(parameters, fitted.parameters)
    products = linear.products(as_given, fitted.noise.run_covariance)
    left = schur_complement(products.at(products.session_ratio(passes=_PASSES)), len(others))
    information, score = left[:-1, :-1], left[:-1, -1]
    if not is_term:  # a factor that all groups have in common is free
        common = information.sum(1)
        whole = max(float(common.sum()), _SEEN * float(np.trace(information)))
        score = score - common * (score.sum() / whole)
        information = information - np.outer(common, common) / whole
    return GroupFactors(
        symbol=INPUTS[place],
        x=(x @ members) / members.sum(0),
        centre=float(model.centre[place]),
        exponent=fitted.parameters[name],
        half_width=fitted.half_width(fitted.names.index(name)),
        is_term=is_term,
        shifts=np.linalg.pinv(information, rcond=_SEEN, hermitian=True) @ score,
        information=information / fitted.inflation,
    )


def _along_load(model: LawModel, fitted: Fit) -> Floats:
    """Compute ∂f/∂ ln(load) of every run, (n, k)."""
    if model.place.is_term:
        return fitted.jacobian[..., fitted.names.index(SIZE)] * fitted.parameters[SIZE]
    columns = [power * fitted.jacobian[..., fitted.names.index(name)] for name, power in model.place.moves]
    return np.asarray(sum(columns))


def _grouped(values: Floats) -> list[Flags]:
    """Put runs of equal value together, or of neighbouring values where there are many; (n,) each."""
    distinct, which = np.unique(values.round(6), return_inverse=True)
    if len(distinct) > _MOST_VALUES:
        edges = np.quantile(values, np.linspace(0, 1, _MOST_VALUES + 1)[1:-1])
        which = np.searchsorted(edges, values)
    return [which == group for group in np.unique(which)]
