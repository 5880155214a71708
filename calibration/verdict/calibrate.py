"""The whole calibration: split, fit, test, attribute, refit, and open the held-out test once.

0. Repeats are compared by what the model does not know, and columns with each other
   (`calibration.statistics.between_repeats`). What differs becomes a number of every fit.
1. Whole sessions are held out before any run is compared with the model (by default the middle one).
   Outliers are excluded (`calibration.statistics.study`).
2. The coefficients and the nuisance parameters are fitted to the other sessions, with weights of the runs if
   some were tracked worse than others (`calibration.statistics.weights`), and the residual is tested.
3. What explains it is looked for (`explain`). A nuisance parameter that leaves its prior is freed, and comes ahead
   of every effect unless it would be far outside its prior (`calibration.attribution.wrong_numbers`). Single
   effects (`calibration.attribution.refits`), effects beside a wrong number, and pairs follow, each only if
   nothing before explains the residual.
4. The verdict (`calibration.verdict.findings.Attribution`).
5. If several explanations are left, next runs that would tell them apart (`calibration.verdict.next_runs`).
   If nothing explains the residual, laws that describe it (`describe`). Where none does, the nearest form is
   adopted (`calibration.attribution.nearest`). If something outside the catalogue could imitate what is claimed,
   laws that fit as well.
6. Errors on the held-out runs: as given, calibrated, with the effect, and from noise alone. Whether the held-out
   runs agree with the final model (`calibration.statistics.study`).
7. For use, the model is fitted once more to all runs, the held-out ones included.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, cast

from calibration.attribution.claim_checks import check_number, with_checks
from calibration.attribution.forms import Form, envelope, forms_of_claims, paired_gain
from calibration.attribution.moves import LocalShift, StatedMove, find_moves, groups_that_may_differ
from calibration.attribution.nearest import AdoptedForm, adopt_nearest, largest_along
from calibration.attribution.refits import (
    FIRST,
    INDISTINGUISHABLE,
    Candidate,
    Rival,
    coefficients_within_range,
    ebic,
    examine,
    explaining,
    pairs,
    unexamined,
)
from calibration.attribution.wrong_numbers import (
    as_good_as_number,
    beside_wrong_numbers,
    implausible,
    pulls,
    without_wrong_priors,
)
from calibration.statistics.budget import Budget, clock, limited, seconds_left, skipped
from calibration.statistics.checks import predict_as_given
from calibration.statistics.excluded import caveat_of_excluded
from calibration.statistics.fit import Fit, UnsolvedError, birge, fit, profile_end, profile_intervals
from calibration.statistics.offsets import Offsets, with_differences
from calibration.statistics.residual_tests import directions, examine_residual
from calibration.statistics.statistical_model import Experiment, ForwardModel, start_values, with_runs
from calibration.statistics.study import (
    DRAWS,
    LEVEL,
    FinalRefit,
    Study,
    errors,
    far_readings,
    final_refit,
    find_outliers,
    split_runs,
)
from calibration.statistics.unit_slips import refuse_unit_slips
from calibration.statistics.weights import (
    alike,
    caveat_of_weights,
    fit_weighted,
    noise_of_any_run,
    rows_of_little_weight,
)
from calibration.verdict.findings import Attribution, Description, LoopTurn
from calibration.verdict.held_out import HeldOutErrors, Withdrawn, held_out_errors, refuted
from calibration.verdict.next_runs import Explanation, next_runs
from calibration.verdict.verdict import Verdict
from common.arrays import Flags, Floats
from common.errors import InputError
from common.provenance import fingerprint

_SEARCH, _DESCRIBED = 0.6, 0.85  # shares of the time after which effects and descriptions are no longer looked for
_MOST_TURNS = 4  # of the loop
_SHARE_OF_TEST = 0.2  # of the time of the first tests, for those of what an effect leaves, with fewer draws


def calibrate(
    model: Experiment,
    *,
    held_out: Flags | None = None,
    describe: Callable[..., Description | None] | None = None,
    level: float = LEVEL,
    seed: int = 0,
    draws: int = DRAWS,
    max_seconds: float = math.inf,
    progress: bool = True,
) -> Verdict:
    """Calibrate a model with its runs, and find what it lacks.

    Args:
        model: its parameters' starts are the model "as given" (uncalibrated).
        held_out: (n,) runs kept for the test, whole sessions; default `study.middle_session`.
        describe: looks for laws where nothing explains the residual, and beside an uncertain claim, such as
            `calibration.laws.laws.find_laws`.
        level: α of every claim.
        seed: of the bootstrap; the same seed gives the same result.
        draws: of the bootstrap. It resolves no smaller p-value than 2/(draws + 1).
        max_seconds: of processor time for the search for explanations and descriptions; then the verdict is
            provisional, and says what was not tried.
        progress: show progress bars.
    """
    began = clock()
    model, differences = with_differences(model, held_out, level=level, seed=seed)
    study, base, uncalibrated = first_fit(model, held_out, level=level, seed=seed, draws=draws, progress=progress)
    model, split = cast(Experiment, study.model), study.split
    used = max(clock() - began, max_seconds - seconds_left())  # where the limit began before
    laws = None
    turns: tuple[LoopTurn, ...] = ()
    withdrawn: list[Withdrawn] = []
    # Explanations come first; what is left of the time is for descriptions of what nothing explains.
    with limited(_DESCRIBED * max_seconds - used) as budget:
        with limited(_SEARCH * max_seconds - used):
            study, found, moves = _explain_with_moves(study, base)
            # Where a number differs in the held-out runs, they refute nothing: it is found in all runs.
            while (refutation := _refuted_claim(study, found)) and not _fit_moves(study, model, found)[1]:
                withdrawn.append(refutation)
                given = replace(study, model=model, settled=study.settled | set(refutation.effects[-1:]))
                study, found, moves = _explain_with_moves(given, base)
        unexplained = found.verdict(level) == "unexplained" or not study.model.runs.noise_known
        uncertain = any(c.uncertain for c in found.best)
        wanted = study.model.runs.noise_known and (unexplained or uncertain)
        beside = _beside_what_no_law_is_sought(study, model) if describe and wanted else ""
        if describe and wanted and not beside:
            laws = describe(study, found.base, beside_claim=uncertain)
        described = laws if laws and unexplained and laws.complete else None
        if unexplained and not described:
            found, turns, refuted_forms = _adopt_in_turns(study, found)
            withdrawn += refuted_forms
        of_all, moves_of_all = _fit_moves(study, model, found)
    moves, with_moves = (moves_of_all, of_all) if of_all else (moves, found.base)
    errors = _errors(study, found, uncalibrated, laws)
    falls = errors.rms["after"] < errors.rms["before"]
    as_good = laws.as_good_as(found.final) if laws and uncertain else ()
    rivals = described.rivals if described else found.rivals(cast(Experiment, study.model), as_good)
    # The next runs are not weighted, so they have the noise of any run.
    rivals = tuple(replace(r, fit=replace(r.fit, noise=noise_of_any_run(study, r.fit.noise))) for r in rivals)
    base_intervals, final_intervals = _both_intervals(study, found, progress=progress)
    forms = _forms(study, found)
    for name, (low, high) in envelope(study, found.base.names, forms).items():
        if name in final_intervals:
            final_intervals[name] = (min(low, final_intervals[name][0]), max(high, final_intervals[name][1]))
    fixed = {"level": level, "seed": seed, "catalogue": [e.name for e in model.effects], "locked": split.names}
    verdict = Verdict(
        verdict=found.verdict(level),
        runs=model.runs,
        split=split,
        found=found,
        differences=differences,
        moves=tuple(StatedMove(move.words(with_moves), move.record(with_moves)) for move in moves),
        errors=errors,
        base_intervals=base_intervals,
        final_intervals=final_intervals,
        pulls=pulls(found.final, study.model.nuisances),
        final_refit=final_refit(of_all) if of_all else _handed_on(study, found, falls=falls),
        law=laws,
        explanations=tuple(map(Explanation.from_rival, rivals)),
        **_next_runs(rivals, seed),
        untestable=dict(model.untestable),
        draws=draws,
        fixed_before=fingerprint(fixed),
        little_weight=rows_of_little_weight(study),
        not_tried=tuple(budget.not_tried),
        forms=forms,
        turns=turns,
        withdrawn=tuple(withdrawn),
        caveats=(),
    )
    return replace(verdict, caveats=_caveats(verdict, model, budget, max_seconds, beside))


def _beside_what_no_law_is_sought(study: Study, model: Experiment) -> str:
    """Say what the model has that a law is not fitted beside; empty if there is nothing."""
    if isinstance(model, Offsets):
        return "what differs between repeats"
    return "" if study.model is model else "a number that differs in some runs"


def _both_intervals(
    study: Study, found: Attribution, *, progress: bool
) -> tuple[dict[str, tuple[float, float]], dict[str, tuple[float, float]]]:
    """Compute the 95 % intervals of the calibrated model, and of the final one."""
    title = "intervals" if progress else ""
    base = final = _intervals(study.model, found.base, study.split.fitted, title)
    if found.final is not found.base:
        model = found.nearest.model if found.nearest else study.model
        final = _intervals(model, found.final, study.split.fitted, title)
    b = birge(study.model.runs, found.final, study.split.fitted)
    for effect in (e for e in study.model.effects if e.name in final):
        low, high = final[effect.name]
        if low <= effect.start <= high:
            end = profile_end(found.final.model, found.final, effect.name, study.split.fitted, b)
            if end is not None:
                final[effect.name] = (end, high) if end > effect.start else (low, end)
    if found.nearest:
        final[found.nearest.effect.name] = found.nearest.interval
    return base, final


def _forms(study: Study, found: Attribution) -> tuple[Form, ...]:
    """List the forms that left-out runs cannot tell from what is claimed or adopted; none if it stands alone."""
    if found.best and skipped("forms of what is claimed"):
        return ()
    if found.nearest:
        forms: Sequence[Form] = found.nearest.forms
    else:
        forms = forms_of_claims(study, found.base, found.best, found.candidates) if found.best else ()
    return tuple(forms) if len(forms) > 1 else ()


def _refuted_claim(study: Study, found: Attribution) -> Withdrawn | None:
    """Return the claim that the held-out runs refute; None if there is none."""
    claim = found.best[0] if found.best else None
    if claim is None or claim.refit is None:
        return None
    return refuted(study, found.base, claim.refit, claim.title, tuple(e.name for e in claim.claimed))


def first_fit(model: Experiment, held_out: Flags | None = None, **settings: Any) -> tuple[Study, Fit, Floats]:
    """Divide and check the runs, and fit the model without effects.

    Returns:
        The study, the fit, and the prediction of the model as given.
    """
    start = start_values(model)
    given = predict_as_given(model, title="as given" if settings.get("progress") else "")
    model.check(given)
    refuse_unit_slips(model.runs, given)
    study = Study(model, split_runs(model.runs, held_out, find_outliers(model.runs, given)), **settings)
    guess = model.runs.guessed_noise(study.split.fitted, model.runs.y - given)
    study = replace(study, model=with_runs(model, **guess))
    return *fit_weighted(study, model.guess(start, study.split.fitted)), given


def _explain_with_moves(study: Study, base: Fit) -> tuple[Study, Attribution, tuple[LocalShift, ...]]:
    """Explain the residual, with numbers that differ in some runs, unless effects do without them as well.

    Such numbers are looked for before the effects, and again beside those that are named, or, where nothing
    explains the residual, beside those that come nearest.
    """
    if not study.model.runs.noise_known:  # a guess cannot tell what is beyond noise
        return study, explain(study, base), ()
    moved, with_moves, moves = find_moves(study, base)
    beside_moves = explain(moved, with_moves) if moves else None
    explained = explain(study, base)
    if beside_moves:
        if explained.best and explained.final.deviance < with_moves.deviance + INDISTINGUISHABLE:
            return study, explained, ()
        return moved, beside_moves, moves
    named = explained.final if explained.best else explained.unkept
    if named:
        moved, beside, moves = find_moves(study, named)
        if moves and not skipped("effects beside what differs between runs"):
            changes = {move.name: beside.parameters[move.name] for move in moves}
            start, names = {**base.parameters, **changes}, (*base.names, *changes)
            with_moves = fit(moved.model, start, names, study.split.fitted, title="")
            beside_moves = explain(moved, with_moves)
            if explained.best or beside_moves.best:
                return moved, beside_moves, moves
    return study, explained, ()


def _fit_moves(study: Study, plain: Experiment, found: Attribution) -> tuple[Fit | None, tuple[LocalShift, ...]]:
    """Fit the final model to all runs, with the numbers that differ in some of them; None if none does."""
    if not groups_that_may_differ(plain.runs) or not plain.runs.noise_known:
        return None, ()
    final = found.base if found.nearest else found.final
    names = tuple(name for name in final.names if name in start_values(plain))
    every = Study.fitted_to(plain, study.split.kept, level=study.level, seed=study.seed)
    _, fitted, moves = find_moves(every, fit(plain, final.parameters, names, study.split.kept, title=""))
    return fitted if moves else None, moves


def explain(study: Study, base: Fit) -> Attribution:
    """Test the residual of the fit without effects, and look for what explains it, from the simplest on."""
    model, level = study.model, study.level
    began = clock()
    title = "derivatives" if study.progress else ""
    tangents = directions(model, base.parameters, study.effects, title=title)
    derived = clock()
    misfit = examine_residual(study, base, tangents)
    tested = clock()
    if misfit.p_value >= level or not model.runs.noise_known:
        scored = tuple(unexamined(misfit, study.effects, misfit.critical_z))
        return Attribution(base, misfit, tangents, scored, noise_known=model.runs.noise_known)
    freed = without_wrong_priors(study, base)
    number_is_wrong = freed is not base
    number_explains = number_is_wrong and examine_residual(study, freed, tangents).p_value >= level
    threshold = misfit.critical_z
    if number_is_wrong:  # every effect that may explain as much as the wrong number does
        gain = base.deviance - freed.deviance
        threshold = min(threshold, math.sqrt(max(gain - INDISTINGUISHABLE, 1.0)))

    def forecast(count: int, seconds: float) -> None:
        if study.progress:
            single = count * max(seconds, _SHARE_OF_TEST * (tested - derived))
            print(_forecast(count, single, FIRST * (tested - began + single)), file=sys.stderr)

    candidates = examine(study, base, misfit, tangents, threshold=threshold, after_first=forecast)
    best = explaining(candidates)
    refit = best[0].refit if best else None
    if number_explains and not (refit and refit.deviance < freed.deviance - INDISTINGUISHABLE):
        return _explained_by_number(study, Attribution(base, misfit, tangents, tuple(candidates)), freed)
    # From the simplest on: one effect, one beside a wrong number, two effects.
    best = best or explaining(beside_wrong_numbers(study, base, candidates, tangents))
    second = [] if best else pairs(study, candidates)
    best = best or explaining(second)
    tried = [(ebic(study, c.refit, len(c.claimed)), c.refit) for c in (*candidates, *second) if c.refit]
    unkept = min(tried, key=lambda each: each[0])[1] if tried and not best else None
    checked = tuple(with_checks(study, best, base))
    return Attribution(base, misfit, tangents, tuple(candidates), checked, unkept=unkept)


def _explained_by_number(study: Study, found: Attribution, freed: Fit) -> Attribution:
    """Name a wrong number, `freed` in a fit, unless an effect explains as much and it is implausibly far off."""
    rival_effects = tuple(as_good_as_number(list(found.candidates), freed, study.level))
    claims = [c for c in rival_effects if c.kept]
    off = tuple(p for p in pulls(freed, study.model.nuisances) if p.freed)
    if claims and implausible(off):
        checked = tuple(with_checks(study, claims, found.base))
        return replace(found, best=checked, number=freed, rival_numbers=off)
    check = check_number(study, freed, found.base)
    return replace(found, number=freed, rival_effects=rival_effects, number_check=check)


def _forecast(count: int, single: float, pairs_at_most: float) -> str:
    """Say how many seconds of processor time `count` effects take, and pairs."""
    ends = f"; the search ends after {_duration(seconds_left())}" * (seconds_left() < math.inf)
    return (
        f"there is more than noise: {count} effects to fit take {_duration(single)} of processor time; if none "
        f"explains the runs, pairs follow, {_duration(pairs_at_most)} at most, mostly much less{ends}"
    )


def _duration(seconds: float) -> str:
    return f"{max(seconds, 1):.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def _intervals(model: ForwardModel, fitted: Fit, used: Flags, title: str) -> dict[str, tuple[float, float]]:
    """Compute 95 % intervals by profile deviance; by the covariance where the model breaks down at their ends."""
    try:
        if not skipped("intervals by profile deviance", 2 * len(fitted.names)):
            return profile_intervals(model, fitted, used, title=title)
    except InputError:
        pass
    return {name: fitted.interval(name) for name in fitted.names}


def _handed_on(study: Study, found: Attribution, *, falls: bool) -> FinalRefit:
    """Fit the final model to all runs, an adopted form only where it lowers the error on the held-out ones."""
    nearest, final = found.nearest, found.final
    if nearest and not falls:
        nearest, final = None, found.base
    try:
        of_all = final.refitted_fully(study.split.kept)
    except (UnsolvedError, InputError):  # where the model breaks down on the way
        of_all = final.refitted(study.model.runs, study.split.kept)
    refit = final_refit(of_all)
    return nearest.handed_on(refit) if nearest else refit


def _next_runs(rivals: tuple[Rival, ...], seed: int) -> dict[str, Any]:
    """Plan the runs that would tell rivals apart; none without rivals, or if one breaks down at such runs."""
    with suppress(InputError):
        if rivals and not skipped("next runs"):
            return dict(zip(("next_runs", "next_batch"), next_runs(rivals, seed=seed), strict=True))
    return {"next_runs": (), "next_batch": None}


def _errors(study: Study, found: Attribution, uncalibrated: Floats, laws: Description | None) -> HeldOutErrors:
    """State the errors of every model on the held-out runs."""
    base, final = found.base, found.final
    predictions = {"uncalibrated": uncalibrated, "before": base.prediction, "after": final.prediction}
    if laws is not None:
        predictions["law"] = laws.prediction
    if found.nearest and found.nearest.sizes:
        with suppress(InputError):  # the simulation may break down at the mean size
            predictions["new_specimen"] = found.nearest.of_new_specimen()
    return held_out_errors(study, predictions, base, final)


def _adopt_in_turns(
    study: Study, found: Attribution
) -> tuple[Attribution, tuple[LoopTurn, ...], tuple[Withdrawn, ...]]:
    """Adopt the nearest form, and, where something is still missing with it in the base, a further one beside it.

    A form that the held-out runs refute is withdrawn, and another one is looked for. Where the noise is unknown,
    no pair of effects can explain the residual, so pairs of forms compete with the single ones.
    """
    runs, test, tangents, misfit = study.model.runs, study.split.test, found.tangents, found.misfit
    base, candidates = found.base, found.candidates
    turns = [LoopTurn(errors(runs, base.prediction, test)[0], "", largest_along(misfit, runs))]
    withdrawn: list[Withdrawn] = []
    while len(turns) <= _MOST_TURNS:
        form, candidates = adopt_nearest(study, base, misfit, candidates, tangents)
        first = None
        if len(turns) == 1:
            seen = {c.effect.name: c for c in (*found.candidates, *candidates)}
            found = replace(found, candidates=tuple(seen.values()))
            if not runs.noise_known:
                first, form = _nearest_pair(study, base, candidates, form)
        if form is None:
            break
        place = next(i for i, e in enumerate(study.effects) if e.name == form.effect.name)
        names = (*([first.effect.name] if first else []), form.effect.name)
        title = " and ".join((*([first.title] if first else []), form.effect.title))
        study = replace(study, settled=study.settled | set(names))
        refutation = refuted(study, base, form.fit, title, names)
        if refutation and first:
            withdrawn.append(refutation)
            break
        if refutation:
            withdrawn.append(refutation)
            tangents, candidates = tangents.without(place), tuple(c for c in candidates if c.effect != form.effect)
            misfit = misfit.without(place)
            continue
        found = replace(found, nearest=form)
        if first and first.refit:
            turns.append(
                LoopTurn(errors(runs, first.refit.prediction, test)[0], first.title, largest_along(misfit, runs))
            )
        assert form.misfit is not None
        beyond = form.misfit.p_value < study.level or not runs.noise_known
        left = form.largest_along if beyond else ""
        turns.append(LoopTurn(errors(runs, form.fit.prediction, test)[0], form.effect.title, left))
        if form.sizes or not left:  # sizes that differ between specimens describe what is left by themselves
            break
        base, misfit = form.fit, form.misfit
        tangents = directions(study.model, base.parameters, study.effects)
        candidates = tuple(unexamined(misfit, study.effects, misfit.critical_z))
    return found, tuple(turns) if found.nearest else (), tuple(withdrawn)


def _nearest_pair(
    study: Study, base: Fit, candidates: Sequence[Candidate], single: AdoptedForm | None
) -> tuple[Candidate | None, AdoptedForm | None]:
    """Find two forms that together predict left-out runs better than a single one; else return that one alone."""
    pairs_of_forms = []
    for first in candidates:
        if first.refit is None or not first.refit.converged:
            continue
        beside = replace(study, settled=study.settled | {first.effect.name})
        tangents = directions(study.model, first.refit.parameters, beside.effects)
        misfit = examine_residual(beside, first.refit, tangents)
        scored = unexamined(misfit, beside.effects, misfit.critical_z, (first.effect,))
        form = adopt_nearest(beside, first.refit, misfit, scored, tangents)[0]
        if form and paired_gain(study, form.fit, single.fit if single else base).certain:
            pairs_of_forms.append((first, form))
    best = min(pairs_of_forms, key=lambda pair: pair[1].fit.deviance, default=None)
    if best is None or (single and single.effect in (best[0].effect, best[1].effect)):  # a turn adds the other one
        return None, single
    return best


def _caveats(
    verdict: Verdict, model: ForwardModel, budget: Budget, max_seconds: float, beside: str
) -> tuple[str, ...]:
    """Say what weakens the conclusion: what was left out or not tried, and why a fit may not be the best one."""
    runs, split, base, final = verdict.runs, verdict.split, verdict.base, verdict.final
    ended = f"after {max_seconds:.0f} s of processor time" if budget.left > -math.inf else "at Ctrl-C"
    not_tried = f"provisional: the search ended {ended}, and did not try {', '.join(budget.not_tried)}"
    little = verdict.little_weight
    held = [p for p, on_bound in zip(final.fitted, final.held, strict=True) if on_bound]
    far = far_readings(
        with_runs(model, weight=None).runs.subset(split.kept), (runs.y - final.prediction)[split.kept]
    )
    vague = [
        p.name
        for place, p in enumerate(final.fitted)
        if p.logarithmic and p.sigma is None and final.half_width(place) > math.log(2) and p not in held
    ]
    outside = not coefficients_within_range(model, base.parameters)
    unknown = "there are neither repeats nor a declared noise, so no residual can be told from noise"
    of_fits = (
        (not verdict.runs.noise_known, unknown),
        (beside, f"no law was looked for: laws are not fitted beside {beside}"),
        (vague, f"these runs determine {' and '.join(vague)} to no better than a factor of two"),
        (outside, "without effects the coefficients run to the end of their range, so every effect was refitted "
         "from the model as given, and it is less sure which effect it is"),
        (not final.converged, "the fit did not converge: do not trust its coefficients"),
    )  # fmt: skip
    return (
        *runs.caveats,
        *caveat_of_excluded(verdict.excluded, verdict.rows),
        *split.caveats,
        *([not_tried] if budget.not_tried else []),
        *caveat_of_weights(little, int(split.kept.sum()), alike(runs, little)),
        *(f"{p.title} ({p.name}) is held at the end of its range, {final.parameters[p.name]:g}" for p in held),
        *([f"look at single readings again: {'; '.join(far)}"] if far else []),
        *(words for holds, words in of_fits if holds),
    )
