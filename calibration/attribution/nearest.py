"""The nearest form: an effect that describes a residual which no effect explains, with a size that may differ.

No form of a catalogue is exact, and specimens differ. So an effect may be missing beyond doubt while none leaves
no more than noise. The question here is not which effect is the cause, but whether a known form, with a size
that may differ between specimens, predicts runs that it has not seen. The size ε_g of specimen g (of a session,
where the table names no specimens) varies about its mean:

    ε_g = ε + u_g,  u_g ~ N(0, τ²),      or     ε_g = ε exp(u_g)

where the null is an end of the effect's range, so that a size has one sign only. A normal distribution about the
mean would have a good part of its sizes beyond the null; on a logarithmic scale there are none, and the fit stays
within the range. The u_g are nuisance parameters with the standard deviation τ. It has the largest restricted
likelihood of the model that is linear about the fit with it (Lindstrom and Bates 1990).

What the form leaves counts as noise: variances are multiplied by b = max(1, χ²/ν) of that remainder (Birge 1932).

A form is adopted if

1. nothing explains the residual, and its fit converged;
2. its gain on left-out groups of runs, paired over conditions, has a 95 % interval above zero, or is consistent
   over them (`calibration.attribution.forms`). The size of a specimen that is left out as a whole is the mean;
3. on these left-out runs it removes at least half of what the model without it leaves beyond noise, if that is
   known;
4. its mean size differs from the null. With one size, its interval says so; with several, a t-test over the sizes
   that the specimens ask for on their own, either sign allowed, by one linear step without the spread. The
   interval of a size that varies in its logarithm must stay within a factor of 100.

Sizes differ if the restricted likelihood gains by it: -2 ln of its ratio is above 2.71, the 95 % quantile where a
variance is at its bound of zero (Self and Liang 1987). Of the forms adopted the one with the largest gain is
taken, or, if left-out runs cannot tell it from that one, a form at the size that theory gives. The others that
they cannot tell from it are named. A form that the runs hold at an end of its range counts only if none inside its
range is as good.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import norm as normal
from scipy.stats import t as student

from calibration.attribution.forms import Form, as_good, at_theory, gain_of_residuals
from calibration.attribution.refits import FIRST, Candidate, Judgement, left_out_residuals
from calibration.statistics.budget import skipped, spent
from calibration.statistics.fit import Fit, UnsolvedError, birge, fit, profile_end
from calibration.statistics.forward import derivatives
from calibration.statistics.gls import schur_complement, solve_normal
from calibration.statistics.residual_tests import TESTABLE, Directions, Misfit, examine_residual
from calibration.statistics.shifted import Shift, Shifted
from calibration.statistics.statistical_model import (
    Experiment,
    ForwardModel,
    Parameter,
    Parameters,
    Runs,
    prior_offsets,
    regression,
    start_values,
)
from calibration.statistics.study import FinalRefit, Study
from common.arrays import Flags, Floats, Integers

_REMOVED = 0.5  # least share of what is beyond noise
_DIFFERS = 2.71  # ½ χ²₁ at 5 %
_FEWEST = 3  # specimens, for sizes that differ
_DRAWS = 400  # of the bootstrap, for what the form leaves
_LARGEST = 300.0  # half width, so that its exponential is a number
_VAGUE = math.log(100.0)  # half width of the interval of a logarithm, which says nothing
_ROUNDS, _SETTLED = 12, 0.03  # of the estimate of τ; its last relative change
_WORTH = 0.1  # share of what is beyond noise that a form removes, or may by its score, to be fitted again
_WIDEST = 100.0  # factor by which τ may grow in a round


@dataclass(frozen=True)
class AdoptedForm:
    """An effect that is adopted as a description of what no effect explains."""

    effect: Parameter
    model: ForwardModel  # the study's own, or `Shifted` with a shift for each specimen
    fit: Fit
    spread: float  # τ, on the scale of the fit; 0: one size
    birge: float  # b
    interval: tuple[float, float]  # 95 % of the mean size
    sizes: Mapping[str, tuple[float, float, float]]  # of each fitted specimen, with its interval; empty: one size
    gain: float  # on left-out groups, in log likelihood
    gain_error: float
    removed: float  # share of what is beyond noise that it removes there
    remainder: float  # relative rms that it leaves there beyond noise
    at_theory: bool = False  # its size is that of theory, and not fitted
    forms: tuple[Form, ...] = ()  # that left-out runs cannot tell from it, itself among them
    misfit: Misfit | None = None  # tests of what it leaves

    @property
    def form(self) -> Form:
        """It as one of several forms."""
        return Form((self.effect,), self.fit, self.at_theory)

    @property
    def size(self) -> float:
        """The mean size."""
        return float(self.fit.parameters[self.effect.name])

    @property
    def logarithmic(self) -> bool:
        """Whether its sizes vary in their logarithm."""
        return bool(self.sizes) and next(p for p in self.fit.fitted if p.name == self.effect.name).logarithmic

    @property
    def _departures(self) -> tuple[str, ...]:
        """Names of u_g."""
        return tuple(s.parameter.name for s in cast(Shifted, self.model).shifts) if self.sizes else ()

    def of_new_specimen(self) -> Floats:
        """Predict (n, k) all runs with the mean size."""
        none = dict.fromkeys(self._departures, 0.0)
        return self.model.predict([{**self.fit.parameters, **none}])[0]

    @property
    def largest_along(self) -> str:
        """The output and the feature of the inputs along which most is left."""
        assert self.misfit is not None
        return largest_along(self.misfit, self.model.runs)

    def record(self) -> dict[str, Any]:
        assert self.misfit is not None
        return {
            "effect": self.effect.name,
            "mean": self.size,
            "interval": list(self.interval),
            "spread": self.spread,
            "scale": "logarithm" if self.logarithmic else "as it is",
            "sizes": {name: list(size) for name, size in self.sizes.items()},
            "removed_share": self.removed,
            "session_gain": [self.gain, self.gain_error],
            "birge": self.birge,
            "remainder": self.remainder,
            "remainder_p": self.misfit.p_value,
            "largest_along": self.largest_along,
            "as_well": [form.title for form in self.forms if form.fit is not self.fit],
            "at_theory": self.at_theory,
        }

    def handed_on(self, refit: FinalRefit) -> FinalRefit:
        """Return the refit to all runs for a new specimen: the mean size, with the spread in its variance."""
        own = self._departures
        kept = [i for i, p in enumerate(refit.fitted) if p.name not in own]
        fitted = [refit.fitted[i] for i in kept]
        covariance = self.birge * refit.covariance[np.ix_(kept, kept)]
        parameters = {name: value for name, value in refit.parameters.items() if name not in own}
        if self.at_theory:
            return FinalRefit(parameters, tuple(fitted), covariance)
        place = next(i for i, p in enumerate(fitted) if p.name == self.effect.name)
        covariance[place, place] += self.spread**2
        if fitted[place].logarithmic:  # corrected.toml states the size itself
            slope = np.ones(len(kept))
            slope[place] = refit.parameters[self.effect.name]
            covariance *= np.outer(slope, slope)
            fitted[place] = self.effect
        return FinalRefit(parameters, tuple(fitted), covariance)


def specimens(runs: Runs) -> tuple[Integers, tuple[str, ...]]:
    """Number the specimens of the runs, (n,), and name them; sessions where none are noted."""
    if runs.specimen is None:
        return runs.session, runs.session_names
    return runs.specimen, runs.specimen_names


def largest_along(misfit: Misfit, runs: Runs) -> str:
    """Name the output and the feature of the inputs along which a residual is largest; empty without inputs."""
    shapes = np.abs(misfit.scores.shapes)
    if not shapes.size:
        return ""
    output, feature = np.unravel_index(np.argmax(shapes), shapes.shape)
    return f"{runs.outputs[output]} along {misfit.features[feature]}"


def varying(model: ForwardModel, effect: Parameter, spread: float) -> Shifted:
    """Let an effect differ between the specimens of a model's runs, by `spread` on its scale."""
    numbered, names = specimens(model.runs)
    mean = replace(effect, logarithmic=effect.start in effect.bounds)
    shifts = (Shift(mean, numbered == g, f"of {name}", spread) for g, name in enumerate(names))
    return Shifted(cast(Experiment, model), tuple(shifts))


def sizes_of(model: Shifted, parameters: Parameters) -> Floats:
    """Compute ε_g of every specimen."""
    sizes = model.of_runs(parameters)[model.shifts[0].of.name]
    return np.array([sizes[s.rows][0] for s in model.shifts])


def adopt_nearest(
    study: Study, base: Fit, misfit: Misfit, candidates: Sequence[Candidate], tangents: Directions
) -> tuple[AdoptedForm | None, tuple[Candidate, ...]]:
    """Find the form that describes best what no effect explains in the fit `base`; None if none does.

    Returns:
        The form, and the candidates, the most promising ones with the fit and the left-out error that they have.
    """
    adopted: list[AdoptedForm] = []
    tried = {c.effect.name: c for c in candidates}
    noise_known = study.model.runs.noise_known
    for candidate in _promising(base, misfit.critical_z if noise_known else 0.0, candidates):
        if skipped(f"{candidate.title} as the nearest form"):
            continue
        try:
            constant = _converged(study, base, candidate)
            tried[candidate.effect.name] = _as_form(study, base, candidate, constant)
            if constant.parameters[candidate.effect.name] == candidate.effect.start:  # held at its null
                continue
            forms: list[tuple[ForwardModel, Fit, float]] = [(study.model, constant, 0.0)]
            if len(np.unique(specimens(study.model.runs)[0][study.split.fitted])) >= _FEWEST:
                forms.append(_with_spread(study, constant, candidate.effect))
        except UnsolvedError:
            tried[candidate.effect.name] = replace(candidate, judgement=Judgement.NOT_SOLVED)
            continue
        b = _birge(study, forms[-1][1])
        if len(forms) > 1 and not _sizes_differ(study, candidate.effect, constant, forms[1][1], b):
            forms.pop()
        judged = [_judged(study, base, candidate.effect, *form) for form in reversed(forms)]
        adopted += [form for form in judged if form][:1]
    of_theory = at_theory(study, base)
    single = (form for form in of_theory if len(form.effects) == 1)
    adopted += [a for f in single if (a := _judged(study, base, f.effects[0], study.model, f.fit, 0.0))]
    if not adopted:
        return None, tuple(tried.values())
    largest = max(adopted, key=lambda form: form.gain)
    together = [form for form in of_theory if len(form.effects) > 1]
    alike = as_good(study, largest.form, [*(a.form for a in adopted), *together])
    alike = [form for form in alike if not form.at_an_end] or alike
    alike.sort(key=lambda form: not form.at_theory)
    as_well = [a for a in adopted if any(a.fit is form.fit for form in alike)]
    best = max(as_well or [largest], key=lambda form: (form.at_theory, form.gain))
    place = next(i for i, e in enumerate(study.effects) if e.name == best.effect.name)
    left = examine_residual(replace(study, seed=study.seed + 5), best.fit, tangents.without(place), draws=_DRAWS)
    return replace(best, forms=tuple(alike), misfit=left), tuple(tried.values())


def _as_form(study: Study, base: Fit, candidate: Candidate, fitted: Fit) -> Candidate:
    """Describe a candidate by its fit as a form, and by its error on left-out runs."""
    before, after = left_out_residuals(study, base, fitted)
    left_out = float(np.linalg.norm(after) / np.linalg.norm(before))
    judgement = candidate.judgement if fitted.converged else Judgement.NOT_CONVERGED
    if fitted.converged and candidate.no_fit:
        judgement = Judgement.LEAVES_RESIDUAL
    return replace(candidate, refit=fitted, judgement=judgement, left_out=left_out)


def _birge(study: Study, fitted: Fit) -> float:
    return birge(study.model.runs, fitted, study.split.fitted)


def _promising(base: Fit, least: float, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Choose effects with |z| above `least` that remove most by their refits, or by their scores without one."""
    tested = [c for c in candidates if abs(c.z) > least and c.survived >= TESTABLE]
    return sorted(tested, key=lambda c: c.refit.deviance if c.refit else base.deviance - c.z**2)[:FIRST]


def _converged(study: Study, base: Fit, candidate: Candidate) -> Fit:
    """Fit an effect to its end: the search for explanations stops where noise is out of reach.

    It is fitted from where the score points to. Where this ends at an end of an effect's range, or does not
    converge, or goes on from a form of an earlier turn, it may be in a valley of its own, and is fitted again:
    from the model as given with a typical size of every effect, from a typical size, and from that of theory.
    """
    effect, refit = candidate.effect, candidate.refit
    names = (*base.names, effect.name, *((effect.second.name,) if effect.second else ()))

    def fitted_from(start: Parameters, size: float) -> Fit:
        size = min(max(size, effect.bounds[0]), effect.bounds[1])
        return fit(study.model, {**start, effect.name: size}, names, study.split.fitted, title="")

    if refit is None:
        step = math.copysign(candidate.detectable, candidate.z)
        refit = fitted_from(base.parameters, base.parameters[effect.name] + step)
    elif not refit.converged:
        refit = fitted_from(refit.parameters, refit.parameters[effect.name])
    added = tuple(e for e in study.model.effects if e.name in names)
    typical = effect.start + math.copysign(effect.typical, candidate.z)
    sides = {e.name: math.copysign(e.typical, refit.parameters[e.name] - e.start) for e in added}
    as_given = {**start_values(study.model), **{e.name: e.start + sides[e.name] for e in added}}
    starts = [(as_given, typical), (base.parameters, typical)]
    starts += [] if effect.theory is None else [(base.parameters, effect.theory)]
    fits = [refit] if len(added) == 1 else [refit, fitted_from(*starts.pop(0))]
    gain = max(candidate.z**2, base.deviance - refit.deviance)
    if gain < _WORTH * (base.deviance - study.values):  # far from what a form must remove
        starts = []
    while True:
        best = min(fits, key=lambda one: (not one.converged, one.deviance))
        if (best.converged and not Form(added, best, False).at_an_end) or not starts or spent():
            return best
        fits.append(fitted_from(*starts.pop(0)))


def _with_spread(study: Study, constant: Fit, effect: Parameter) -> tuple[Shifted, Fit, float]:
    """Fit an effect whose size differs between specimens, with the likeliest τ of the linear model, in turn."""
    used = study.split.fitted
    logarithmic = effect.start in effect.bounds
    spread = 1.0 if logarithmic else max(abs(constant.parameters[effect.name]) / 2, abs(effect.typical) / 10)
    least = 1e-3 * (1.0 if logarithmic else abs(effect.typical))
    departures = [s.parameter.name for s in varying(study.model, effect, spread).shifts]
    start = {**constant.parameters, **dict.fromkeys(departures, 0.0)}
    if logarithmic:
        start[effect.name] = math.copysign(
            max(abs(start[effect.name]), abs(effect.typical) / 100), start[effect.name]
        )
    names = (*constant.names, *departures)
    b = _birge(study, constant)
    for _ in range(_ROUNDS):
        # In units of S the prior is narrower by √b: the remainder counts as noise.
        model = varying(study.model, effect, spread / math.sqrt(b))
        fitted = fit(model, start, names, used, title="")
        new = _likeliest_spread(study, fitted, departures, b, least)
        new_b, start = _birge(study, fitted), fitted.parameters
        settled = abs(new / spread - 1) < _SETTLED and abs(new_b / b - 1) < _SETTLED
        spread, b = new, new_b
        if settled or spread == least or spent():
            break
    return model, fitted, spread


def _sizes_differ(study: Study, effect: Parameter, constant: Fit, varied: Fit, b: float) -> bool:
    """Tell whether the restricted likelihood gains by sizes that differ, both integrated over the same scale."""
    logarithmic = next(p for p in varied.fitted if p.name == effect.name).logarithmic
    scale = 2 * math.log(abs(constant.parameters[effect.name])) if logarithmic else 0.0
    return _restricted(study, constant, b) + scale - _restricted(study, varied, b) > _DIFFERS


def _likeliest_spread(study: Study, fitted: Fit, departures: Sequence[str], b: float, least: float) -> float:
    """Find the τ from `least` on with the largest restricted likelihood of the linear model of a fit."""
    normal = fitted.normal(study.model.runs, study.split.fitted)
    own = np.array([fitted.names.index(name) for name in departures])
    u = np.array([fitted.parameters[name] for name in departures])

    def changed(precision: float) -> Floats:
        """Add a prior of the departures, in units of S; take one away, if it is below 0."""
        more = normal.copy()
        more[own, own] += precision
        more[own, -1] -= precision * u
        more[-1, own] -= precision * u
        more[-1, -1] += precision * (u**2).sum()
        return more

    sigma = fitted.fitted[own[0]].sigma
    assert sigma is not None

    def minus_two_ln(log_spread: float) -> float:
        with_prior = changed(b * math.exp(-2 * log_spread) - sigma**-2)
        return _laplace(with_prior, fitted.held, b) + 2 * len(own) * log_spread

    ends = (math.log(least), math.log(_WIDEST * sigma * math.sqrt(b)))
    return math.exp(minimize_scalar(minus_two_ln, bounds=ends, method="bounded").x)


def _restricted(study: Study, fitted: Fit, b: float) -> float:
    """Compute -2 ln of the restricted likelihood of a fit in the noise b S, up to a constant (Laplace).

    Priors of its parameters are in units of S, as those of the study are.
    """
    normal = fitted.normal(study.model.runs, study.split.fitted)
    sigmas = [p.sigma for p in fitted.fitted if p.sigma is not None]
    return _laplace(normal, fitted.held, b) + sum(math.log(b * s**2) for s in sigmas)


def _laplace(normal: Floats, held: Flags, b: float) -> float:
    """Integrate the likelihood over parameters that are free: -2 ln of it, up to a constant."""
    free = np.append(~held, True)
    normal = normal[np.ix_(free, free)] / b
    least = schur_complement(normal, len(normal) - 1)[0, 0]
    return float(least + np.linalg.slogdet(normal[:-1, :-1])[1])


def _judged(
    study: Study, base: Fit, effect: Parameter, model: ForwardModel, fitted: Fit, spread: float
) -> AdoptedForm | None:
    """Describe a form by its left-out runs; None if it is not adopted."""
    size, free = fitted.parameters[effect.name], effect.name in fitted.names
    if not fitted.converged:
        return None
    b = _birge(study, fitted)
    before, after = left_out_residuals(study, base, fitted)
    paired = gain_of_residuals(study, before, after, b)
    values = len(after)
    beyond = float((before**2).sum()) - values
    removed = float((before**2 - after**2).sum()) / max(beyond, 1e-9)
    if not (paired.certain or paired.consistent) or (removed < _REMOVED and study.model.runs.noise_known):
        return None
    leaves = math.sqrt(max(float((after**2).sum()) / values - 1, 0.0))
    left, gain = leaves * fitted.noise.rms, (paired.gain, paired.error, min(removed, 1.0))
    if not free:
        return AdoptedForm(effect, model, fitted, 0.0, b, (size, size), {}, *gain, left, at_theory=True)
    place = fitted.names.index(effect.name)
    sigma = math.sqrt(b * fitted.covariance[place, place])
    half = float(normal.ppf(0.975)) * sigma
    sizes = {}
    if spread:
        assert isinstance(model, Shifted)
        seen = np.unique(specimens(study.model.runs)[0][study.split.fitted])
        if not _differs_from_null(study, model, fitted, seen):
            return None
        half = float(student.ppf(0.975, len(seen) - 1)) * max(sigma, spread / math.sqrt(len(seen)))
        sizes = _sizes(model, fitted, b, seen)
    if fitted.fitted[place].logarithmic and half > _VAGUE:
        return None
    held = fitted.held[place]
    low, high = fitted.interval(effect.name, b) if held else _ends(fitted.fitted[place], size, half)
    if not spread and low <= effect.start <= high:
        end = profile_end(study.model, fitted, effect.name, study.split.fitted, b)
        if end is None:
            return None
        low, high = (end, high) if size > effect.start else (low, end)
    return AdoptedForm(effect, model, fitted, spread, b, (low, high), sizes, *gain, left)


def _differs_from_null(study: Study, model: Shifted, fitted: Fit, seen: Integers) -> bool:
    """Tell by a t-test whether the mean of the sizes that specimens ask for on their own is not the null."""
    runs, used = study.model.runs, study.split.fitted
    effect = model.shifts[0].of
    own = {effect.name, *(s.parameter.name for s in model.shifts)}
    kept = [i for i, name in enumerate(fitted.names) if name not in own]
    sizes = sizes_of(model, fitted.parameters)[seen]
    along = derivatives(model.inner, model.of_runs(fitted.parameters), [effect.name])[1]
    along = along * (specimens(runs)[0][:, None] == seen)[:, None, :]
    others = [fitted.fitted[i] for i in kept]
    linear = regression(runs, used, np.concatenate([fitted.jacobian[..., kept], along], -1), others)
    residual, noise = (runs.y - fitted.prediction)[used], fitted.noise
    normal = linear.products(residual, noise.run_covariance, prior_offsets(others, fitted.parameters)).at(
        noise.session_ratio
    )
    asked = sizes - effect.start + solve_normal(normal)[0][len(kept) :]
    error = asked.std(ddof=1) / math.sqrt(len(seen))
    return bool(abs(asked.mean()) > student.ppf(0.975, len(seen) - 1) * error)


def _sizes(model: Shifted, fitted: Fit, b: float, seen: Integers) -> dict[str, tuple[float, float, float]]:
    """Compute the size of each fitted specimen, and its interval."""
    effect, names, sizes = model.shifts[0].of, specimens(model.runs)[1], sizes_of(model, fitted.parameters)
    mean = fitted.names.index(effect.name)
    stated = {}
    for g in seen.tolist():
        place = fitted.names.index(model.shifts[g].parameter.name)
        pair = fitted.covariance[np.ix_([mean, place], [mean, place])].sum()
        half = min(float(normal.ppf(0.975)) * math.sqrt(b * pair), _LARGEST)
        stated[names[g]] = (float(sizes[g]), *_ends(effect, float(sizes[g]), half))
    return stated


def _ends(parameter: Parameter, size: float, half: float) -> tuple[float, float]:
    """Return the ends of an interval, whose half width is on the parameter's own scale."""
    if parameter.logarithmic:
        return size * math.exp(-half), size * math.exp(half)
    return size - half, size + half
