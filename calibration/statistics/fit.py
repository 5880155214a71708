"""Generalised least squares of a forward model within bounds, each parameter on its own scale.

    least rᵀ W r over θ = (ln C_1, …, ε_1, …),   r = y − f(θ),   low ≤ θ ≤ high,

by steps of Levenberg (1944) with the model's own derivatives J, each the least squares of a linear model within
the bounds (Stark and Parker 1995, `scipy.optimize.lsq_linear`):

    least |W^½ (r − J s)|² + λ |D⁻¹ s|² over steps s,   low ≤ θ + s ≤ high.

W is Σ⁻¹ but for the mean of all sessions (`calibration.linear.gls`). D is 1 for ln C and a typical size for ε.
λ is 0, unless the step is too long or does not improve the fit; then the step is bent along the curvature of the
model. A parameter that the runs pull against a bound is *held* there: it is no direction of tests or of the
covariance, which is V = A⁻¹, A = JᵀWJ, of the others, times a factor because S is estimated (`variance_factor`).
Nuisance parameters have priors, which are rows of their own in A, in the residual and in the deviance. Intervals
are 95 %, by Student's t. The scatter ρ of a few sessions is uncertain, which limits the degrees of freedom
(Satterthwaite 1946):

    ν = 2 V² / Σ_a V′_a² Var ρ_a,   Var ρ_a ≈ 2 (ρ_a + 1/n)² / (s − 1),   n runs in each of s sessions.

V′_a is half of the derivative by ρ_a and half of its mean over the outputs, since half of each ρ_a is estimated
from all outputs (`calibration.linear.gls`).

A model along which errors add up, such as a path, may have a `rough` one: the same in a noise in which they do
not. A fit whose start leaves far more than noise begins with a fit of that one, and a model that still does so
after some steps is given up, as one with a `target`.

The deviance along one parameter, with the others refitted, may differ from a parabola. So `profile_intervals` runs
the model at both ends of the interval that the covariance gives. Each end moves to where the deviance, as a
parabola on its side, has risen by t². Here t is the quantile of `Fit.interval`. Where it rises by less than half
as much, or more than twice, the valley is bent, and the others are refitted at each end that is tried.

The pull of a nuisance parameter says how far the runs move it from its stated value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, lsq_linear
from scipy.special import stdtrit

from calibration.linear.gls import (
    Noise,
    NormalEquations,
    inverse_root,
    schur_complement,
    solve_normal,
)
from calibration.statistics.budget import limited_as_one, skipped, spent
from calibration.statistics.forward import derivatives
from calibration.statistics.statistical_model import (
    ForwardModel,
    Parameter,
    Parameters,
    apply_step,
    parameter,
    prior_offsets,
    regression,
)
from calibration.table.runs import Runs
from common.arrays import Flags, Floats
from common.errors import InputError

WRONG = 3.0  # pull beyond which a nuisance parameter is taken to be wrong
LEARNT = 0.02  # share of the prior's variance that the runs must remove before a pull means anything
_NOTHING = 0.01  # change in per cent, or in the unit in which it is shown, that is not stated
_STATED = 100.0  # change of a logarithm that is stated
_MOST_STEPS = 60
_STEPS_TO_TARGET = 25  # of a search that is above its target, or came to where the model cannot be solved quickly
_STEPS_FROM_NEAR = 14  # the same, where it begins near the solution, if there is one
_TRIED = 4  # steps before a search is given up
_SHORT = 0.1  # after a shorter step, in ln C or ε, the Jacobian is used once more
_SMALL = 0.01  # the iteration ends at a step that is expected to reduce rᵀ Σ⁻¹ r by less, over that of noise
_LARGEST = 0.7  # change of ln C in one step
_PASSES = 3  # iterations for the scatter of the sessions
_ESTIMATES = 4  # of that scatter in a search
_NEAR = 10.0  # a fit is near its solution if a step is expected to reduce rᵀ Σ⁻¹ r by less, over that of noise
_DAMPING = (0.0, *(10.0 ** (e / 2) for e in range(-6, 17)))  # λ; a step is up to √10 shorter than it may be
_FAR = 1.5  # rᵀ Σ⁻¹ r over that of noise, of a model that is wrong or a start that is far
_NEARER = 5  # starts that are tried
_PROBE = 0.1  # share of a step at which the curvature of the model is seen
_MOST_BENT = 0.375  # largest share of a step by which it is bent
_ON_BOUND = 1e-9  # distance in typical sizes
_BLIND = 1e-12  # share of the largest eigenvalue below which a combination of parameters shows nothing
_NEARLY_CERTAIN = 1e-6  # standard deviation of a parameter that is held, in typical sizes
_KEPT = 0.25  # share of the promised fall below which the next step is damped
_UNSETTLED = 1.0  # a fit has not converged if one more step is expected to reduce it by more, over that of noise
_ROUGH, _IDLE = 4.0, 8  # the same, where so many steps gained less than _UNSETTLED, since the model is rough
_BENDS = 0.01  # departure from a linear model, in the variance of the noise
_EXACT = 1e-12  # of a guessed variance: what runs without noise leave
_PROFILE = 0.05  # share of a size to which an end of its interval is found
_FLAT, _STEEP = 0.5, 2.0  # shares of the expected rise between which the deviance is a parabola
_ROUNDS = 2  # of looking for a lower minimum
_WIDER, _TRIES = 4.0, 4  # of an end in a bent valley: its distance over that by the covariance; fits


@dataclass(frozen=True)
class Pull:
    """What the runs say about one nuisance parameter, on its own scale."""

    parameter: Parameter  # the nuisance parameter
    change: float  # fitted, with its prior
    error: float  # standard error of `change`
    alone: float  # from the runs alone, with the other nuisance parameters as far as their priors allow
    alone_error: float  # standard error of `alone`
    z: float  # `change` over its standard deviation under noise
    freed: bool  # its prior was taken away

    @property
    def learnt(self) -> bool:
        """Whether the runs say anything about it."""
        assert self.parameter.sigma is not None
        return self.freed or self.error**2 < (1 - LEARNT) * self.parameter.sigma**2

    @property
    def wrong(self) -> bool:
        return self.learnt and abs(self.z) > WRONG

    @property
    def tolerances(self) -> float:
        """How many of its stated standard deviations it is off, by the runs alone."""
        assert self.parameter.sigma is not None
        return abs(self.alone) / self.parameter.sigma

    @property
    def words(self) -> str:
        """What the runs alone say, as in "E is 40 % below what was given (3.7 σ)"."""
        return f"{self.parameter.title} is {self.departure} ({abs(self.z):.1f} σ)"

    @property
    def departure(self) -> str:
        """How far it is from its value, by the runs alone, as in "40 % below what was given"."""
        given, change = self.parameter, self.alone
        size = abs(math.expm1(min(change, _STATED))) * 100 if given.logarithmic else abs(change) * given.shown
        if size < _NOTHING:
            return "what was given"
        unit, side = "%" if given.logarithmic else given.unit, "below" if change < 0 else "above"
        return f"{two_digits(size)} {unit} {side} what was given"


def two_digits(size: float) -> str:
    """Write a positive number with two significant digits, a large one without an exponent."""
    return f"{size:.2g}" if size < 99.5 else f"{size:.0f}"


class UnsolvedError(Exception):
    """A model with an effect that cannot be solved quickly, however small the effect."""


@dataclass(frozen=True)
class Fit:
    """A fitted model; arrays over all runs of the table, used or not."""

    model: ForwardModel
    parameters: dict[str, float]  # name -> fitted value
    fitted: tuple[Parameter, ...]  # in the order of the covariance
    names: tuple[str, ...]  # of these
    covariance: Floats  # (p, p) of (ln C, ε)
    repeats: float  # degrees of freedom of S
    inflation: float  # factor in the covariance, because S is estimated
    freedom: Floats  # (p,) degrees of freedom of the intervals
    prediction: Floats  # (n, k)
    jacobian: Floats  # (n, k, p)
    noise: Noise  # of runs and sessions
    deviance: float  # rᵀ Σ⁻¹ r + ln |Σ|/|S ⊗ I| over the fitted runs
    converged: bool  # the fit is at a minimum within the bounds
    held: Flags  # (p,) parameters that the runs pull against a bound
    full_normal: Floats  # (p + 1, p + 1) products at the end in W, with those that are held
    wrong_numbers: tuple[tuple[Pull, ...], ...] = ()  # the first of each has lost its prior; see `fit`
    tested: tuple[Floats, Floats] = (np.empty(0), np.empty(0))  # changes of the nuisance parameters from their
    # values as given, and variances, by least squares in Σ, as tests have them; (p,)
    stopped: bool = False  # the search ended because no time was left
    far: bool = False  # it leaves far more than noise, so it may have ended anywhere along a valley

    @property
    def tangents(self) -> Floats:
        """Derivatives (n, k, p) of what is free: zero along parameters that are held."""
        return np.where(self.held, 0.0, self.jacobian) if self.held.any() else self.jacobian

    def half_width(self, place: int) -> float:
        """Compute half of the 95 % interval of a parameter that is free, on its own scale."""
        return float(stdtrit(self.freedom[place], 0.975)) * math.sqrt(self.covariance[place, place])

    def interval(self, name: str, variance_ratio: float = 1.0) -> tuple[float, float]:
        """Compute the 95 % interval of a parameter; of one that is held, it ends at the bound.

        Args:
            variance_ratio: by which the variance of the noise exceeds that of the fit.
        """
        place = self.names.index(name)
        p, value = self.fitted[place], self.parameters[name]
        if self.held[place]:
            inside = p.moved(value, self._inward(place, variance_ratio))
            return min(inside, value), max(inside, value)
        half = math.sqrt(variance_ratio) * self.half_width(place)
        return float(p.changed(value, -half)), float(p.changed(value, half))

    def risen(self, name: str) -> float:
        """Return by how much the deviance has risen at the ends of the 95 % interval of a parameter."""
        return self.inflation * float(stdtrit(self.freedom[self.names.index(name)], 0.975)) ** 2

    def _inward(self, place: int, variance_ratio: float) -> float:
        """Compute the step from a bound at which rᵀ W r has risen by t², the others refitted: 2 |g| δ + a δ²."""
        others = [i for i in np.flatnonzero(~self.held).tolist() if i != place]
        order = [*others, place, -1]
        left = schur_complement(self.full_normal[np.ix_(order, order)], len(others))
        a, g = float(left[0, 0]), float(left[0, 1])
        risen = variance_ratio * self.risen(self.names[place])
        return -math.copysign((math.sqrt(g**2 + max(a, 1e-300) * risen) - abs(g)) / max(a, 1e-300), g)

    def products(self, runs: Runs, rows: Flags, run_covariance: Floats | None = None) -> NormalEquations:
        """Multiply the derivatives and the residual of the runs in `rows` (n,), with the priors, in an S."""
        residual = (runs.y - self.prediction)[rows]
        linear = regression(runs, rows, self.tangents, self.fitted)
        run_covariance = self.noise.run_covariance if run_covariance is None else run_covariance
        return linear.products(residual, run_covariance, prior_offsets(self.fitted, self.parameters))

    def refitted(self, runs: Runs, rows: Flags, *, for_test: bool = False) -> Fit:
        """Fit again to the runs in `rows` (n,): by one linear step, unless the model is not linear along it.

        For a test it is one linear step of least squares in Σ.
        """
        products = self.products(runs, rows)
        refit = products.solve(passes=_PASSES)
        normal, covariance = products.for_fit(refit.session_ratio)[0], refit.covariance
        if for_test:
            normal = products.at(refit.session_ratio)
            covariance = solve_normal(normal)[1]
        step = bounded_step(self.fitted, self.parameters, normal).change
        parameters, prediction = (
            apply_step(self.fitted, self.parameters, step),
            self.prediction + self.tangents @ step,
        )
        if not for_test and self._bends(parameters, prediction):
            with suppress(UnsolvedError, InputError):
                return self.refitted_fully(rows)
        return replace(
            self,
            parameters=parameters,
            prediction=prediction,
            covariance=self.inflation * certain_where_held(covariance, self.held, self.fitted),
        )

    def refitted_fully(self, rows: Flags) -> Fit:
        """Fit again to the runs in `rows` (n,) in the same S, from where this fit ended.

        Raises:
            UnsolvedError, InputError: the model cannot be solved on the way.
        """
        return _refit(self, self.parameters, self.names, rows)

    def _bends(self, parameters: Parameters, linear: Floats) -> bool:
        """Tell whether the model departs from a linear prediction (n, k) by what the noise would show."""
        actual = derivatives(self.model, parameters, [], quick=True)[0]
        white = (actual - linear) @ inverse_root(self.noise.run_covariance).T
        return bool(np.mean(white**2) > _BENDS)

    def normal(self, runs: Runs, rows: Flags) -> Floats:
        """Return them in the noise of the fit, (p + 1, p + 1)."""
        return self.products(runs, rows).at(self.noise.session_ratio)

    def normal_of_fit(self, runs: Runs, rows: Flags, noise: Noise | None = None) -> Floats:
        """Return them with the weights of a fit, (p + 1, p + 1); default: in the noise of this one."""
        noise = noise or self.noise
        return self.products(runs, rows, noise.run_covariance).for_fit(noise.session_ratio)[0]


def fit(
    model: ForwardModel,
    start: Parameters,
    names: tuple[str, ...],
    used: Flags,
    *,
    wrong_numbers: tuple[tuple[Pull, ...], ...] = (),
    target: float = math.inf,
    in_sigma: bool = False,
    estimated: tuple[Floats, float] | None = None,
    title: str = "fit",
) -> Fit:
    """Fit `names` to the runs in `used` (n,), starting at `start`; other parameters stay.

    Args:
        target: of rᵀ Σ⁻¹ r. Where the steps that are left cannot reach it, the search ends before it converges.
        wrong_numbers: nuisance parameters that are wrong, each followed by those that may be wrong in its place;
            the first of each is fitted without its prior.
        in_sigma: fit with the weights of tests, Σ⁻¹. A common misfit bends such a fit less, so what is missing is
            found more easily near it.
        estimated: S (k, k) with its degrees of freedom; default: of the runs in `used`.

    Raises:
        UnsolvedError: the model cannot be solved quickly with the effects among `names`, however small.
    """
    data = model.runs
    freed = {alike[0].parameter.name for alike in wrong_numbers}
    fitted = tuple(parameter(model, name) for name in names)
    fitted = tuple(replace(p, sigma=None) if p.name in freed else p for p in fitted)
    run_covariance, repeats = estimated or data.noise(used)
    problem = _Problem(model, fitted, used, run_covariance, in_sigma, title)
    with limited_as_one():
        point = problem.first(dict(start))
        search = _Search(target)
        if rough := getattr(model, "rough", None):
            if not estimated and problem.above(point) > 0:
                point = _nearer(problem, point, rough)
            search = _Search(min(target, problem.far), steps=_STEPS_FROM_NEAR)
        point, session_ratio, at_rest = _descend(problem, point, search)
        stopped = spent()
    at_end = problem.normal(point, session_ratio)
    ahead = bounded_step(fitted, point.parameters, at_end)
    free = np.where(ahead.held, 0.0, point.derivative)
    residual = (data.y - point.prediction)[used]
    products = regression(data, used, free, fitted).products(
        residual, run_covariance, prior_offsets(fitted, point.parameters)
    )
    linear = products.solve(passes=_PASSES)
    normal = products.at(linear.session_ratio)
    step, spread = solve_normal(normal)
    nuisances = {p.name for p in model.nuisances}
    offsets = [p.offset(point.parameters[p.name]) if p.name in nuisances else 0.0 for p in fitted]
    inflation = variance_factor(repeats, len(run_covariance))
    return Fit(
        model=model,
        parameters=point.parameters,
        fitted=fitted,
        names=names,
        covariance=inflation * certain_where_held(linear.covariance, ahead.held, fitted),
        repeats=repeats,
        inflation=inflation,
        freedom=_freedom(products, linear.session_ratio, len(names)),
        prediction=point.prediction,
        jacobian=point.derivative,
        noise=Noise(run_covariance, linear.session_ratio),
        deviance=float(normal[-1, -1] + products.determinant(linear.session_ratio)),
        converged=ahead.promise < (_ROUGH if at_rest else _UNSETTLED) * problem.noise_level(at_end),
        held=ahead.held,
        full_normal=point.products.for_fit(linear.session_ratio)[0],
        wrong_numbers=wrong_numbers,
        tested=(np.array(offsets) + step, np.diag(certain_where_held(spread, ahead.held, fitted))),
        stopped=stopped,
        far=problem.above(point) > 0,
    )


def certain_where_held(covariance: Floats, held: Flags, fitted: Sequence[Parameter]) -> Floats:
    """Return a covariance (p, p) in which parameters that are held are known nearly exactly."""
    free = np.where(held[:, None] | held, 0.0, covariance)
    return free + np.diag(np.where(held, (_NEARLY_CERTAIN * typical_sizes(fitted)) ** 2, 0.0))


def typical_sizes(fitted: Sequence[Parameter]) -> Floats:
    """Return the typical size of each parameter on its own scale, (p,)."""
    return np.array([1.0 if p.logarithmic else abs(p.typical) for p in fitted])


@dataclass(frozen=True)
class _Point:
    """The model at the present parameters of the search."""

    parameters: dict[str, float]
    prediction: Floats  # (n, k)
    derivative: Floats  # (n, k, p), at these parameters or near them
    products: NormalEquations  # of the derivatives and the residual

    @property
    def solved(self) -> bool:
        return bool(np.isfinite(self.prediction).all() and np.isfinite(self.derivative).all())


@dataclass(frozen=True)
class _Problem:
    """The model, the runs, and the parameters to fit."""

    model: ForwardModel
    fitted: tuple[Parameter, ...]
    used: Flags
    run_covariance: Floats
    in_sigma: bool
    title: str

    def normal(self, point: _Point, session_ratio: Floats) -> Floats:
        """Return the products of a point with the weights of the fit, (p + 1, p + 1)."""
        return self.weighted(point.products, session_ratio)

    def weighted(self, products: NormalEquations, session_ratio: Floats) -> Floats:
        """Return products with the weights of the fit, (p + 1, p + 1)."""
        return products.at(session_ratio) if self.in_sigma else products.for_fit(session_ratio)[0]

    def noise_level(self, normal: Floats) -> float:
        """Compute rᵀ W r over its degrees of freedom: by so much may it change before anything is learnt.

        Where the noise is known, it is 1 at least.
        """
        runs = self.model.runs
        level = float(normal[-1, -1]) / max(runs.values(self.used) - len(self.fitted), 1)
        return max(level, 1.0 if runs.noise_known else _EXACT)

    @property
    def far(self) -> float:
        """A value of rᵀ W r that noise does not reach."""
        return _FAR * self.model.runs.values(self.used)

    def above(self, point: _Point) -> float:
        """Compute by how much rᵀ W r is above `far`; infinite where the model is not solved."""
        normal = self.normal(point, point.products.session_ratio(passes=0))
        return float(normal[-1, -1]) - self.far if point.solved else math.inf

    def first(self, parameters: dict[str, float]) -> _Point:
        """Run the model at the start; effects move towards their null while it cannot be solved quickly there."""
        tried, effects = dict(parameters), self.effects
        for _ in range(_NEARER if effects else 1):
            point = self.at(tried, None, 1)
            if point.solved:
                return point
            if spent():
                break
            tried.update({p.name: (tried[p.name] + p.start) / 2 for p in effects})
        if effects:
            raise UnsolvedError
        return self.at(parameters, None, 1, quick=False)

    @property
    def effects(self) -> list[Parameter]:
        """Those of the parameters that are effects."""
        return [p for p in self.fitted if p.name in {e.name for e in self.model.effects}]

    def at(
        self, parameters: dict[str, float], derivative: Floats | None = None, count: int = 1, *, quick: bool = True
    ) -> _Point:
        """Run the model at `parameters`; its derivatives are computed if none are given."""
        title = f"{self.title}, step {count}" if self.title else ""
        if derivative is None:
            prediction, derivative = derivatives(self.model, parameters, self.fitted, title=title, quick=quick)
        else:
            prediction = derivatives(self.model, parameters, [], title=title, quick=quick)[0]
        residual = (self.model.runs.y - prediction)[self.used]
        products = self.products(derivative, residual, prior_offsets(self.fitted, parameters))
        return _Point(parameters, prediction, derivative, products)

    def products(self, derivative: Floats, residual: Floats, offsets: Floats | None = None) -> NormalEquations:
        """Multiply derivatives (n, k, p) and a residual (n', k), with the priors of parameters `offsets` off."""
        return regression(self.model.runs, self.used, derivative, self.fitted).products(
            residual, self.run_covariance, offsets
        )

    def bent(self, point: _Point, session_ratio: Floats, step: _FitStep) -> _FitStep:
        """Bend a damped step along the curvature of the model, by two more predictions: it stays in a bent valley.

        Source: geodesic acceleration, Transtrum and Sethna (2012).
        """

        def beside(share_of_step: float) -> Floats:
            there = apply_step(self.fitted, point.parameters, share_of_step * step.change)
            return derivatives(self.model, there, [], quick=True)[0]

        curvature = (beside(_PROBE) + beside(-_PROBE) - 2 * point.prediction) / _PROBE**2
        if not np.isfinite(curvature).all():
            return step
        normal = self.weighted(self.products(point.derivative, -curvature[self.used] / 2), session_ratio)
        further = bounded_step(self.fitted, step.parameters, _damped(self.fitted, normal, step.damping)).change
        turn, length = (np.linalg.norm(c / typical_sizes(self.fitted)) for c in (further, step.change))
        if turn > _MOST_BENT * length:
            return step
        return step._replace(parameters=apply_step(self.fitted, step.parameters, further))


class _FitStep(NamedTuple):
    change: Floats  # (p,)
    parameters: dict[str, float]  # after it
    promise: float  # by how much it reduces rᵀ Σ⁻¹ r if the model is linear
    damping: int  # place of its λ in _DAMPING


class _Search(NamedTuple):
    """When a search ends."""

    target: float = math.inf  # of rᵀ W r; it ends where the steps that are left cannot reach it
    steps: int = _STEPS_TO_TARGET  # to the target
    small: float = _SMALL  # promise of a step, over rᵀ W r of noise


def _nearer(problem: _Problem, point: _Point, rough: ForwardModel) -> _Point:
    """Return a point near the minimum of a rough model, where it fits better than a point does."""
    roughly = replace(problem, model=rough)
    begin = roughly.at(point.parameters, None, 1, quick=bool(problem.effects))
    if not begin.solved:
        return point
    end = _descend(roughly, begin, _Search(small=_NEAR))[0]
    return min(point, problem.at(end.parameters), key=problem.above)


def _descend(problem: _Problem, point: _Point, search: _Search) -> tuple[_Point, Floats, bool]:
    """Find the least rᵀ W r from `point`, and its ρ. A step to where the model is not solved quickly is too long.

    The last value tells whether the search is at rest: steps of several lengths have gained next to nothing.

    A wrong model crawls along a bent valley far above the noise. The search ends there as soon as all steps that
    are left, with what the present one promises, would not come down to its target.
    """
    fitted = problem.fitted
    least, kept = 0, False  # place of the least damping allowed; whether the derivatives are of another point
    refused = False  # whether the step before did not improve the fit
    solved = True  # whether the model could be solved wherever it was tried
    session_ratio, estimates = point.products.session_ratio(passes=0), 0
    reached: list[float] = []  # rᵀ W r before each step
    for count in range(1, _MOST_STEPS + 1):
        normal = problem.normal(point, session_ratio)
        step = _step(fitted, point.parameters, normal, least)
        # The scatter of the sessions comes from the residuals of the fit, but only near the solution: far from it
        # every session looks shifted, and with a large ρ the search would stop there. It settles, or is kept.
        if estimates < _ESTIMATES and step.promise < _NEAR * problem.noise_level(normal) and count > 1:
            session_ratio, estimates = point.products.session_ratio(passes=_PASSES), estimates + 1
            normal = problem.normal(point, session_ratio)
            step = _step(fitted, point.parameters, normal, least)
        small = _SMALL * problem.noise_level(normal)
        reached.append(float(normal[-1, -1]))
        if step.promise < search.small * problem.noise_level(normal) and count > 1:
            break
        above = float(normal[-1, -1]) - search.target
        if count > _TRIED and (search.steps - count) * step.promise < above:
            break
        if (count > _STEPS_TO_TARGET and not solved) or skipped("more steps of some fits"):
            break
        in_valley = step.damping > 0 and count > _TRIED and solved  # elsewhere to bend costs more than it gains
        if in_valley:
            step = problem.bent(point, session_ratio, step)
        short = not in_valley and bool(np.abs(step.change).max() <= _SHORT)
        doubtful = not short and (refused or not solved)  # its derivatives follow where it is not refused as well
        tried = problem.at(step.parameters, point.derivative if short or doubtful else None, count + 1)
        fall = float(normal[-1, -1] - problem.normal(tried, session_ratio)[-1, -1])
        if doubtful and tried.solved and fall > -small:
            tried = problem.at(step.parameters, None, count + 1)
        solved = solved and tried.solved
        if tried.solved and fall > -small:
            # A step that keeps little of its promise overshoots, and the next one is damped (Marquardt 1963).
            least = step.damping + 1 if fall < _KEPT * step.promise else max(step.damping - 2, 0)
            least = min(least, len(_DAMPING) - 1)
            point, kept, refused = tried, short, False
        elif kept:
            again = problem.at(point.parameters, None, count + 1, quick=bool(problem.effects))
            if not again.solved:
                break
            point, kept = again, False
        else:
            least, refused = max(step.damping + 1 + refused, 2), True  # each costs as much as one that does
            if least >= len(_DAMPING):
                break
    gained = reached[-_IDLE] - reached[-1] if len(reached) > _IDLE else math.inf
    return point, session_ratio, solved and gained < _UNSETTLED * problem.noise_level(normal)


def _step(fitted: tuple[Parameter, ...], parameters: dict[str, float], normal: Floats, least: int) -> _FitStep:
    """Compute a step from `parameters`, with a λ at the place `least` of _DAMPING or behind it."""
    for place in range(least, len(_DAMPING)):
        change = bounded_step(fitted, parameters, _damped(fitted, normal, place)).change
        if all(abs(c) <= _LARGEST for c, p in zip(change, fitted, strict=True) if p.logarithmic):
            break
    return _FitStep(change, apply_step(fitted, parameters, change), _promise(change, normal), place)


def _damped(fitted: Sequence[Parameter], normal: Floats, place: int) -> Floats:
    """Add the λ at a place of _DAMPING to normal equations (p + 1, p + 1)."""
    return normal + np.diag(np.append(_DAMPING[place] / typical_sizes(fitted) ** 2, 0.0))


def _promise(change: Floats, normal: Floats) -> float:
    """Compute by how much a change (p,) reduces rᵀ Σ⁻¹ r if the model is linear."""
    return float(2 * change @ normal[:-1, -1] - change @ normal[:-1, :-1] @ change)


class BoundedStep(NamedTuple):
    """The step to the least rᵀ Σ⁻¹ r of a linear model within the bounds."""

    change: Floats  # (p,) on the scales of the parameters
    promise: float  # by how much it reduces rᵀ Σ⁻¹ r
    held: Flags  # (p,) parameters that are on a bound, and would cross it


def bounded_step(fitted: Sequence[Parameter], parameters: Parameters, normal: Floats) -> BoundedStep:
    """Minimise the quadratic form of normal equations (p + 1, p + 1), from `parameters`, within the bounds.

    Source: bounded-variable least squares, Stark and Parker (1995).
    """
    scale = np.sqrt(np.maximum(np.diag(normal)[:-1], 1e-300))
    values, vectors = np.linalg.eigh(normal[:-1, :-1] / np.outer(scale, scale))
    seen = values > _BLIND * values.max(initial=0.0)
    root = np.sqrt(values[seen])[:, None] * vectors[:, seen].T
    right = vectors[:, seen].T @ (normal[:-1, -1] / scale) / np.sqrt(values[seen])
    low, high = room(fitted, parameters)
    solved = lsq_linear(root, right, (low * scale, high * scale), method="bvls")
    change = solved.x / scale
    on_bound = np.minimum(-low, high) < _ON_BOUND * typical_sizes(fitted)
    return BoundedStep(change, _promise(change, normal), on_bound & (solved.active_mask != 0))


def room(fitted: Sequence[Parameter], parameters: Parameters) -> tuple[Floats, Floats]:
    """Compute how far parameters are from their bounds, on their scales: (p,) below 0, and above."""
    with np.errstate(divide="ignore"):  # the logarithm of a bound at 0
        ends = np.sort([p.change(parameters[p.name], np.array(p.bounds)) for p in fitted], axis=-1)
    return ends[:, 0], ends[:, 1]


def birge(runs: Runs, fitted: Fit, used: Flags) -> float:
    """Compute the factor by which the variance of what a fit leaves exceeds that of the noise, at least 1.

    Where the noise is unknown, what the fit leaves is all that is known of it, and the factor may be below 1.
    Source: Birge (1932).
    """
    priors = sum(p.sigma is not None for p in fitted.fitted)
    freedom = runs.values(used) + priors - len(fitted.names)
    ratio = float(fitted.normal(runs, used)[-1, -1]) / max(freedom, 1)
    return max(1.0 if runs.noise_known else _EXACT, ratio)


def variance_factor(repeats: float, outputs: int) -> float:
    """Compute the factor by which the variance is larger because S is estimated from ν repeats of k outputs.

    ν/(ν − k − 1), because 1/S is overestimated, times 1 + (k − 1)/(ν − k), because its weights are not optimal.
    """
    if math.isinf(repeats):
        return 1.0
    if repeats <= outputs + 1:
        return 2.0 * repeats
    return repeats / (repeats - outputs - 1) * (1 + (outputs - 1) / (repeats - outputs))


def _freedom(products: NormalEquations, session_ratio: Floats, count: int) -> Floats:
    """Estimate the degrees of freedom of the parameters' variances, (p,)."""
    least = 1 / max(products.sizes.mean(), 1.0)
    steps = 0.01 * session_ratio + 1e-3 * least
    session_ratios = np.vstack([session_ratio, session_ratio + np.diag(steps)])
    variances = [np.diag(products.covariance(s))[:count] for s in session_ratios]
    V, *near = np.maximum(variances, 1e-100)
    slopes = (np.array(near) - V) / steps[:, None]
    error = math.sqrt(2 / max(products.sessions - 1, 1)) * np.where(products.estimated, session_ratio + least, 0.0)
    variance = (((slopes + slopes.mean(0)) / 2 * error[:, None]) ** 2).sum(0)
    return np.asarray(np.clip(2 * V**2 / np.maximum(variance, 1e-12 * V**2), 1.0, 1e6))


def profile_intervals(
    model: ForwardModel, fitted: Fit, used: Flags, *, in_valleys: bool = True, title: str = ""
) -> dict[str, tuple[float, float]]:
    """Compute the 95 % interval of every fitted parameter, by its profile deviance; by the covariance of nuisance
    parameters, of numbers of a group's own, and of what is held at a bound.

    Args:
        in_valleys: refit the others where the deviance is no parabola.
    """
    data, count = model.runs, len(fitted.names)
    nuisances = {p.name for p in model.nuisances}
    along = solve_normal(fitted.normal_of_fit(data, used))[1]
    sets, ends = [], []
    for i, p in enumerate(fitted.fitted):
        if (p.sigma is not None and p.name in nuisances) or p.of_group or fitted.held[i]:
            continue
        half = fitted.half_width(i)
        for side in (-1, 1):
            change = float(p.change(fitted.parameters[p.name], p.moved(fitted.parameters[p.name], side * half)))
            sets.append(apply_step(fitted.fitted, fitted.parameters, along[i] / along[i, i] * change))
            ends.append((i, change))
    predictions = model.predict(sets, title=title)
    least = _deviance(fitted, data, used, list(range(count)))
    intervals: dict[str, list[float]] = {}
    for (i, change), parameters, prediction in zip(ends, sets, predictions, strict=True):
        others = [j for j in range(count) if j != i]
        end_of = replace(fitted, parameters=parameters, prediction=prediction)
        rise, expected = _deviance(end_of, data, used, others) - least, change**2 / along[i, i]
        p = fitted.fitted[i]
        if _FLAT * expected < rise < _STEEP * expected or not (others and in_valleys):
            change *= math.sqrt(expected / np.clip(rise, _FLAT * expected, None))
        else:
            change = _end_in_valley(fitted, parameters, p, change, expected, used)
        intervals.setdefault(p.name, []).append(float(p.moved(fitted.parameters[p.name], change)))
    by_profile = {name: (low, high) for name, (low, high) in intervals.items()}
    return {name: by_profile.get(name) or fitted.interval(name) for name in fitted.names}


def _end_in_valley(
    fitted: Fit, near: Parameters, p: Parameter, change: float, expected: float, used: Flags
) -> float:
    """Find the change of a parameter at which the deviance has risen as expected, the others refitted at each try.

    Args:
        near: parameters close to those at `change`.
        change: by the covariance; the end that is found is at most _WIDER times as far away.
    """
    others, last = tuple(name for name in fitted.names if name != p.name), dict(near)
    most = _WIDER * abs(change)
    for _ in range(_TRIES):
        last |= {p.name: float(p.moved(fitted.parameters[p.name], change))}
        try:
            at_end = _refit(fitted, last, others, used)
        except (UnsolvedError, InputError):
            break
        rise, last = at_end.deviance - fitted.deviance, dict(at_end.parameters)
        step = math.sqrt(expected / np.clip(rise, _FLAT**2 * expected, _STEEP**4 * expected))
        change = math.copysign(min(abs(change) * step, most), change)
        if _FLAT * expected < rise < _STEEP * expected:
            break
    return change


def beyond_its_ends(fitted: Fit, used: Flags) -> Fit:
    """Look for a lower minimum where coefficients are at both ends of what the runs determine worst.

    A bent valley may have several, of which a search finds the nearest.
    """
    coefficients = {p.name for p in fitted.model.coefficients}
    places = [i for i, p in enumerate(fitted.fitted) if p.name in coefficients and not fitted.held[i]]
    for _ in range(_ROUNDS if places else 0):
        values, vectors = np.linalg.eigh(fitted.covariance[np.ix_(places, places)])
        along = fitted.covariance[:, places] @ vectors[:, -1] / values[-1]
        half = float(stdtrit(fitted.freedom[places].min(), 0.975)) * math.sqrt(values[-1])
        worst = fitted.names[places[int(np.argmax(np.abs(vectors[:, -1])))]]
        others = tuple(name for name in fitted.names if name != worst)
        ends = [apply_step(fitted.fitted, fitted.parameters, side * half * along) for side in (-1, 1)]
        again = []
        for end in ends:
            with suppress(UnsolvedError, InputError):  # the model breaks down there
                if _lower(fitted, end, used):
                    again.append(_refit(fitted, _refit(fitted, end, others, used).parameters, fitted.names, used))
        best = min(again, key=lambda one: one.deviance, default=fitted)
        if best.deviance > fitted.deviance - _SMALL:
            break
        fitted = best
    return fitted


def _refit(fitted: Fit, start: Parameters, names: tuple[str, ...], rows: Flags) -> Fit:
    """Fit some of the parameters to the runs in `rows` (n,) in the same S."""
    estimated, numbers = (fitted.noise.run_covariance, fitted.repeats), fitted.wrong_numbers
    return fit(fitted.model, start, names, rows, wrong_numbers=numbers, estimated=estimated, title="")


def _lower(fitted: Fit, parameters: Parameters, used: Flags) -> bool:
    """Tell whether one linear step from other parameters leads below a fit."""
    data, every = fitted.model.runs, list(range(len(fitted.names)))
    (prediction,) = fitted.model.predict([parameters])
    there = replace(fitted, parameters=dict(parameters), prediction=prediction)
    return _deviance(there, data, used, every) < _deviance(fitted, data, used, every)


def profile_end(
    model: ForwardModel, fitted: Fit, name: str, used: Flags, variance_ratio: float = 1.0
) -> float | None:
    """Find the end of the 95 % interval of an effect between its null and its size, with all others fitted again.

    None where the null is inside. Along a bent valley the covariance and a parabola through its ends say nothing.

    Args:
        variance_ratio: by which the variance of the noise exceeds that of the fit.
    """
    effect, size = parameter(model, name), fitted.parameters[name]
    others = tuple(n for n in fitted.names if n != name and n != (effect.second.name if effect.second else ""))
    risen = variance_ratio * fitted.risen(name)
    last = fitted

    def above(value: float) -> float:
        nonlocal last
        start = {**last.parameters, name: value}
        target = fitted.deviance + 2 * risen
        last = fit(model, start, others, used, wrong_numbers=fitted.wrong_numbers, target=target, title="")
        return last.deviance - fitted.deviance - risen

    try:
        if above(effect.start) <= 0:
            return None
        last = fitted
        return float(brentq(above, effect.start, size, xtol=_PROFILE * abs(size - effect.start), rtol=_PROFILE))
    except (UnsolvedError, InputError, ValueError):
        return None


def _deviance(fitted: Fit, data: Runs, used: Flags, others: list[int]) -> float:
    """Compute rᵀ Σ⁻¹ r with those parameters of `others` refitted (linearised), in the noise of the fit."""
    normal = fitted.normal_of_fit(data, used)[np.ix_([*others, -1], [*others, -1])]
    return float(schur_complement(normal, len(others))[0, 0])


def is_free_logarithm(parameter: Parameter) -> bool:
    """Tell whether all runs share a number that is fitted as its logarithm, without a prior."""
    return parameter.logarithmic and parameter.sigma is None and not parameter.of_group


def least_determined(fitted: Fit) -> tuple[dict[str, float], float]:
    """Find the direction in the coefficients, as logarithms, that the runs determine worst.

    Returns:
        The direction, a unit vector by name, largest component positive; and the standard deviation along it.
    """
    places = [i for i, p in enumerate(fitted.fitted) if is_free_logarithm(p)]
    values, vectors = np.linalg.eigh(fitted.covariance[np.ix_(places, places)])
    vector = vectors[:, -1] * np.sign(vectors[np.argmax(np.abs(vectors[:, -1])), -1])
    direction = {fitted.fitted[i].name: part for i, part in zip(places, vector.tolist(), strict=True)}
    return direction, float(np.sqrt(values[-1]))
