"""Describe what no effect explains: adopt the nearest form, and, where something is still missing, others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from calibration.attribution.attribution import Attribution, LoopTurn
from calibration.attribution.effects import scored
from calibration.attribution.forms import forms_of_claims
from calibration.attribution.hypothesis import Hypothesis, Origin, Reason
from calibration.attribution.left_out import paired_gain
from calibration.attribution.nearest import adopt_nearest, largest_along
from calibration.findings.held_out import tested_on_held_out
from calibration.statistics.budget import skipped
from calibration.statistics.fit import Fit
from calibration.statistics.residual_tests import directions, examine_residual
from calibration.statistics.study import Study, errors

_MOST_TURNS = 4  # of the loop


def adopt_in_turns(study: Study, attribution: Attribution) -> Attribution:
    """Adopt the nearest form, and, where something is still missing with it in the base, a further one beside it.

    A form that the held-out runs refute is withdrawn, and another one is looked for. Where the noise is unknown,
    no pair of effects can explain the residual, so pairs of forms compete with the single ones.
    """
    runs, tangents, misfit = study.model.runs, attribution.tangents, attribution.misfit
    base, candidates = attribution.base, attribution.candidates
    turns = [_turn(study, base, "", largest_along(misfit, runs))]
    withdrawn = attribution.withdrawn
    while len(turns) <= _MOST_TURNS:
        form, alike, candidates = adopt_nearest(study, base, misfit, candidates, tangents)
        first = None
        if len(turns) == 1:
            seen = {c.effect.name: c for c in (*attribution.candidates, *candidates)}
            attribution = replace(attribution, candidates=tuple(seen.values()))
            if not runs.noise_known:
                first, form, alike = _nearest_pair(study, base, candidates, form, alike)
        if form is None:
            break
        claimed = replace(form, added=(*(first.added if first else ()), form.effect))
        index = next(i for i, e in enumerate(study.effects) if e.name == form.effect.name)
        study = replace(study, settled=study.settled | {e.name for e in claimed.added})
        judged = tested_on_held_out(study, base, claimed)
        if judged.reason is Reason.REFUTED:
            withdrawn = (*withdrawn, judged)
            if first:
                break
            # The next best form of the same residual, as if this one were not in the catalogue.
            tangents, misfit = tangents.without(index), misfit.without(index)
            candidates = tuple(c for c in candidates if c.effect != form.effect)
            continue
        if not runs.noise_known and _beside_others_at_an_end(study, form):
            break
        attribution = replace(attribution, nearest=form, forms=alike)
        if first:
            turns.append(_turn(study, first.fitted, first.title, largest_along(misfit, runs)))
        assert form.evidence.remainder is not None
        misfit, base = form.evidence.remainder, form.fitted
        beyond = misfit.p_value < study.level or not runs.noise_known
        turns.append(_turn(study, base, form.effect.title, largest_along(misfit, runs) if beyond else ""))
        if form.evidence.sizes or not beyond:  # sizes that differ describe what is left by themselves
            break
        tangents = directions(study.model, base.parameters, study.effects)
        candidates = tuple(scored(misfit, base, study.effects, misfit.critical_z))
    return replace(attribution, turns=tuple(turns) if attribution.nearest else (), withdrawn=withdrawn)


def _beside_others_at_an_end(study: Study, form: Hypothesis) -> bool:
    """Tell whether the fit with a form has other effects, too, and holds any of them at an end of its range."""
    every = tuple(e for e in study.model.effects if e.name in form.fitted.names)
    return len(every) > 1 and Hypothesis(Origin.FORM, every, form.fitted).at_an_end


def _turn(study: Study, fitted: Fit, named: str, left: str) -> LoopTurn:
    return LoopTurn(errors(study.model.runs, fitted.prediction, study.split.test)[0], named, left)


def _nearest_pair(
    study: Study,
    base: Fit,
    candidates: Sequence[Hypothesis],
    single: Hypothesis | None,
    alike: tuple[Hypothesis, ...],
) -> tuple[Hypothesis | None, Hypothesis | None, tuple[Hypothesis, ...]]:
    """Find two forms that together predict left-out runs better than a single one; else return that one alone."""
    pairs_of_forms = []
    for first in candidates:
        if first.fit is None or not first.fit.converged:
            continue
        beside = replace(study, settled=study.settled | {first.effect.name})
        tangents = directions(study.model, first.fit.parameters, beside.effects)
        misfit = examine_residual(beside, first.fit, tangents)
        seconds = scored(misfit, first.fit, beside.effects, misfit.critical_z)
        form, alike_form, _ = adopt_nearest(beside, first.fit, misfit, seconds, tangents)
        if form and paired_gain(study, form.fitted, single.fitted if single else base).certain:
            pairs_of_forms.append((first, form, alike_form))
    best = min(pairs_of_forms, key=lambda pair: pair[1].fitted.deviance, default=None)
    if best is None or (single and single.effect in (best[0].effect, best[1].effect)):  # a turn adds the other one
        return None, single, alike
    return best


def forms_in_question(study: Study, attribution: Attribution) -> tuple[Hypothesis, ...]:
    """List the forms that left-out runs cannot tell from what is claimed or adopted; none if it stands alone."""
    if attribution.claims and skipped("forms of what is claimed"):
        return ()
    forms: Sequence[Hypothesis] = attribution.forms
    if attribution.claims:
        forms = forms_of_claims(study, attribution.base, attribution.claims, attribution.candidates)
    return tuple(forms) if len(forms) > 1 else ()
