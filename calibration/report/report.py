"""The report of a calibration: what to do next, the errors, the fit, the residuals and the evidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from calibration.attribution.halved_tolerances import notable_gains, overall_gains
from calibration.attribution.refits import IMITABLE, SURE, UNSEEN, Candidate
from calibration.report.error_card import add_errors
from calibration.report.figures import draw_evidence, draw_maps, draw_residuals, draw_sizes, final_model
from calibration.report.law_card import add_laws
from calibration.report.path_card import add_paths
from calibration.report.path_error import PathError
from calibration.report.quantities import (
    detectable,
    direction_in_words,
    fitted_value,
    given,
    output_error,
    output_label,
    plain,
    ranges_in_words,
    size,
    tolerance,
)
from calibration.statistics.exclusions import count_of_rows
from calibration.statistics.fit import Fit, least_determined
from calibration.statistics.pull import WRONG, Pull
from calibration.statistics.statistical_model import Parameter, Runs
from calibration.verdict.next_runs import STOP, Batch
from calibration.verdict.record import facts
from calibration.verdict.verdict import Verdict
from calibration.words.render import next_steps
from sim.io.pages import Page
from sim.io.provenance import code_version

_SETTINGS = {"l_cm": "l [cm]", "omega_rpm": "ω [rpm]"}
_SMALLEST_GAIN = 0.005  # by which half of a tolerance must lower the detectable sizes to be ranked
_TESTS = {"lack": "lack of fit", "kernel": "smooth structure", "shape": "shapes", "score": "effects"}


def write_report(
    result: Verdict, data: Runs, out: str | Path, *, title: str, paths: Sequence[PathError] = ()
) -> None:
    """Write report.html, with a section on the errors on `paths` where there are some."""
    page = Page(f"Calibration: {title}", result.sentence)
    add_sections(page, result, data, paths)
    page.write(out, f"code {code_version()}; fixed before the data was looked at: {result.conditions.hash}")


def add_sections(page: Page, result: Verdict, data: Runs, paths: Sequence[PathError]) -> None:
    """Add the sections of the report."""
    _add_next_steps(page, result)
    add_errors(page, result, data)
    add_paths(page, paths)
    _add_nearest(page, result)
    add_laws(page, result)
    _add_numbers(page, result)
    _add_halved_tolerances(page, result)
    _add_fit(page, result)
    _add_residuals(page, result, data)
    _add_evidence(page, result)
    _add_data(page, result, data)


def _add_next_steps(page: Page, result: Verdict) -> None:
    page.section("What to do next")
    page.steps(next_steps(facts(result)), numbered=True)
    for caveat in result.conditions.caveats:
        page.text(f"The conclusion is weaker: {caveat}.", tone="bad")
    if result.next.batch is not None and result.next.batch.worth_making:
        _add_batch(page, result.next.batch)
    runs = [run for run in result.next_runs if run.worth_making]
    if runs:
        page.text(
            "Single settings that decide when they are repeated. Separation is for the two explanations "
            "that it tells apart least, in units of χ². Settings are those that `--own` named, or the table's."
        )
        settings = list(runs[0].settings)
        page.table(
            (*(_SETTINGS.get(s, s) for s in settings), "repeats", "separation", "decides"),
            [
                (*map(str, r.settings.values()), str(r.repeats), f"{r.separation:.1f}", f"{100 * r.decides:.0f} %")
                for r in runs
            ],
        )


def _add_batch(page: Page, batch: Batch) -> None:
    page.text("Runs to make next:")
    counts: dict[tuple[str, ...], int] = {}
    for settings in batch.settings:
        key = tuple(map(str, settings.values()))
        counts[key] = counts.get(key, 0) + 1
    page.table(
        (*(_SETTINGS.get(s, s) for s in batch.settings[0]), "runs"),
        [(*settings, str(count)) for settings, count in counts.items()],
    )
    page.text(
        f"They would decide in {100 * batch.decides:.0f} % of cases. An explanation is given up when the best one "
        f"is {STOP:.0f} times as likely. So the right one is given up in about {100 / STOP:.0f} % of cases at "
        "most, however often you look."
    )


def _add_nearest(page: Page, result: Verdict) -> None:
    nearest = result.nearest
    if nearest is None:
        return
    effect = nearest.effect
    page.section("The nearest form")
    low, high = (size(effect, end) for end in nearest.interval)
    page.text(
        f"Left-out runs, groups of them in turn, are predicted better with {effect.title}: their log likelihood "
        f"gains {nearest.gain:.0f} ± {nearest.gain_error:.0f}. What is left counts as noise there: it has "
        f"{nearest.birge:.1f} times the variance of the repeats. The mean size is {size(effect, nearest.size)}; "
        f"its 95 % interval, {low} to {high}."
    )
    if nearest.sizes:
        page.figures([(draw_sizes(nearest), f"size of {effect.title} for each specimen", "")])


def _add_numbers(page: Page, result: Verdict) -> None:
    if not result.fits.pulls:
        return
    page.section("Nuisance parameters")
    wrong = [" or ".join(p.parameter.title for p in alike) for alike in result.wrong_numbers]
    page.text(
        "What was given is known to a tolerance only. So these parameters are fitted, too, each with the "
        "tolerance that was stated for it. The pull is how far the runs move a parameter, in standard deviations "
        f"of what chance would do; beyond {WRONG:g} the stated value is taken to be wrong, unless nothing "
        "explains the residual."
    )
    beyond = [p.parameter.title for p in result.fits.pulls if p.wrong]
    if wrong:
        page.text(f"Taken to be wrong: {'; and '.join(wrong)}.", tone="bad")
    elif beyond:
        page.text(
            f"The runs pull beyond {WRONG:g}: {', '.join(beyond)}. Nothing explains the residual, so none of them "
            "is taken to be wrong: what is missing in the model pulls at them, too.",
            tone="bad",
        )
    else:
        page.text("None is taken to be wrong.", tone="good")
    page.table(
        ("parameter", "given", "tolerance (σ)", "fitted", "by the runs alone", "pull"),
        [
            (
                p.parameter.title,
                given(p.parameter),
                tolerance(p.parameter),
                fitted_value(p),
                fitted_value(p, alone=True) if p.learnt else "nothing",
                _pull(p),
            )
            for p in result.fits.pulls
        ],
    )


def _pull(pull: Pull) -> str:
    if not pull.learnt:
        return ""
    return f"{pull.z:+.1f}{f' (beyond {WRONG:g})' if pull.wrong else ''}"


def _add_halved_tolerances(page: Page, result: Verdict) -> None:
    candidates = result.evidence.candidates
    gains, notable = overall_gains(candidates), notable_gains(candidates)
    nuisances = {p.name: p for p in result.base.fitted}
    ranked = [
        f"{nuisances[name].title} ({100 * gain:.1f} %)" for name, gain in gains.items() if gain >= _SMALLEST_GAIN
    ]
    if not ranked:
        return
    page.section("Which number, measured better, would show what")
    page.text(
        "Half of one tolerance lowers the smallest detectable sizes, on average over the effects that these runs "
        f"can show, by: {', '.join(ranked)}. The first is worth measuring better first. All other tolerances stay."
    )
    if not notable:
        page.text("No tolerance lowers the size of a single effect notably.")
        return
    page.table(
        (
            "effect",
            "smallest detectable size",
            "number to measure better",
            "tolerance (σ), today",
            "size with half",
        ),
        [
            (
                halved.effect.effect.words,
                detectable(halved.effect.effect, halved.today),
                nuisances[halved.nuisance].title,
                tolerance(nuisances[halved.nuisance]),
                detectable(halved.effect.effect, halved.halved),
            )
            for halved in notable
        ],
    )


def _add_data(page: Page, result: Verdict, data: Runs) -> None:
    page.section("Data")
    sessions, conditions = len(data.session_names), result.conditions
    page.text(
        f"{len(data)} usable runs in {sessions} session{'s' if sessions > 1 else ''}: "
        f"{ranges_in_words(data.settings)}. Held out for the test: {conditions.split.names}."
    )
    excluded = conditions.summary_of_excluded
    page.text(
        f"Excluded: {count_of_rows(conditions.excluded)} of {conditions.rows} rows{':' if excluded else '.'}"
    )
    if excluded:
        page.steps(excluded)
    scatter = np.sqrt(np.diag(result.base.noise.run)).tolist()
    noise = ", ".join(
        f"{output_label(o)} {output_error(o, s)}" for o, s in zip(data.outputs, scatter, strict=True)
    )
    share = math.sqrt(result.final.noise.share)
    if sessions == 1:
        shift = f"With one session its shift cannot be measured; {100 * share:.0f} % of the scatter is assumed."
    elif share < 0.005:
        shift = "No shift of whole sessions can be seen beside it."
    else:
        shift = f"A session shifts all its runs by {100 * share:.0f} % of that."
    page.text(f"Scatter of one run, from the repeats: {noise}. {shift}")


def _add_fit(page: Page, result: Verdict) -> None:
    page.section("Fit")
    refit = result.fits.final_refit
    stated = {p.parameter.name for p in result.fits.pulls}
    models: list[tuple[str, Fit, dict[str, tuple[float, float]]]] = [
        ("calibrated", result.base, result.fits.base_intervals)
    ]
    if final_model(result):
        models.append((final_model(result), result.final, result.fits.final_intervals))
    shown = refit.parameters.keys() - stated  # sizes of single specimens have their own section
    fitted = {p.name: p for _, fit, _ in models for p in fit.fitted if p.name in shown}
    page.table(
        ("parameter", *(name for name, _, _ in models), "fitted to all runs"),
        [
            (
                p.title,
                *(_with_interval(p, fit, intervals) for _, fit, intervals in models),
                size(p, refit.parameters[p.name], 4),
            )
            for p in fitted.values()
        ],
    )
    page.text(
        "In brackets: 95 % interval, by profile deviance. The last column is handed on: the model fitted once "
        "more to all runs, with the held-out ones."
    )
    if any(p.logarithmic and p.sigma is None for p in result.final.fitted):
        direction, error = least_determined(result.final)
        page.text(
            "What the runs determine worst: one standard deviation is "
            f"{direction_in_words(direction, error)}, together."
        )


def _with_interval(parameter: Parameter, fit: Fit, intervals: dict[str, tuple[float, float]]) -> str:
    if parameter.name not in fit.names:
        return "–"
    low, high = intervals[parameter.name]
    value = size(parameter, fit.parameters[parameter.name], 4)
    return f"{value} ({plain(low * parameter.shown, 4)} to {plain(high * parameter.shown, 4)})"


def _add_residuals(page: Page, result: Verdict, data: Runs) -> None:
    page.section("Residuals on the runs that were fitted")
    setting, (kind, _, _) = data.drawn
    page.text(f"Measured minus model, of every run, against {setting}; colours are {kind}.")
    page.figures(
        [
            (figure, f"residuals by output and {kind}, {model}", model)
            for figure, model in draw_residuals(result, data)
        ]
    )
    page.text(
        "Where the residual is large: each output along each input, square and product, in standard deviations. "
        "Red: measured above the model. Numbers where it is beyond 3."
    )
    page.figures(
        [
            (figure, f"map of the residual over the runs' inputs, {model}", model)
            for figure, model in draw_maps(result, data.outputs)
        ]
    )


def _add_evidence(page: Page, result: Verdict) -> None:
    page.section("Evidence for each effect of the catalogue")
    misfit = result.evidence.misfit
    each = ", ".join(f"{_TESTS[name]} {plain(p, 2)}" for name, p in misfit.p.items())
    page.text(
        f"Is there more than noise? p = {plain(misfit.p_value, 2)} by all tests together ({each}). The score of "
        "an effect is how well it fits the residual, without the part that the coefficients and the nuisance "
        f"parameters can absorb; a claim needs more than {misfit.critical_z:.2f} (dashed). Green: explains the "
        "residual. Orange: refitted and rejected."
    )
    page.figures([(draw_evidence(result), "score of each effect against what a claim needs", "")])
    page.text(
        "The smallest detectable size is found half of the time. The column beside it is that size if every "
        "nuisance parameter were exact."
    )
    seen = [c for c in result.evidence.candidates if c.detectable < UNSEEN]
    page.table(
        ("effect", "score z", "not absorbed", "smallest detectable size", "with exact numbers", "judgement"),
        [
            (
                c.effect.words,
                f"{c.z:+.1f}",
                f"{100 * c.survived:.0f} %",
                detectable(c.effect, c.detectable),
                detectable(c.effect, c.detectable_exact),
                c.verdict,
            )
            for c in seen
        ],
    )
    unseen = [c.effect.words for c in result.evidence.candidates if c.detectable >= UNSEEN]
    if unseen:
        page.text(f"These effects change nothing in these runs, whatever their size: {'; '.join(unseen)}.")
    for c in result.explaining:
        page.text(
            f"{c.title}: {100 * c.imitable:.0f} % of the departures from outside the catalogue that were drawn "
            f"for comparison would have passed for it; above {100 * IMITABLE:.0f} % the verdict says so. "
            + _carried(c)
        )
    if result.evidence.untestable:
        page.text("Not tested, because data are missing:")
        page.steps([f"{title}: {why}" for title, why in result.evidence.untestable.items()])


def _carried(claim: Candidate) -> str:
    if claim.transfer == 1.0:
        return ""
    words = "predicts" if claim.transfer >= SURE else "does not predict"
    return f"Fitted to short tails and few of them, it {words} the other runs (p = {claim.transfer:.3f})."
