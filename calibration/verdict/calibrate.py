"""The whole calibration: prepare, explain, describe, and conclude, with the held-out test opened once.

0. Repeats are compared by what the model does not know, and columns with each other
   (`calibration.table.between_repeats`). What differs becomes a number of every fit.
1. Whole sessions are held out before any run is compared with the model (by default the middle one).
   Outliers are excluded (`calibration.statistics.study`).
2. The coefficients and the nuisance parameters are fitted to the other sessions, with weights of the runs if
   some were tracked worse than others (`calibration.statistics.weights`).
3. The residual is tested, and what explains it is looked for (`calibration.verdict.explain`): numbers that are
   wrong, or differ in some runs; effects; pairs. Each is a hypothesis, judged by `calibration.attribution.rules`.
   What the held-out runs refute is withdrawn.
4. If nothing explains the residual, laws that describe it are looked for (`describe`). Where none does, the
   nearest form is adopted (`calibration.verdict.describe`). If something outside the catalogue could imitate what
   is claimed, laws that fit as well are looked for.
5. The verdict (`calibration.attribution.attribution.Attribution.verdict`), with errors on the held-out runs: as
   given, calibrated, with the effect, and from noise alone. If several explanations are left, next runs that would
   tell them apart (`calibration.findings.next_runs`).
6. For use, the model is fitted once more to all runs, the held-out ones included.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any, TypeVar, cast

from calibration.attribution.attribution import Attribution
from calibration.attribution.effects import coefficients_within_range
from calibration.attribution.forms import envelope
from calibration.attribution.hypothesis import Hypothesis
from calibration.attribution.nearest import for_new_specimen, of_new_specimen, size_interval
from calibration.attribution.wrong_numbers import pulls
from calibration.findings.findings import Description, Findings
from calibration.findings.held_out import HeldOutErrors, held_out_errors
from calibration.findings.next_runs import Explanation, next_runs
from calibration.linear.gls import repeat_count
from calibration.statistics.budget import Work, beginning, limited, skipped
from calibration.statistics.checks import predict_as_given
from calibration.statistics.fit import (
    Fit,
    UnsolvedError,
    birge,
    is_free_logarithm,
    profile_end,
    profile_intervals,
)
from calibration.statistics.offsets import Offsets, with_differences
from calibration.statistics.statistical_model import Experiment, ForwardModel, start_values, with_runs
from calibration.statistics.study import (
    DRAWS,
    LEVEL,
    FinalRefit,
    Study,
    far_readings,
    final_refit,
    find_outliers,
    split_runs,
)
from calibration.statistics.traces import whiten_traces
from calibration.statistics.weights import (
    alike,
    caveat_of_weights,
    fit_weighted,
    noise_of_any_run,
    rows_of_little_weight,
)
from calibration.table.excluded import caveat_of_excluded
from calibration.table.runs import FEWEST_REPEATS
from calibration.table.unit_slips import refuse_unit_slips
from calibration.verdict.describe import adopt_in_turns, forms_in_question
from calibration.verdict.explain import explain_and_refute, fit_moves
from calibration.verdict.verdict import Verdict
from common.arrays import Flags, Floats
from common.errors import InputError
from common.provenance import fingerprint

V = TypeVar("V", bound=Verdict)
Intervals = dict[str, tuple[float, float]]
_SEARCH, _DESCRIBED = 0.6, 0.85  # shares of the limit after which no effects and no descriptions are looked for
_TOLD = 3  # single readings
_LAWS_TOLD_APART = 3  # beside a claim; the more there are, the fewer runs tell all of them apart


def calibrate(
    model: Experiment,
    *,
    held_out: Flags | None = None,
    describe: Callable[..., Description | None] | None = None,
    level: float = LEVEL,
    seed: int = 0,
    draws: int = DRAWS,
    limit: Work | None = None,
    progress: bool = True,
    verdict: Callable[..., V] = Verdict,  # type: ignore[assignment]
) -> V:
    """Calibrate a model with its runs, and find what it lacks.

    Args:
        model: its parameters' starts are the model "as given" (uncalibrated).
        held_out: (n,) runs kept for the test, whole sessions; default `study.middle_session`.
        describe: looks for laws where nothing explains the residual, and beside an uncertain claim, such as
            `calibration.laws.laws.find_laws`.
        level: α of every claim.
        seed: of the bootstrap; the same seed gives the same result.
        draws: of the bootstrap. It resolves no smaller p-value than 2/(draws + 1).
        limit: of the search for explanations and descriptions; then the verdict is provisional, and says what was
            not tried. Default: none.
        progress: show progress bars.
        verdict: makes the verdict of what was found, such as one with the corrected robot.
    """
    limit, began, given = limit or Work(), beginning(), model
    model, differences = with_differences(model, held_out, level=level, seed=seed)
    study, base, uncalibrated = first_fit(model, held_out, level=level, seed=seed, draws=draws, progress=progress)
    model = cast(Experiment, study.model)  # with the weights of its runs
    # Explanations come first; what is left of the limit is for descriptions of what nothing explains.
    with limited(limit, _DESCRIBED, began) as budget:
        with limited(limit, _SEARCH, began):
            study, attribution = explain_and_refute(study, base)
        wanted = describe if _law_is_wanted(study, attribution) else None
        beside = _beside_what_no_law_is_sought(study, model) if wanted else ""
        laws = None
        if wanted and not beside:
            laws = wanted(study, attribution.base, beside_claim=bool(attribution.claims))
        if _unexplained(study, attribution) and not (laws and laws.complete):
            attribution = adopt_in_turns(study, attribution)
        of_all, moves = fit_moves(study, model, attribution)
    # A number that differs is stated as all runs show it, the held-out ones included.
    with_moves, moves = (of_all, moves) if of_all else (attribution.base, attribution.moves)
    attribution = replace(attribution, moves=tuple(replace(move, fit=with_moves) for move in moves))
    catalogue = [e.name for e in model.effects]
    findings = verdict(
        **_concluded(study, attribution, uncalibrated, laws, final_refit(of_all) if of_all else None),
        **_given(given),
        verdict=attribution.verdict(level),
        runs=model.runs,
        differences=differences,
        draws=draws,
        fixed_before=fingerprint(
            {"level": level, "seed": seed, "catalogue": catalogue, "locked": study.split.names}
        ),
        not_tried=tuple(budget.not_tried),
        caveats=(),
    )
    return replace(findings, caveats=_caveats(findings, model, budget.not_tried, beside))


def _concluded(
    study: Study,
    attribution: Attribution,
    uncalibrated: Floats,
    laws: Description | None,
    refit: FinalRefit | None,
) -> dict[str, Any]:
    """Open the held-out test, and collect what follows from what was found; `refit`, if it is known already."""
    errors = _errors(study, attribution, uncalibrated, laws)
    rivals = _rivals(study, attribution, laws)
    base_intervals, final_intervals = _both_intervals(study, attribution)
    attribution = replace(attribution, forms=forms_in_question(study, attribution))
    return {
        "split": study.split,
        "attribution": attribution,
        "errors": errors,
        "base_intervals": base_intervals,
        "final_intervals": _over_forms(study, attribution, final_intervals),
        "pulls": pulls(attribution.final, study.model.nuisances),
        "final_refit": refit or _handed_on(study, attribution, errors),
        "law": laws,
        "explanations": tuple(map(Explanation.of, rivals)),
        **_next_runs(rivals, study.seed),
        "little_weight": rows_of_little_weight(study),
    }


def _given(model: Experiment) -> dict[str, Any]:
    """Name what a model has of its own, and what its runs cannot test."""
    return {
        "numbers": tuple(p.name for p in (*model.coefficients, *model.nuisances)),
        "catalogue": tuple(e.name for e in model.effects),
        "untestable": dict(model.untestable),
    }


def _unexplained(study: Study, attribution: Attribution) -> bool:
    return attribution.verdict(study.level) == "unexplained" or not study.model.runs.noise_known


def _law_is_wanted(study: Study, attribution: Attribution) -> bool:
    """Tell whether a law may describe what nothing explains, or imitate an uncertain claim."""
    uncertain = any(claim.doubts for claim in attribution.claims)
    return study.model.runs.noise_known and (_unexplained(study, attribution) or uncertain)


def _beside_what_no_law_is_sought(study: Study, model: Experiment) -> str:
    """Say what the model has that a law is not fitted beside; empty if there is nothing."""
    if isinstance(model, Offsets):
        return "what differs between repeats"
    return "" if study.model is model else "a number that differs in some runs"


def _rivals(study: Study, attribution: Attribution, laws: Description | None) -> tuple[Hypothesis, ...]:
    """List what the runs cannot tell apart, laws last; none if there are not two."""
    rivals = attribution.explanations
    if laws and attribution.verdict(study.level) == "unexplained":
        rivals = laws.rivals
    elif laws and any(claim.doubts for claim in attribution.claims):
        rivals = (*rivals, *laws.as_good_as(attribution.final)[:_LAWS_TOLD_APART])
    if len(rivals) < 2:
        return ()
    # The next runs are not weighted, so they have the noise of any run.
    fits = [replace(rival.fitted, noise=noise_of_any_run(study, rival.fitted.noise)) for rival in rivals]
    return tuple(replace(rival, fit=fit) for rival, fit in zip(rivals, fits, strict=True))


def _both_intervals(study: Study, attribution: Attribution) -> tuple[Intervals, Intervals]:
    """Compute the 95 % intervals of the calibrated model, and of the final one."""
    title = "intervals" if study.progress else ""
    final = base = _intervals(attribution.final, study.split.fitted, title)
    if attribution.final is not attribution.base:  # what an effect is missing from has no use for exact intervals
        base = _intervals(attribution.base, study.split.fitted, title, in_valleys=False)
    b = birge(study.model.runs, attribution.final, study.split.fitted)
    for effect in (e for e in study.model.effects if e.name in final):
        low, high = final[effect.name]
        if low <= effect.start <= high:
            end = profile_end(attribution.final.model, attribution.final, effect.name, study.split.fitted, b)
            if end is not None:
                final[effect.name] = (end, high) if end > effect.start else (low, end)
    if attribution.nearest:
        final[attribution.nearest.effect.name] = size_interval(attribution.nearest)
    return base, final


def _over_forms(study: Study, attribution: Attribution, intervals: Intervals) -> Intervals:
    """Widen the intervals of numbers by those that they have with other forms."""
    wider = {}
    for name, (low, high) in envelope(study, attribution.base.names, attribution.forms).items():
        if name in intervals:
            wider[name] = (min(low, intervals[name][0]), max(high, intervals[name][1]))
    return {**intervals, **wider}


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
    if model.runs.trace is not None:
        study, start = whiten_traces(study, start)
        return *fit_weighted(study, start), study.model.runs.whitened(given)
    guess = model.runs.guessed_noise(study.split.fitted, model.runs.y - given)
    study = replace(study, model=with_runs(model, **guess))
    return *fit_weighted(study, model.guess(start, study.split.fitted)), given


def _intervals(fitted: Fit, used: Flags, title: str, *, in_valleys: bool = True) -> Intervals:
    """Compute 95 % intervals by profile deviance; by the covariance where the model breaks down at their ends."""
    try:
        if not skipped("intervals by profile deviance", 2 * len(fitted.names)):
            return profile_intervals(fitted.model, fitted, used, in_valleys=in_valleys, title=title)
    except InputError:
        pass
    return {name: fitted.interval(name) for name in fitted.names}


def _handed_on(study: Study, attribution: Attribution, errors: HeldOutErrors) -> FinalRefit:
    """Fit the final model to all runs, an adopted form only where it lowers the error on the held-out ones."""
    adopted, final = attribution.nearest, attribution.final
    if adopted and not errors.fall:
        adopted, final = None, attribution.base
    try:
        of_all = final.refitted_fully(study.split.kept)
    except (UnsolvedError, InputError):  # where the model breaks down on the way
        of_all = final.refitted(study.model.runs, study.split.kept)
    refit = final_refit(of_all)
    return for_new_specimen(adopted, refit) if adopted else refit


def _next_runs(rivals: tuple[Hypothesis, ...], seed: int) -> dict[str, Any]:
    """Plan the runs that would tell rivals apart; none without rivals, or if one breaks down at such runs."""
    with suppress(InputError):
        if rivals and not skipped("next runs"):
            return dict(zip(("next_runs", "next_batch"), next_runs(rivals, seed=seed), strict=True))
    return {"next_runs": (), "next_batch": None}


def _errors(
    study: Study, attribution: Attribution, uncalibrated: Floats, laws: Description | None
) -> HeldOutErrors:
    """State the errors of every model on the held-out runs."""
    base, final = attribution.base, attribution.final
    predictions = {"uncalibrated": uncalibrated, "before": base.prediction, "after": final.prediction}
    if laws is not None:
        predictions["law"] = laws.prediction
    if attribution.nearest and attribution.nearest.evidence.sizes:
        with suppress(InputError):  # the simulation may break down at the mean size
            predictions["new_specimen"] = of_new_specimen(attribution.nearest)
    return held_out_errors(study, predictions, base, final)


def _listed(far: list[str]) -> str:
    """List the first of some readings, and say how many others there are."""
    others = f"; and {len(far) - _TOLD} others" if len(far) > _TOLD else ""
    return f"{'; '.join(far[:_TOLD])}{others}"


def _caveats(findings: Findings, model: ForwardModel, ended: Mapping[str, str], beside: str) -> tuple[str, ...]:
    """Say what weakens the conclusion: what was left out or not tried, and why a fit may not be the best one."""
    runs, split, base, final = findings.runs, findings.split, findings.base, findings.final
    when = next(iter(ended.values()), "")
    not_tried = f"provisional: the search ended {when}, and did not try {', '.join(ended)}"
    little = findings.little_weight
    held = [p for p, on_bound in zip(final.fitted, final.held, strict=True) if on_bound]
    unweighted = with_runs(model, weight=None).runs.subset(split.kept)
    far = far_readings(unweighted, (runs.y - final.prediction)[split.kept])
    vague = [
        p.name
        for index, p in enumerate(final.fitted)
        if is_free_logarithm(p) and final.half_width(index) > math.log(2) and p not in held
    ]
    outside = not coefficients_within_range(model, base.parameters)
    repeats = repeat_count(runs.repeat_ids[split.fitted])
    unknown = "there are neither repeats nor a declared noise, so no residual can be told from noise"
    if repeats:
        unknown = (
            f"{repeats} of the {runs.row}s that are fitted are repeats, and without a declared noise "
            f"{FEWEST_REPEATS} are needed to tell a residual from noise"
        )
    if runs.trace is not None:
        unknown = (
            "no two traces have the same settings and times, so the memory of the noise is unknown, and no "
            "residual can be told from it"
        )
    of_fits = (
        (not runs.noise_known, unknown),
        (beside, f"no law was looked for: laws are not fitted beside {beside}"),
        (vague, f"these {runs.row}s determine {' and '.join(vague)} to no better than a factor of two"),
        (outside, "without effects the coefficients run to the end of their range, so every effect was refitted "
         "from the model as given, and it is less sure which effect it is"),
        (not final.converged, "the fit did not converge: do not trust its coefficients"),
    )  # fmt: skip
    return (
        *runs.caveats,
        *caveat_of_excluded(findings.excluded, findings.rows),
        *split.caveats,
        *([not_tried] if ended else []),
        *caveat_of_weights(little, int(split.kept.sum()), alike(runs, little)),
        *(f"{p.title} ({p.name}) is held at the end of its range, {final.parameters[p.name]:g}" for p in held),
        *([f"look at single readings again: {_listed(far)}"] if far else []),
        *(words for holds, words in of_fits if holds),
    )
