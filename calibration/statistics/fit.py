"""Generalised least squares of a forward model, each parameter on its own scale.

Steps of Levenberg (1944) with the model's own derivatives:

    θ ← θ + (A + λ D⁻²)⁻¹ JᵀΣ⁻¹ (y − f(θ)),   A = JᵀΣ⁻¹J,   θ = (ln C_1, …, ε_1, …),

D is 1 for ln C and a typical size for ε. λ is 0, unless the step is too long or does not improve the fit. A
parameter at a bound stays there if the step would lead out. The covariance of the parameters is V = A⁻¹, times a
factor because S is estimated (`_inflation`). Nuisance parameters have priors, which are rows of their own in
A, in the residual and in the deviance. Intervals are 95 %, by Student's t. The scatter ρ of a few sessions is
uncertain, which limits the degrees of freedom (Satterthwaite 1946):

    ν = 2 V² / Σ_a V′_a² Var ρ_a,   Var ρ_a ≈ 2 (ρ_a + 1/n)² / (s − 1),   n runs in each of s sessions.

V′_a is half of the derivative by ρ_a and half of its mean over the outputs, since half of each ρ_a is estimated
from all outputs (`calibration.statistics.gls`).

The deviance along one parameter, with the others refitted, may differ from a parabola. So `profile_intervals` runs
the model at both ends of the interval that the covariance gives. Each end moves to where the deviance, as a
parabola on its side, has risen by t². Here t is the quantile of `Fit.interval`.

The pull of a nuisance parameter says how far the runs move it from its stated value.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from calibration.statistics.budget import limited_as_one, skipped, spent
from calibration.statistics.forward import derivatives
from calibration.statistics.gls import (
    Noise,
    NormalEquations,
    schur_complement,
    solve_normal,
)
from calibration.statistics.statistical_model import (
    ForwardModel,
    Parameter,
    Parameters,
    Runs,
    apply_step,
    parameter,
    prior_offsets,
    regression,
)
from common.arrays import Flags, Floats

WRONG = 3.0  # pull beyond which a nuisance parameter is taken to be wrong
LEARNT = 0.02  # share of the prior's variance that the runs must remove before a pull means anything
_NOTHING = 0.01  # change in per cent, or in the unit in which it is shown, that is not stated
_STATED = 100.0  # change of a logarithm that is stated
_MOST_STEPS = 25
_TRIED = 4  # steps before a search is given up
_SHORT = 0.1  # after a shorter step, in ln C or ε, the Jacobian is used once more
_SMALL = 0.01  # the iteration ends at a step that is expected to reduce rᵀ Σ⁻¹ r by less
_LARGEST = 0.7  # change of ln C in one step
_PASSES = 3  # iterations for the scatter of the sessions
_DAMPING = (0.0, *(10.0 ** (e / 2) for e in range(-6, 17)))  # λ; a step is up to √10 shorter than it may be
_NEARER = 5  # starts that are tried
_KEPT = 0.25  # share of the promised fall below which the next step is damped
_UNSETTLED = 1.0  # a fit has not converged if one more step is expected to reduce rᵀ Σ⁻¹ r by more
_FLAT = 0.05  # share of the expected rise; if the rise is smaller, the deviance is flat and the end stays
_STEEP = 5.0  # if it is larger, the others were not refitted along a bent valley, and the end stays


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

    parameters: dict[str, float]  # name -> fitted value
    fitted: tuple[Parameter, ...]  # in the order of the covariance
    names: tuple[str, ...]  # of these
    covariance: Floats  # (p, p) of (ln C, ε)
    inflation: float  # factor in the covariance, because S is estimated
    freedom: Floats  # (p,) degrees of freedom of the intervals
    prediction: Floats  # (n, k)
    jacobian: Floats  # (n, k, p)
    noise: Noise  # of runs and sessions
    deviance: float  # rᵀ Σ⁻¹ r + ln |Σ|/|S ⊗ I| over the fitted runs
    converged: bool  # the fit is at a minimum, or at one within the bounds
    wrong_numbers: tuple[tuple[Pull, ...], ...] = ()  # the first of each has lost its prior; see `fit`
    tested: tuple[Floats, Floats] = (np.empty(0), np.empty(0))  # changes of the nuisance parameters from their
    # values as given, and variances, by least squares in Σ, as tests have them; (p,)
    stopped: bool = False  # the search ended because no time was left

    def half_width(self, place: int) -> float:
        """Compute half of the 95 % interval of a parameter, on its own scale."""
        return float(student.ppf(0.975, self.freedom[place])) * math.sqrt(self.covariance[place, place])

    def interval(self, name: str) -> tuple[float, float]:
        """Compute the 95 % interval of a parameter."""
        value = self.parameters[name]
        place = self.names.index(name)
        half = self.half_width(place)
        if self.fitted[place].logarithmic:
            return value * math.exp(-half), value * math.exp(half)
        return value - half, value + half

    def products(self, runs: Runs, rows: Flags, run: Floats | None = None) -> NormalEquations:
        """Multiply the derivatives and the residual of the runs in `rows` (n,), with the priors, in an S."""
        residual = (runs.y - self.prediction)[rows]
        linear = regression(runs, rows, self.jacobian, self.fitted)
        run = self.noise.run_covariance if run is None else run
        return linear.products(residual, run, prior_offsets(self.fitted, self.parameters))

    def refitted(self, runs: Runs, rows: Flags, *, for_test: bool = False) -> Fit:
        """Fit again to the runs in `rows` (n,), by one linear step; for a test, by least squares in Σ."""
        products = self.products(runs, rows)
        refit = products.solve(passes=_PASSES)
        step, covariance = refit.step, refit.covariance
        if for_test:
            step, covariance = solve_normal(products.at(refit.share))
        return replace(
            self,
            parameters=apply_step(self.fitted, self.parameters, step),
            prediction=self.prediction + self.jacobian @ step,
            covariance=self.inflation * covariance,
        )

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
    title: str = "fit",
) -> Fit:
    """Fit `names` to the runs in `used` (n,), starting at `start`; other parameters stay.

    Args:
        target: of rᵀ Σ⁻¹ r. Where the steps that are left cannot reach it, the search ends before it converges.
        wrong_numbers: nuisance parameters that are wrong, each followed by those that may be wrong in its place;
            the first of each is fitted without its prior.
        in_sigma: fit with the weights of tests, Σ⁻¹. A common misfit bends such a fit less, so what is missing is
            found more easily near it.

    Raises:
        UnsolvedError: the model cannot be solved quickly with the effects among `names`, however small.
    """
    data = model.runs
    freed = {alike[0].parameter.name for alike in wrong_numbers}
    fitted = tuple(parameter(model, name) for name in names)
    fitted = tuple(replace(p, sigma=None) if p.name in freed else p for p in fitted)
    run, repeats = data.noise(used)
    problem = _Problem(model, fitted, used, run, in_sigma, title)
    with limited_as_one():
        point = _descend(problem, problem.first(dict(start)), target)
        stopped = spent()
    linear = point.products.solve(passes=_PASSES)
    normal = point.products.at(linear.share)
    step, spread = solve_normal(normal)
    nuisances = {p.name for p in model.nuisances}
    offsets = [p.offset(point.parameters[p.name]) if p.name in nuisances else 0.0 for p in fitted]
    inflation = _inflation(repeats, len(run))
    return Fit(
        parameters=point.parameters,
        fitted=fitted,
        names=names,
        covariance=inflation * linear.covariance,
        inflation=inflation,
        freedom=_freedom(point.products, linear.share, len(names)),
        prediction=point.prediction,
        jacobian=point.derivative,
        noise=Noise(run, linear.share),
        deviance=float(normal[-1, -1] + point.products.determinant(linear.share)),
        converged=_step(fitted, point.parameters, problem.normal(point, linear.share), 0).promise < _UNSETTLED,
        wrong_numbers=wrong_numbers,
        tested=(np.array(offsets) + step, np.diag(spread)),
        stopped=stopped,
    )


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
    run: Floats
    in_sigma: bool
    title: str

    def normal(self, point: _Point, share: Floats) -> Floats:
        """Return the products of a point with the weights of the fit, (p + 1, p + 1)."""
        return point.products.at(share) if self.in_sigma else point.products.for_fit(share)[0]

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
        self, parameters: dict[str, float], derivative: Floats | None, count: int, *, quick: bool = True
    ) -> _Point:
        """Run the model at `parameters`; its derivatives are computed if none are given."""
        title = f"{self.title}, step {count}" if self.title else ""
        if derivative is None:
            prediction, derivative = derivatives(self.model, parameters, self.fitted, title=title, quick=quick)
        else:
            prediction = derivatives(self.model, parameters, [], title=title, quick=quick)[0]
        linear = regression(self.model.runs, self.used, derivative, self.fitted)
        residual = (self.model.runs.y - prediction)[self.used]
        products = linear.products(residual, self.run, prior_offsets(self.fitted, parameters))
        return _Point(parameters, prediction, derivative, products)


class _FitStep(NamedTuple):
    parameters: dict[str, float]  # after it
    size: float  # largest change, of ln C or ε
    promise: float  # by how much it reduces rᵀ Σ⁻¹ r if the model is linear
    damping: int  # place of its λ in _DAMPING


def _descend(problem: _Problem, point: _Point, target: float) -> _Point:
    """Find the least rᵀ Σ⁻¹ r from `point`; steps to where the model cannot be solved quickly are too long.

    A wrong model crawls along a bent valley far above the noise. The search ends there as soon as all steps that
    are left, with what the present one promises, would not come down to `target`.
    """
    fitted = problem.fitted
    least, kept = 0, False  # place of the least damping allowed; whether the derivatives are of another point
    refused = False  # whether the step before did not improve the fit
    for count in range(1, _MOST_STEPS + 1):
        # The scatter of the sessions comes from the residuals of the fit, but only near the solution. Far from it
        # every session looks shifted, and with a large ρ the search would stop there.
        share = point.products.share(passes=0 if count == 1 else _PASSES)
        normal = problem.normal(point, share)
        step = _step(fitted, point.parameters, normal, least)
        if step.promise < _SMALL and count > 1:
            break
        above = float(normal[-1, -1]) - target
        if count > _TRIED and (_MOST_STEPS - count) * step.promise < above:
            break
        if skipped("more steps of some fits"):
            break
        tried = problem.at(step.parameters, None if step.size > _SHORT else point.derivative, count + 1)
        fall = float(normal[-1, -1] - problem.normal(tried, share)[-1, -1])
        if tried.solved and fall > -_SMALL:
            # A step that keeps little of its promise overshoots, and the next one is damped (Marquardt 1963).
            least = step.damping + 1 if fall < _KEPT * step.promise else max(step.damping - 2, 0)
            least = min(least, len(_DAMPING) - 1)
            point, kept, refused = tried, step.size <= _SHORT, False
        elif kept:
            again = problem.at(point.parameters, None, count + 1, quick=bool(problem.effects))
            if not again.solved:
                break
            point, kept = again, False
        else:
            least, refused = max(step.damping + 1 + refused, 2), True  # each costs as much as one that does
            if least >= len(_DAMPING):
                break
    return point


def birge(runs: Runs, fitted: Fit, used: Flags) -> float:
    """Compute the factor by which the variance of what a fit leaves exceeds that of the noise, at least 1.

    Source: Birge (1932).
    """
    priors = sum(p.sigma is not None for p in fitted.fitted)
    freedom = runs.values(used) + priors - len(fitted.names)
    return max(1.0, float(fitted.normal(runs, used)[-1, -1]) / max(freedom, 1))


def _step(fitted: tuple[Parameter, ...], parameters: dict[str, float], normal: Floats, least: int) -> _FitStep:
    """Compute a step from `parameters`, with a λ at the place `least` of _DAMPING or behind it."""
    for place in range(least, len(_DAMPING)):
        change = _damped(fitted, parameters, normal, _DAMPING[place])
        if all(abs(c) <= _LARGEST for c, p in zip(change, fitted, strict=True) if p.logarithmic):
            break
    new = apply_step(fitted, parameters, change)
    promise = 2 * change @ normal[:-1, -1] - change @ normal[:-1, :-1] @ change
    return _FitStep(new, float(np.abs(change).max()), float(promise), place)


def _damped(fitted: tuple[Parameter, ...], parameters: dict[str, float], normal: Floats, damping: float) -> Floats:
    """Compute the change (p,) of the parameters; zero for those that stay at a bound."""
    at_low = np.array([parameters[p.name] <= p.bounds[0] for p in fitted])
    at_high = np.array([parameters[p.name] >= p.bounds[1] for p in fitted])
    typical = np.array([1.0 if p.logarithmic else abs(p.typical) for p in fitted])
    change = np.zeros(len(fitted))
    free = np.arange(len(fitted))
    while len(free):
        damped = normal[np.ix_(free, free)] + np.diag(damping / typical[free] ** 2)
        scale = np.sqrt(np.maximum(np.diag(damped), 1e-300))
        inverse = np.linalg.pinv(damped / np.outer(scale, scale), rcond=1e-12, hermitian=True)
        change[:] = 0.0
        change[free] = inverse @ (normal[free, -1] / scale) / scale
        outward = (at_low & (change < 0)) | (at_high & (change > 0))
        if not outward.any():
            break
        free = free[~outward[free]]
        change[outward] = 0.0
    return change


def _inflation(repeats: float, outputs: int) -> float:
    """Compute the factor by which the variance is larger because S is estimated from ν repeats of k outputs.

    ν/(ν − k − 1), because 1/S is overestimated, times 1 + (k − 1)/(ν − k), because its weights are not optimal.
    """
    if math.isinf(repeats):
        return 1.0
    if repeats <= outputs + 1:
        return 2.0 * repeats
    return repeats / (repeats - outputs - 1) * (1 + (outputs - 1) / (repeats - outputs))


def _freedom(products: NormalEquations, share: Floats, count: int) -> Floats:
    """Estimate the degrees of freedom of the parameters' variances, (p,)."""
    least = 1 / products.sizes.mean()
    steps = 0.01 * share + 1e-3 * least
    shares = np.vstack([share, share + np.diag(steps)])
    variances = [np.diag(products.covariance(s))[:count] for s in shares]
    V, *near = np.maximum(variances, 1e-100)
    slopes = (np.array(near) - V) / steps[:, None]
    error = math.sqrt(2 / max(len(products.sizes) - 1, 1)) * np.where(products.estimated, share + least, 0.0)
    variance = (((slopes + slopes.mean(0)) / 2 * error[:, None]) ** 2).sum(0)
    return np.asarray(np.clip(2 * V**2 / np.maximum(variance, 1e-12 * V**2), 1.0, 1e6))


def profile_intervals(
    model: ForwardModel, fitted: Fit, used: Flags, *, title: str = ""
) -> dict[str, tuple[float, float]]:
    """Compute the 95 % interval of every fitted parameter, by its profile deviance; of nuisance parameters by the
    covariance.
    """
    data, count = model.runs, len(fitted.names)
    along = solve_normal(fitted.normal_of_fit(data, used))[1]
    sets, ends = [], []
    for i, p in enumerate(fitted.fitted):
        if p.sigma is not None:
            continue
        half = fitted.half_width(i)
        for side in (-1, 1):
            end = p.moved(fitted.parameters[p.name], side * half)
            change = (
                math.log(end / fitted.parameters[p.name]) if p.logarithmic else end - fitted.parameters[p.name]
            )
            step = along[i] / along[i, i] * change  # how the others change with it
            sets.append(apply_step(fitted.fitted, fitted.parameters, step))
            ends.append((i, change))
    predictions = model.predict(sets, title=title)
    least = _deviance(fitted, data, used, list(range(count)))
    intervals: dict[str, list[float]] = {p.name: [] for p in fitted.fitted if p.sigma is None}
    for (i, change), parameters, prediction in zip(ends, sets, predictions, strict=True):
        others = [j for j in range(count) if j != i]
        end_of = replace(fitted, parameters=parameters, prediction=prediction)
        rise = _deviance(end_of, data, used, others) - least
        expected = change**2 / along[i, i]
        scale = math.sqrt(expected / rise) if _FLAT * expected < rise < _STEEP * expected else 1.0
        p = fitted.fitted[i]
        intervals[p.name].append(p.moved(fitted.parameters[p.name], change * scale))
    given = {p.name: fitted.interval(p.name) for p in fitted.fitted if p.sigma is not None}
    return {**{name: (low, high) for name, (low, high) in intervals.items()}, **given}


def _deviance(fitted: Fit, data: Runs, used: Flags, others: list[int]) -> float:
    """Compute rᵀ Σ⁻¹ r with those parameters of `others` refitted (linearised), in the noise of the fit."""
    normal = fitted.normal_of_fit(data, used)[np.ix_([*others, -1], [*others, -1])]
    return float(schur_complement(normal, len(others))[0, 0])


def least_determined(fitted: Fit) -> tuple[dict[str, float], float]:
    """Find the direction in the coefficients, as logarithms, that the runs determine worst.

    Returns:
        The direction, a unit vector by name, largest component positive; and the standard deviation along it.
    """
    places = [i for i, p in enumerate(fitted.fitted) if p.logarithmic and p.sigma is None]
    values, vectors = np.linalg.eigh(fitted.covariance[np.ix_(places, places)])
    vector = vectors[:, -1] * np.sign(vectors[np.argmax(np.abs(vectors[:, -1])), -1])
    direction = {fitted.fitted[i].name: part for i, part in zip(places, vector.tolist(), strict=True)}
    return direction, float(np.sqrt(values[-1]))
