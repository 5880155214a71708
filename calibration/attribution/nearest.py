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

Where nothing explains the residual, forms are judged by `calibration.attribution.rules`: by their gain on left-out
groups of runs, where the size of a specimen that is left out as a whole is the mean; and by their size. Where
sizes differ, a t-test compares the mean of those that the specimens ask for on their own, either sign allowed, by
one linear step without the spread, with the null.

Sizes differ if the restricted likelihood gains by it: -2 ln of its ratio is above 2.71, the 95 % quantile where a
variance is at its bound of zero (Self and Liang 1987). Of the forms adopted the one with the largest gain is
taken, or, if left-out runs cannot tell it from that one, a form at the size that theory gives. The others that
they cannot tell from it are named. A form that the runs hold at an end of its range counts only if none inside its
range is as good.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import ndtri, stdtrit

from calibration.attribution.effects import FIRST
from calibration.attribution.forms import as_good, at_theory
from calibration.attribution.hypothesis import Evidence, Hypothesis, Origin, Reason
from calibration.attribution.left_out import gain_of_residuals, left_out_residuals
from calibration.attribution.rules import RULES, Trial, judge
from calibration.linear.gls import schur_complement, solve_normal
from calibration.statistics.budget import skipped, spent
from calibration.statistics.fit import Fit, UnsolvedError, birge, fit, profile_end
from calibration.statistics.forward import derivatives
from calibration.statistics.residual_tests import Directions, Misfit, examine_residual
from calibration.statistics.shifted import Shift, Shifted
from calibration.statistics.statistical_model import (
    Experiment,
    ForwardModel,
    Parameter,
    Parameters,
    prior_offsets,
    regression,
    start_values,
)
from calibration.statistics.study import FinalRefit, Study
from calibration.table.runs import Runs
from common.arrays import Flags, Floats, Integers

_DIFFERS = 2.71  # ½ χ²₁ at 5 %
_FEWEST = 3  # specimens, for sizes that differ
_DRAWS = 400  # of the bootstrap, for what the form leaves
_LARGEST = 300.0  # half width, so that its exponential is a number
_ROUNDS, _SETTLED = 12, 0.03  # of the estimate of τ; its last relative change
_WORTH = 0.1  # share of what is beyond noise that a form removes, or may by its score, to be fitted again
_WIDEST = 100.0  # factor by which τ may grow in a round


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
    sizes = model.of_runs(parameters)[model.shifts[0].parameter.name]
    return np.array([sizes[s.rows][0] for s in model.shifts])


def adopt_nearest(
    study: Study, base: Fit, misfit: Misfit, candidates: Sequence[Hypothesis], tangents: Directions
) -> tuple[Hypothesis | None, tuple[Hypothesis, ...], tuple[Hypothesis, ...]]:
    """Find the form that describes best what no effect explains in the fit `base`; None if none does.

    Returns:
        The form; all forms that left-out runs cannot tell from it, itself among them; and the candidates, the most
        promising ones with the fit and the left-out error that they have as forms.
    """
    adopted: list[Hypothesis] = []
    tried = {c.effect.name: c for c in candidates}
    noise_known = study.model.runs.noise_known
    for candidate in _promising(study, base, misfit.critical_z if noise_known else 0.0, candidates):
        if skipped(f"{candidate.title} as the nearest form"):
            continue
        try:
            constant = _converged(study, base, candidate)
            tried[candidate.effect.name] = _as_form(study, base, candidate, constant)
            if constant.parameters[candidate.effect.name] == candidate.effect.start:  # held at its null
                continue
            varied = _with_spread(study, constant, candidate.effect)
        except UnsolvedError:
            tried[candidate.effect.name] = replace(candidate, reason=Reason.NOT_SOLVED)
            continue
        form = _judged(study, base, candidate.effect, *varied) if varied else None
        if form is None or not form.kept:
            form = _judged(study, base, candidate.effect, constant)
        adopted += [form] if form.kept else []
    of_theory = at_theory(study, base)
    single = (_judged(study, base, form.effect, form.fitted) for form in of_theory if len(form.added) == 1)
    adopted += [form for form in single if form.kept]
    if not adopted:
        return None, (), tuple(tried.values())
    best, alike = _best(study, adopted, [form for form in of_theory if len(form.added) > 1])
    index = next(i for i, e in enumerate(study.effects) if e.name == best.effect.name)
    again = replace(study, seed=study.seed + 5)
    remainder = examine_residual(again, best.fitted, tangents.without(index), draws=_DRAWS)
    return best.seen(remainder=remainder), alike, tuple(tried.values())


def _best(
    study: Study, adopted: Sequence[Hypothesis], together: Sequence[Hypothesis]
) -> tuple[Hypothesis, tuple[Hypothesis, ...]]:
    """Choose one of the forms that may be adopted, and list those that left-out runs cannot tell from the best.

    Args:
        together: several effects at the sizes of theory, which only compete.
    """
    largest = max(adopted, key=_gain)
    alike = as_good(study, largest, [*adopted, *together])
    alike = [form for form in alike if not form.at_an_end] or alike
    alike.sort(key=lambda form: not form.at_theory)
    as_well = [a for a in adopted if any(a.fit is form.fit for form in alike)]
    return max(as_well or [largest], key=lambda form: (form.at_theory, _gain(form))), tuple(alike)


def _gain(form: Hypothesis) -> float:
    assert form.evidence.paired is not None
    return form.evidence.paired.gain


def _as_form(study: Study, base: Fit, candidate: Hypothesis, fitted: Fit) -> Hypothesis:
    """Describe a candidate by its fit as a form, and by its error on left-out runs."""
    before, after = left_out_residuals(study, base, fitted)
    left_out = float(np.linalg.norm(after) / np.linalg.norm(before))
    reason = candidate.reason if fitted.converged else Reason.NOT_CONVERGED
    if fitted.converged and candidate.no_fit:
        reason = Reason.LEAVES_RESIDUAL
    return replace(candidate, fit=fitted, reason=reason).seen(left_out=left_out)


def _birge(study: Study, fitted: Fit) -> float:
    return birge(study.model.runs, fitted, study.split.fitted)


def _promising(study: Study, base: Fit, least: float, candidates: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Choose effects with |z| above `least` that remove most by their fits, or by their scores without one."""
    shown = study.model.runs.least_surviving
    tested = [c for c in candidates if abs(c.score) > least and (c.evidence.survived or 0.0) >= shown]
    return sorted(tested, key=lambda c: c.fit.deviance if c.fit else base.deviance - c.score**2)[:FIRST]


def _converged(study: Study, base: Fit, candidate: Hypothesis) -> Fit:
    """Fit an effect to its end: the search for explanations stops where noise is out of reach.

    It is fitted from where the score points to. Where this ends at an end of an effect's range, or does not
    converge, or goes on from a form of an earlier turn, it may be in a valley of its own, and is fitted again:
    from the model as given with a typical size of every effect, from a typical size, and from that of theory.
    """
    effect, refit, score = candidate.effect, candidate.fit, candidate.score
    names = (*base.names, effect.name, *((effect.second.name,) if effect.second else ()))

    def fitted_from(start: Parameters, size: float) -> Fit:
        size = min(max(size, effect.bounds[0]), effect.bounds[1])
        return fit(study.model, {**start, effect.name: size}, names, study.split.fitted, title="")

    if refit is None:
        step = math.copysign(candidate.evidence.detectable or effect.typical, score)
        refit = fitted_from(base.parameters, base.parameters[effect.name] + step)
    elif not refit.converged:
        refit = fitted_from(refit.parameters, refit.parameters[effect.name])
    added = tuple(e for e in study.model.effects if e.name in names)
    typical = effect.start + math.copysign(effect.typical, score)
    sides = {e.name: math.copysign(e.typical, refit.parameters[e.name] - e.start) for e in added}
    as_given = {**start_values(study.model), **{e.name: e.start + sides[e.name] for e in added}}
    starts = [(as_given, typical), (base.parameters, typical)]
    starts += [] if effect.theory is None else [(base.parameters, effect.theory)]
    fits = [refit] if len(added) == 1 else [refit, fitted_from(*starts.pop(0))]
    gain = max(score**2, base.deviance - refit.deviance)
    if gain < _WORTH * (base.deviance - study.values):  # far from what a form must remove
        starts = []
    while True:
        best = min(fits, key=lambda one: (not one.converged, one.deviance))
        if (best.converged and not Hypothesis(Origin.FORM, added, best).at_an_end) or not starts or spent():
            return best
        fits.append(fitted_from(*starts.pop(0)))


def _with_spread(study: Study, constant: Fit, effect: Parameter) -> tuple[Fit, float] | None:
    """Fit an effect whose size differs between specimens, with the likeliest τ of the linear model, in turn.

    Returns:
        The fit and τ; None where specimens are few or their sizes do not differ.
    """
    used = study.split.fitted
    if len(np.unique(specimens(study.model.runs)[0][used])) < _FEWEST:
        return None
    logarithmic = effect.start in effect.bounds
    spread = 1.0 if logarithmic else max(abs(constant.parameters[effect.name]) / 2, abs(effect.typical) / 10)
    least = 1e-3 * (1.0 if logarithmic else abs(effect.typical))
    departures = [s.change.name for s in varying(study.model, effect, spread).shifts]
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
    return (fitted, spread) if _sizes_differ(study, effect, constant, fitted, _birge(study, fitted)) else None


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


def _judged(study: Study, base: Fit, effect: Parameter, fitted: Fit, spread: float = 0.0) -> Hypothesis:
    """Judge an effect as a description, by left-out runs and its size, which is that of theory if not fitted."""
    origin = Origin.FORM if effect.name in fitted.names else Origin.THEORY
    b = _birge(study, fitted)
    form = Hypothesis(origin, (effect,), fitted, Evidence(birge=b, spread=spread))
    if fitted.converged:
        form = _on_left_out_runs(study, base, form)
    seen = np.unique(specimens(study.model.runs)[0][study.split.fitted])
    if spread and fitted.converged:
        form = form.seen(sizes=_sizes(form, seen))
    measures = {
        "differs": lambda h: _differs_from_null(study, h.fitted, seen) if spread else True,
        "interval": lambda h: _interval_of_mean(h, len(seen)) if spread else _interval_of_size(study, h),
    }
    return judge(form, Trial(study, base, measures), RULES)


def _on_left_out_runs(study: Study, base: Fit, form: Hypothesis) -> Hypothesis:
    """Add what left-out runs say of a form: its paired gain, what it removes, and what it leaves."""
    before, after = left_out_residuals(study, base, form.fitted)
    values = len(after)
    beyond = float((before**2).sum()) - values
    removed = float((before**2 - after**2).sum()) / max(beyond, 1e-9)
    leaves = math.sqrt(max(float((after**2).sum()) / values - 1, 0.0))
    paired = gain_of_residuals(study, before, after, form.evidence.birge)
    return form.seen(paired=paired, removed=removed, remaining=leaves * form.fitted.noise.rms)


def size_interval(form: Hypothesis) -> tuple[float, float]:
    """Return the 95 % interval of the size of a form; that of theory has none."""
    return form.evidence.interval or (form.size, form.size)


def _interval_of_mean(form: Hypothesis, count: int) -> tuple[float, float]:
    """Compute the 95 % interval of the mean of sizes of `count` specimens."""
    index = form.fitted.names.index(form.effect.name)
    sigma = math.sqrt(form.evidence.birge * form.fitted.covariance[index, index])
    half = float(stdtrit(count - 1, 0.975)) * max(sigma, form.evidence.spread / math.sqrt(count))
    if form.fitted.held[index]:
        return form.fitted.interval(form.effect.name, form.evidence.birge)
    return _ends(form.fitted.fitted[index], form.size, min(half, _LARGEST))


def _interval_of_size(study: Study, form: Hypothesis) -> tuple[float, float]:
    """Compute the 95 % interval of one size; where it has the null by the covariance, by the deviance there."""
    name, b = form.effect.name, form.evidence.birge
    index = form.fitted.names.index(name)
    half = float(ndtri(0.975)) * math.sqrt(b * form.fitted.covariance[index, index])
    held = form.fitted.held[index]
    low, high = form.fitted.interval(name, b) if held else _ends(form.fitted.fitted[index], form.size, half)
    if low <= form.effect.start <= high:
        end = profile_end(study.model, form.fitted, name, study.split.fitted, b)
        if end is not None:
            return (end, high) if form.size > form.effect.start else (low, end)
    return low, high


def _differs_from_null(study: Study, fitted: Fit, seen: Integers) -> bool:
    """Tell by a t-test whether the mean of the sizes that specimens ask for on their own is not the null."""
    runs, used, model = study.model.runs, study.split.fitted, cast(Shifted, fitted.model)
    effect = model.shifts[0].parameter
    own = {effect.name, *(s.change.name for s in model.shifts)}
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
    return bool(abs(asked.mean()) > stdtrit(len(seen) - 1, 0.975) * error)


def _sizes(form: Hypothesis, seen: Integers) -> dict[str, tuple[float, float, float]]:
    """Compute the size of each fitted specimen, and its interval."""
    fitted, model = form.fitted, cast(Shifted, form.model)
    effect, names, sizes = model.shifts[0].parameter, specimens(model.runs)[1], sizes_of(model, fitted.parameters)
    mean = fitted.names.index(effect.name)
    stated = {}
    for g in seen.tolist():
        index = fitted.names.index(model.shifts[g].change.name)
        pair = fitted.covariance[np.ix_([mean, index], [mean, index])].sum()
        half = min(float(ndtri(0.975)) * math.sqrt(form.evidence.birge * pair), _LARGEST)
        stated[names[g]] = (float(sizes[g]), *_ends(effect, float(sizes[g]), half))
    return stated


def of_new_specimen(form: Hypothesis) -> Floats:
    """Predict (n, k) all runs with the mean of sizes that differ."""
    return form.model.predict([{**form.fitted.parameters, **dict.fromkeys(_departures(form), 0.0)}])[0]


def _departures(form: Hypothesis) -> tuple[str, ...]:
    """Return the names of u_g."""
    return tuple(s.change.name for s in cast(Shifted, form.model).shifts) if form.evidence.sizes else ()


def for_new_specimen(form: Hypothesis, refit: FinalRefit) -> FinalRefit:
    """Return the refit of a form to all runs for a new specimen: the mean size, its variance with the spread."""
    own = _departures(form)
    kept = [i for i, p in enumerate(refit.fitted) if p.name not in own]
    fitted = [refit.fitted[i] for i in kept]
    covariance = form.evidence.birge * refit.covariance[np.ix_(kept, kept)]
    parameters = {name: value for name, value in refit.parameters.items() if name not in own}
    if form.at_theory:
        return FinalRefit(parameters, tuple(fitted), covariance)
    index = next(i for i, p in enumerate(fitted) if p.name == form.effect.name)
    covariance[index, index] += form.evidence.spread**2
    if fitted[index].logarithmic:  # corrected.toml states the size itself
        slope = np.ones(len(kept))
        slope[index] = refit.parameters[form.effect.name]
        covariance *= np.outer(slope, slope)
        fitted[index] = form.effect
    return FinalRefit(parameters, tuple(fitted), covariance)


def _ends(parameter: Parameter, size: float, half: float) -> tuple[float, float]:
    """Return the ends of an interval, whose half width is on the parameter's own scale."""
    if parameter.logarithmic:
        return size * math.exp(-half), size * math.exp(half)
    return size - half, size + half
