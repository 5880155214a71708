"""By which factor the load of a law differs at each value of an input, and whether a power law is enough.

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

A power law is δ_g = a + b x_g, x the logarithm of the input. Lack of fit is what the other G − 2 contrasts of the
shifts gain: T = χ² of the best power law less that of free shifts. Its null distribution comes from data drawn
with the fitted noise, the scatter of the sessions and the priors, each with an estimated S and ρ of its own.

Left out: the choice of the place, and terms in which the motion is not linear.

Source: lack of fit, e.g. Seber and Lee (2003), section 4.4; parametric bootstrap, Davison and Hinkley (1997).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calibration.laws.law_model import SIZE, LawModel
from calibration.laws.readings import EXPONENTS, INPUTS, logarithms
from calibration.statistics.fit import Fit
from calibration.statistics.gls import Gls, eliminated
from calibration.statistics.statistical_model import Parameter, changes, precisions, regression, stepped
from common.arrays import Flags, Floats, Integers

DRAWS = 999  # of the bootstrap
_AT_ONCE = 50  # draws
_PASSES = 3  # iterations for the scatter of the sessions
_MOST_VALUES = 12  # of an input; with more, neighbouring runs are put together
_FEWEST = 3  # groups that a power law may miss
_LEVEL = 0.1  # share of the next information below which the least one is not used for a picture
_SEEN = 1e-9  # share of the largest information below which a direction is not determined


@dataclass(frozen=True)
class GroupFactors:
    """What the runs at G values of an input ask for, and the test of the power law."""

    symbol: str  # of INPUTS
    x: Floats  # (G,) logarithm of the input, less that at the centre of the law
    centre: float  # logarithm of the input at the centre
    exponent: float  # of the law
    is_term: bool  # the load is that of the law times 1 + δ; else times exp(δ)
    shifts: Floats  # (G,) δ̂; of a factor, their mean is 0
    information: Floats  # (G, G) W, less because S is estimated
    statistic: float  # T
    p_value: float  # of T

    @property
    def inputs(self) -> Floats:
        """Values of the input, (G,): rad/s, m, or a number of tails."""
        return np.exp(self.x + self.centre)

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

    @property
    def errors(self) -> Floats:
        """One standard error of each shift, (G,)."""
        return np.sqrt(np.diag(np.linalg.pinv(self.information, rcond=_SEEN, hermitian=True)))


def along_load(model: LawModel, fitted: Fit) -> Floats:
    """Compute ∂f/∂ ln(load) of every run, (n, k)."""
    if model.place.is_term:
        return fitted.jacobian[..., fitted.names.index(SIZE)] * fitted.parameters[SIZE]
    columns = [power * fitted.jacobian[..., fitted.names.index(name)] for name, power in model.place.moves]
    return np.asarray(sum(columns))


def grouped(values: Floats) -> list[Flags]:
    """Put runs of equal value together, or of neighbouring values where there are many; (n,) each."""
    distinct, which = np.unique(values.round(6), return_inverse=True)
    if len(distinct) > _MOST_VALUES:
        edges = np.quantile(values, np.linspace(0, 1, _MOST_VALUES + 1)[1:-1])
        which = np.searchsorted(edges, values)
    return [which == group for group in np.unique(which)]


def group_factors(
    model: LawModel, fitted: Fit, used: Flags, *, seed: int = 0, draws: int = DRAWS, fewest: int = _FEWEST
) -> list[GroupFactors]:
    """Estimate the factors along each input whose exponent is fitted and which has enough values.

    Args:
        model: with a law.
        fitted: to the runs in `used`.
        used: (n,) runs.
        seed: of the bootstrap.
        draws: of the bootstrap; with 0 of them p is 1.
        fewest: values.
    """
    along = _linear_models(model, fitted, used, fewest)
    return [_estimated(linear, np.random.default_rng(seed), draws) for linear in along]


def gain_of_a_curve(model: LawModel, fitted: Fit, used: Flags) -> float:
    """Compute by how much free shifts along the best input lower the BIC of a law; −∞ if none can be tested."""
    values = model.runs.values(used)
    gains = [
        float(linear.gain(linear.as_given[None])[0]) - linear.contrasts.shape[1] * math.log(values)
        for linear in _linear_models(model, fitted, used)
    ]
    return max(gains, default=-math.inf)


def with_shifts(model: LawModel, fitted: Fit, used: Flags, symbol: str) -> Fit:
    """Refit a law with free shifts along an input, linearised; for a test of the residual of the runs in `used`.

    Args:
        symbol: the input, of those that `group_factors` returns.
    """
    (linear,) = [one for one in _linear_models(model, fitted, used) if INPUTS[one.place] == symbol]
    count, data = linear.contrasts.shape[1], model.runs
    columns = np.zeros((*fitted.prediction.shape, count))
    columns[used] = linear.load[..., None] * (linear.members @ linear.contrasts)[:, None]
    jacobian = np.concatenate([fitted.jacobian, columns], -1)
    shifts = tuple(Parameter(f"shift_{i}", "a shift", 0.0, (-np.inf, np.inf), 1.0) for i in range(count))
    shift = changes(fitted.fitted, fitted.parameters)
    products = regression(data, used, jacobian, (*fitted.fitted, *shifts)).products(
        (data.y - fitted.prediction)[used], fitted.noise.run, np.r_[shift, np.zeros(count)]
    )
    refit = products.solve(passes=_PASSES)
    step = refit.step
    moved = stepped(fitted.fitted, fitted.parameters, step[: len(shift)])
    return replace(
        fitted,
        parameters={**moved, **dict(zip((p.name for p in shifts), step[len(shift) :].tolist(), strict=True))},
        fitted=(*fitted.fitted, *shifts),
        names=(*fitted.names, *(p.name for p in shifts)),
        covariance=fitted.inflation * refit.covariance,
        freedom=np.r_[fitted.freedom, np.full(count, np.inf)],
        prediction=fitted.prediction + jacobian @ step,
        jacobian=jacobian,
        noise=replace(fitted.noise, share=refit.share),
    )


@dataclass(frozen=True)
class _LinearModel:
    """A law with free shifts along one input: n runs of k outputs, p other parameters."""

    model: LawModel
    fitted: Fit
    place: int  # of the input in INPUTS
    others: list[int]  # (p,) places of the other fitted parameters in the fit
    J: Floats  # (n, k, p)
    load: Floats  # (n, k) ∂f/∂ ln(load)
    x: Floats  # (n,)
    members: Floats  # (n, G) 1 where a run is in a group
    contrasts: Floats  # (G, G − 2) shifts that are no power law
    as_given: Floats  # (n, k) residual with the nuisance parameters as given
    session: Integers  # (n,)
    repeated: Integers | Floats  # see `Runs.repeats`
    scale: Floats  # (n,) roots of the weights of the runs

    @cached_property
    def middle(self) -> Floats:
        """Mean of x in each group, (G,)."""
        return (self.x @ self.members) / self.members.sum(0)

    @cached_property
    def tested(self) -> Gls:
        """The other parameters, the power law, and the contrasts."""
        return self.with_load(np.stack([np.ones_like(self.x), self.x], 1), self.members @ self.contrasts)

    def with_load(self, *factors: Floats) -> Gls:
        """Regress on the other parameters and on the load times factors (n, m) of the runs."""
        columns = [self.J, *(self.load[..., None] * each[:, None] for each in factors)]
        precision = precisions([self.fitted.fitted[i] for i in self.others])
        return Gls(np.concatenate(columns, -1), precision, self.session, self.scale, self.repeated)

    def gain(self, residual: Floats) -> Floats:
        """Compute T (B,) of residuals (B, n, k), each in its own S and ρ."""
        products = self.tested.products(residual)
        normal = products.at(products.share(passes=_PASSES))
        left = eliminated(normal, normal.shape[-1] - 1 - self.contrasts.shape[1])
        score = left[..., :-1, -1]
        return (score * np.linalg.solve(left[..., :-1, :-1], score[..., None])[..., 0]).sum(-1)


def _linear_models(model: LawModel, fitted: Fit, used: Flags, fewest: int = _FEWEST) -> list[_LinearModel]:
    """Make the linear model with free shifts along each input that can be tested."""
    x = logarithms(model.runs) - np.array(model.centre[: len(EXPONENTS)])
    return [
        _linear_model(model, fitted, used, place, x[used, place])
        for place, name in enumerate(EXPONENTS)
        if name in fitted.names and len(grouped(x[used, place])) >= fewest
    ]


def _linear_model(model: LawModel, fitted: Fit, used: Flags, place: int, x: Floats) -> _LinearModel:
    data = model.runs
    of_law = {SIZE, EXPONENTS[place]} if model.place.is_term else {EXPONENTS[place]}
    others = [i for i, name in enumerate(fitted.names) if name not in of_law]
    J = fitted.jacobian[used][..., others]
    members = np.stack(grouped(x), 1).astype(float)
    middle = (x @ members) / members.sum(0)
    shift = changes([fitted.fitted[i] for i in others], fitted.parameters)
    return _LinearModel(
        model=model,
        fitted=fitted,
        place=place,
        others=others,
        J=J,
        load=along_load(model, fitted)[used],
        x=x,
        members=members,
        contrasts=np.linalg.svd(np.stack([np.ones_like(middle), middle]))[2][2:].T,
        as_given=(data.y - fitted.prediction)[used] + J @ shift,
        session=data.session[used],
        repeated=data.repeats(used),
        scale=data.scale[used],
    )


def _estimated(linear: _LinearModel, rng: np.random.Generator, draws: int) -> GroupFactors:
    """Estimate the shifts along an input, and test the power law."""
    observed = float(linear.gain(linear.as_given[None])[0])
    null = np.empty(0)
    for first in range(0, draws, _AT_ONCE):
        share = np.tile(linear.fitted.noise.share, (min(_AT_ONCE, draws - first), 1))
        drawn = linear.tested.draw(rng, linear.fitted.noise.run, share)
        null = np.append(null, linear.gain(drawn))
    shifts, information = _shifts(linear)
    name = EXPONENTS[linear.place]
    return GroupFactors(
        symbol=INPUTS[linear.place],
        x=linear.middle,
        centre=float(linear.model.centre[linear.place]),
        exponent=linear.fitted.parameters[name],
        is_term=linear.model.place.is_term,
        shifts=shifts,
        information=information,
        statistic=observed,
        p_value=float((1 + np.count_nonzero(null >= observed)) / (1 + draws)),
    )


def _shifts(linear: _LinearModel) -> tuple[Floats, Floats]:
    """Estimate the shifts (G,), with their information W (G, G)."""
    products = linear.with_load(linear.members).products(linear.as_given, linear.fitted.noise.run)
    left = eliminated(products.at(products.share(passes=_PASSES)), len(linear.others))
    information, score = left[:-1, :-1], left[:-1, -1]
    if not linear.model.place.is_term:  # a factor that all groups have in common is free
        common = information.sum(1)
        whole = max(float(common.sum()), _SEEN * float(np.trace(information)))
        score = score - common * (score.sum() / whole)
        information = information - np.outer(common, common) / whole
    shifts = np.linalg.pinv(information, rcond=_SEEN, hermitian=True) @ score
    return shifts, information / linear.fitted.inflation
