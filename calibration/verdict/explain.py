"""Look for what explains a residual, from the simplest on, and withdraw what held-out runs refute.

1. The residual of the fit without effects is tested. Within the noise nothing is looked for.
2. A nuisance parameter that leaves its prior is freed, and comes ahead of every effect unless it would be far
   outside its prior (`calibration.attribution.wrong_numbers`).
3. Single effects (`calibration.attribution.effects`), effects beside a wrong number, and pairs follow, each only
   if nothing before explains the residual.
4. Numbers that differ in some runs (`calibration.attribution.moves`) are looked for before the effects and beside
   them.
5. A claim that the held-out runs refute is withdrawn, and the search goes on as if it were not in the catalogue.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import cast

from calibration.attribution.attribution import Attribution
from calibration.attribution.claim_checks import with_checks
from calibration.attribution.effects import FIRST, ebic, examine, explaining, pairs, scored, scores
from calibration.attribution.hypothesis import Hypothesis, Reason
from calibration.attribution.moves import find_moves, groups_that_may_differ
from calibration.attribution.rules import IMPLAUSIBLE, INDISTINGUISHABLE
from calibration.attribution.wrong_numbers import (
    as_good_as_number,
    beside_wrong_numbers,
    wrong_number_as_hypothesis,
)
from calibration.findings.held_out import tested_on_held_out
from calibration.statistics.budget import Work, clock, seconds_left, skipped, work_done
from calibration.statistics.fit import Fit, fit
from calibration.statistics.residual_tests import directions, examine_residual
from calibration.statistics.statistical_model import Experiment, start_values
from calibration.statistics.study import Study

_SHARE_OF_TEST = 0.2  # of the time of the first tests, for those of what an effect leaves, with fewer draws


def explain_and_refute(study: Study, base: Fit) -> tuple[Study, Attribution]:
    """Explain the residual of a fit without effects; claims that the held-out runs refute are withdrawn.

    Returns:
        The study, with a model of numbers that differ in some runs if there are such, and what was found in it.
    """
    plain, withdrawn = cast(Experiment, study.model), []
    given, (study, attribution) = study, _explain_with_moves(study, base)
    while attribution.claims:
        claim = tested_on_held_out(study, attribution.base, attribution.claims[0])
        # Where a number differs in the held-out runs, they refute nothing: it is found in all runs.
        if claim.reason is not Reason.REFUTED or fit_moves(study, plain, attribution)[1]:
            break
        withdrawn.append(claim)
        given = replace(given, settled=given.settled | {claim.effect.name})
        study, attribution = _explain_with_moves(given, base)
    return study, replace(attribution, withdrawn=tuple(withdrawn))


def _explain_with_moves(study: Study, base: Fit) -> tuple[Study, Attribution]:
    """Explain the residual, with numbers that differ in some runs, unless effects do without them as well.

    Such numbers are looked for before the effects, and again beside those that are named, or, where nothing
    explains the residual, beside those that come nearest.
    """
    if not study.model.runs.noise_known:  # a guess cannot tell what is beyond noise
        return study, explain(study, base)
    moved, with_moves, moves = find_moves(study, base)
    beside_moves = replace(explain(moved, with_moves), moves=moves) if moves else None
    explained = explain(study, base)
    if beside_moves:
        without = explained.claims and explained.final.deviance < with_moves.deviance + INDISTINGUISHABLE
        return (study, explained) if without else (moved, beside_moves)
    named = explained.final if explained.claims else explained.best_rejected
    if named:
        moved, beside, moves = find_moves(study, named)
        if moves and not skipped("effects beside what differs between runs"):
            changes = {move.effect.name: beside.parameters[move.effect.name] for move in moves}
            start, names = {**base.parameters, **changes}, (*base.names, *changes)
            with_moves = fit(moved.model, start, names, study.split.fitted, title="")
            beside_moves = replace(explain(moved, with_moves), moves=moves)
            if explained.claims or beside_moves.claims:
                return moved, beside_moves
    return study, explained


def fit_moves(
    study: Study, plain: Experiment, attribution: Attribution
) -> tuple[Fit | None, tuple[Hypothesis, ...]]:
    """Fit the final model to all runs, with the numbers that differ in some of them; None if none does."""
    if not groups_that_may_differ(plain.runs) or not plain.runs.noise_known:
        return None, ()
    final = attribution.base if attribution.nearest else attribution.final
    names = tuple(name for name in final.names if name in start_values(plain))
    every = Study.fitted_to(plain, study.split.kept, level=study.level, seed=study.seed)
    _, fitted, moves = find_moves(every, fit(plain, final.parameters, names, study.split.kept, title=""))
    return fitted if moves else None, moves


def explain(study: Study, base: Fit) -> Attribution:
    """Test the residual of the fit without effects, and look for what explains it, from the simplest on."""
    began = work_done()
    title = "derivatives" if study.progress else ""
    tangents = directions(study.model, base.parameters, study.effects, title=title)
    derived = clock()
    misfit = examine_residual(study, base, tangents)
    tested = clock()
    noise_known = study.model.runs.noise_known
    unexamined = tuple(scored(misfit, base, study.effects, misfit.critical_z))
    attribution = Attribution(base, misfit, tangents, unexamined, noise_known=noise_known)
    if misfit.p_value >= study.level or not noise_known:
        return attribution
    number = wrong_number_as_hypothesis(study, base, tangents)
    threshold = misfit.critical_z
    if number:  # every effect that may explain as much as the wrong number does
        gain = base.deviance - number.fitted.deviance
        threshold = min(threshold, math.sqrt(max(gain - INDISTINGUISHABLE, 1.0)))
    forecast = _forecast(study, began, tested - began.seconds, _SHARE_OF_TEST * (tested - derived))
    seen, near = scores(study, base, study.effects, tangents, misfit)
    candidates = examine(study, base, seen, tangents, threshold=threshold, near=near, after_first=forecast)
    attribution = replace(attribution, candidates=tuple(candidates))
    best = explaining(candidates)
    if number and number.kept and not (best and _fits_better(best[0], number)):
        return replace(attribution, explanations=_number_or_effects(study, attribution, number))
    # From the simplest on: one effect, one beside a wrong number, two effects.
    best = best or explaining(beside_wrong_numbers(study, base, candidates, tangents))
    second = [] if best else pairs(study, candidates)
    best = best or explaining(second)
    if best:
        return replace(attribution, explanations=with_checks(study, best, base))
    fits = [(ebic(study, h.fit, len(h.added)), h.fit) for h in (*candidates, *second) if h.fit]
    return replace(attribution, best_rejected=min(fits, key=lambda each: each[0])[1] if fits else None)


def _fits_better(effect: Hypothesis, number: Hypothesis) -> bool:
    return effect.fitted.deviance < number.fitted.deviance - INDISTINGUISHABLE


def _number_or_effects(study: Study, attribution: Attribution, number: Hypothesis) -> tuple[Hypothesis, ...]:
    """Order a wrong number and effects that explain as much: it comes first, unless it is implausibly far off."""
    effects = as_good_as_number(attribution.candidates, number.fitted, study.level)
    claims = [effect for effect in effects if effect.kept]
    if claims and any(pull.tolerances > IMPLAUSIBLE for pull in number.evidence.pulls):
        return (*with_checks(study, claims, attribution.base), number)
    return (*with_checks(study, [number], attribution.base), *effects)


def _forecast(study: Study, began: Work, of_first_tests: float, of_a_test: float) -> Callable[[int, float], None]:
    """Return what says, after the first fit, how many seconds of processor time all fits take, and pairs."""

    def forecast(count: int, seconds: float) -> None:
        single = max(seconds, count * of_a_test)
        pairs_take, left = FIRST * (of_first_tests + single), seconds_left(began)
        ends = f"; the search ends after about {_duration(left)}" * (left < single + pairs_take)
        if study.progress:
            print(
                f"there is more than noise: {count} effect{'s' * (count > 1)} to fit take{'s' * (count == 1)} "
                f"{_duration(single)} of processor time; if none explains the runs, pairs follow, "
                f"{_duration(pairs_take)} at most, mostly much less{ends}",
                file=sys.stderr,
            )

    return forecast


def _duration(seconds: float) -> str:
    return f"{max(seconds, 1):.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
