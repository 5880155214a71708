"""The record of a verdict: the content of verdict.json, flat, from which every text is made.

Its keys are a format, and older than the names here. `calibration.words` has the texts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from calibration.attribution.hypothesis import Hypothesis, Reason
from calibration.attribution.nearest import largest_along, size_interval
from calibration.attribution.rules import UNSEEN, refuting, shift_of
from calibration.attribution.wrong_numbers import notable_pull
from calibration.findings.findings import Findings
from calibration.linear.gls import inverse_root
from calibration.statistics.fit import Fit, Pull, is_free_logarithm, least_determined
from calibration.statistics.statistical_model import Parameter
from calibration.table.between_repeats import Difference
from calibration.table.excluded import count_of_rows
from calibration.table.runs import Runs
from calibration.words.quantities import difference_in_words, move_in_words
from calibration.words.render import badges, headline, next_steps, sentence
from common.provenance import provenance

MODELS = ("uncalibrated", "before", "after", "law", "new_specimen")  # with stated errors
_REPEATED = 5  # settings that are proposed for repeats where nothing explains the residual
_NORMAL = 1.959964  # standard deviations to the ends of a 95 % interval
_NEAR = 0.5  # share of the residual that the best effect must remove to be named where none explains it


def verdict_record(record: Mapping[str, Any], *, table: str) -> dict[str, Any]:
    """Write the facts of a verdict as verdict.json has them, with its texts; `path` has errors on paths."""
    return {
        **{key: record[key] for key in ("verdict", "effects")},
        "headline": headline(record),
        "badges": badges(record),
        "sentence": sentence(record),
        "next_steps": next_steps(record),
        **record,
        "table": table,
        "provenance": provenance({"table": table}),
        "path": None,
    }


def facts(result: Findings) -> dict[str, Any]:
    """Collect what a verdict is made of: numbers and names, without sentences."""
    return {
        "verdict": result.verdict,
        "effects": list(result.effects),
        **_fitted(result),
        **_claims(result),
        **_numbers(result),
        **_errors(result),
        **_tests(result),
        "laws": result.law.to_dict(result.final if result.claims else None) if result.law else None,
        "described": result.described,
        **_next(result),
        **_data(result),
    }


def corrected_record(result: Findings) -> dict[str, Any]:
    """Collect what is handed on, for corrected.json: numbers of the model, its effects, and their covariance."""
    refit, effects = result.final_refit, set(result.catalogue)
    values: dict[str, dict[str, Any]] = {"numbers": {}, "effects": {}}
    indices = [index for index, p in enumerate(refit.fitted) if p in result.handed_on]
    for index, parameter in zip(indices, result.handed_on, strict=True):
        half = _NORMAL * math.sqrt(refit.covariance[index, index])
        value = refit.parameters[parameter.name]
        alone = [float(parameter.changed(value, end)) for end in (-half, half)]
        interval = list(result.final_intervals.get(parameter.name, alone))
        kind = values["effects" if parameter.name in effects else "numbers"]
        if parameter.of_group:
            number, group = parameter.of_group
            of_number = kind.setdefault(number, {"unit": parameter.unit, "of": {}})
            of_number["of"][group] = {"value": value, "interval": interval}
            continue
        kind[parameter.name] = {
            "title": parameter.title,
            "unit": parameter.unit,
            "value": value,
            "interval": interval,
            "given": parameter.start,
            "scale": "logarithm" if parameter.logarithmic else "as it is",
        }
    covariance = refit.covariance[np.ix_(indices, indices)].tolist()
    return {
        **values,
        "covariance": {"names": [p.name for p in result.handed_on], "on_their_scales": covariance},
        "forms": [form_record(form) for form in result.forms],
        "verdict": result.verdict,
    }


def shown(parameter: Parameter) -> dict[str, Any]:
    """Write what a reader needs with a number: its title, unit, and value as given (of an effect its null)."""
    return {
        "title": parameter.title,
        "unit": parameter.unit,
        "shown": parameter.shown,
        "given": parameter.start,
        "theory": parameter.theory,
        "scale": "logarithm" if parameter.logarithmic else "as it is",
    }


def _fitted(result: Findings) -> dict[str, Any]:
    final, refit = result.final, result.final_refit.parameters
    fitted = {p.name: p for p in (*result.base.fitted, *final.fitted)}
    intervals = result.final_intervals
    values = {
        name: {
            **shown(fitted[name]),
            "value": final.parameters[name],
            "interval": list(intervals[name]),
            "value_all_runs": refit[name],
        }
        for name in final.names
        if name in refit
    }
    own = {name: of.of_group for name, of in fitted.items() if of.of_group}
    of_groups: dict[str, dict[str, Any]] = {}
    for name, (number, group) in own.items():
        if name in values:
            of_groups.setdefault(number, {})[group] = values.pop(name)
    return {
        "parameters": values,
        "numbers_of_groups": of_groups,
        "parameters_without_effects": {
            name: {"value": result.base.parameters[name], "interval": list(interval)}
            for name, interval in result.base_intervals.items()
            if name not in own
        },
        "least_determined": _least_determined(final),
        "subject": result.runs.subject,
        "row": result.runs.row,
    }


def _least_determined(final: Fit) -> dict[str, Any] | None:
    """Write the direction in the coefficients that the runs determine worst, and its standard deviation."""
    if not any(map(is_free_logarithm, final.fitted)):
        return None
    direction, error = least_determined(final)
    return {"direction": direction, "error": error}


def _claims(result: Findings) -> dict[str, Any]:
    attribution, claims = result.attribution, result.claims
    return {
        "claims": [{"title": c.title, "words": c.words, "effects": [e.name for e in c.added]} for c in claims],
        "in_form_only": list(result.in_form_only),
        "imitability": [c.evidence.imitable for c in claims],
        "transfer_p": [c.evidence.transfer for c in claims],
        "imitable": any(c.doubts for c in claims) or bool(claims and result.gain_is_certain is False),
        "effects_instead": [[e.name for e in c.added] for c in attribution.rival_effects],
        "claims_instead": [c.title for c in attribution.rival_effects],
        "nearest": _adopted(result.nearest, attribution.forms, result.runs) if result.nearest else None,
        "nearest_candidate": _nearest_candidate(result),
        "not_fitted": [{"title": c.title, "reason": c.why} for c in result.not_fitted],
        "halving": result.halving,
        "certain": [e.name for e in result.certain],
        "undecided": [" and ".join(e.title for e in rest) for rest in result.undecided],
        "candidates": [_candidate(c) for c in attribution.candidates],
        "untestable": result.untestable,
        "forms": [form_record(form) for form in attribution.forms],
        "turns": [vars(turn) for turn in attribution.turns],
    }


def _candidate(c: Hypothesis) -> dict[str, Any]:
    evidence = c.evidence
    return {
        "effect": c.effect.name,
        **shown(c.effect),
        "bounds": list(c.effect.bounds),
        "shows": (evidence.detectable or 0.0) < UNSEEN,
        "z": c.score,
        "survived_share": evidence.survived,
        "smallest_detectable": evidence.detectable,
        "smallest_detectable_if_numbers_were_exact": evidence.detectable_exact,
        "size": c.size if c.fit else None,
        "deviance": c.fit.deviance if c.fit else None,
        "session_gain": evidence.session_gain and list(evidence.session_gain),
        "left_out_error_ratio": evidence.left_out,
        "verdict": c.why,
    }


def form_record(form: Hypothesis) -> dict[str, Any]:
    """Write a form: its effects with their sizes, and its error on left-out runs."""
    return {
        "title": form.title,
        "sizes": {e.name: form.fitted.parameters[e.name] for e in form.added},
        "theory": form.at_theory,
        "error": form.evidence.left_out_error,
    }


def _adopted(form: Hypothesis, alike: Sequence[Hypothesis], runs: Runs) -> dict[str, Any]:
    evidence = form.evidence
    assert evidence.remainder is not None
    assert evidence.paired is not None
    return {
        **shown(form.effect),
        "effect": form.effect.name,
        "mean": form.size,
        "interval": list(size_interval(form)),
        "spread": evidence.spread,
        "scale": "logarithm" if form.logarithmic else "as it is",
        "sizes": {name: list(size) for name, size in evidence.sizes.items()},
        "sizes_of": _specimens_in_words(runs),
        "removed_share": min(evidence.removed or 0.0, 1.0),
        "session_gain": [evidence.paired.gain, evidence.paired.error],
        "birge": evidence.birge,
        "remainder": evidence.remaining,
        "remainder_p": evidence.remainder.p_value,
        "largest_along": largest_along(evidence.remainder, runs),
        "as_well": [other.title for other in alike if other.fit is not form.fit],
        "at_theory": form.at_theory,
    }


def _specimens_in_words(runs: Runs) -> str:
    if runs.specimen is not None:
        return "specimens"
    return "sessions" if runs.trace is None else "sessions of traces"


def _withdrawn(claim: Hypothesis) -> dict[str, Any]:
    refuted = refuting(claim)[0]
    return {
        "title": " and ".join(e.title for e in claim.added),
        "effects": [e.name for e in claim.added],
        "on": refuted.names,
        "error_before": refuted.before,
        "error_after": refuted.after,
    }


def _move(move: Hypothesis, runs: Runs) -> dict[str, Any]:
    shift, name = shift_of(move), move.effect.name
    record = {
        "number": shift.parameter.name,
        "where": shift.where,
        "change": move.size,
        "interval": list(move.fitted.interval(name)),
        "scale": "logarithm" if shift.parameter.logarithmic else "as it is",
        "score": move.score,
        "instead": list(move.evidence.instead),
    }
    number = shift.parameter
    return {
        "words": move_in_words(record, move.effect.title, number.shown, number.unit, runs.row),
        **record,
    }


def _nearest_candidate(result: Findings) -> dict[str, Any] | None:
    """Find the single effect that removes most of the residual, if one was refitted and removes much."""
    refits = [(c.fit.deviance, c.effect.title, c.why) for c in result.attribution.candidates if c.fit]
    if not refits:
        return None
    (deviance, title, reason), before = min(refits), result.base.deviance
    expected = int(result.split.fitted.sum()) * result.base.prediction.shape[1]
    share = (before - deviance) / max(before - expected, 1e-9)
    return {"title": title, "removed_share": share, "reason": reason} if share >= _NEAR else None


def _numbers(result: Findings) -> dict[str, Any]:
    pulls, number = result.pulls, result.attribution.number
    learnt = [p for p in pulls if p.learnt]
    explained = result.verdict not in ("partial", "unexplained")
    notable = explained and learnt and abs(learnt[0].z) > notable_pull(len(learnt))
    return {
        "number_check": _number_check(number) if number and result.attribution.number_leads else None,
        "numbers_instead": [p.parameter.name for p in result.attribution.rival_numbers],
        "rival_numbers": [_number(p) for p in result.attribution.rival_numbers],
        "wrong_numbers": [[p.parameter.name for p in alike] for alike in result.wrong_numbers],
        "wrong_number_records": [[_number(p) for p in alike] for alike in result.wrong_numbers],
        "notable_number": learnt[0].words if notable else None,
        "numbers_as_given": [_number(p) for p in pulls],
        "differences": [_difference(d, result.runs) for d in result.differences],
        "moves": [_move(move, result.runs) for move in result.moves],
    }


def _number_check(number: Hypothesis) -> dict[str, Any]:
    return {
        "imitable": number.evidence.imitable,
        "transfer": number.evidence.transfer,
        "tolerances": max(pull.tolerances for pull in number.evidence.pulls),
        "implausible": Reason.IMPLAUSIBLE in number.doubts,
        "uncertain": bool(number.doubts),
    }


def _difference(d: Difference, runs: Runs) -> dict[str, Any]:
    names = ("output", "column", "where", "against", "of_reading", "kind", "size", "z", "p")
    record = {name: getattr(d, name) for name in names} | {"instead": list(d.instead), "numbers": list(d.numbers)}
    return {"words": difference_in_words(_outputs(runs), record), **record}


def _number(pull: Pull) -> dict[str, Any]:
    return {
        "name": pull.parameter.name,
        **shown(pull.parameter),
        "sigma": pull.parameter.sigma,
        "change": pull.change,
        "change_error": pull.error,
        "change_by_the_runs_alone": pull.alone,
        "change_by_the_runs_alone_error": pull.alone_error,
        "pull": pull.z,
        "learnt": pull.learnt,
        "wrong": pull.wrong,
        "tolerances": pull.tolerances,
        "departure": pull.departure,
        "words": pull.words,
    }


def _errors(result: Findings) -> dict[str, Any]:
    errors = result.errors
    return {
        **{f"error_{name}": errors.rms.get(name) for name in MODELS},
        "models": result.models,
        "error_corrected": result.error_corrected,
        "harmless": result.harmless,
        "held_out_error_falls": result.held_out_error_falls,
        "advice": result.advice,
        "error_after_interval": list(errors.after_interval),
        "gain_interval": errors.gain_interval and list(errors.gain_interval),
        "gain_is_certain": result.gain_is_certain,
        "errors_of_conditions": vars(errors.of_conditions) if errors.of_conditions else None,
        "withdrawn": [_withdrawn(claim) for claim in result.withdrawn],
        "noise_ceiling": errors.noise,
        "noise_known": result.runs.noise_known,
        "errors_by_output": errors.by_output,
        "locked_test": result.split.names,
        "locked_p_value": errors.p_value,
        "held_out_runs_agree": result.held_out_runs_agree,
    }


def _tests(result: Findings) -> dict[str, Any]:
    misfit = result.attribution.misfit
    return {
        "p_value": misfit.p_value,
        "p_general": misfit.general_p,
        "p_of_each_test": misfit.p,
        "critical_z": misfit.critical_z,
        "draws": result.draws,
        "largest_along": largest_along(misfit, result.runs),
        "largest_departures": _largest_departures(result),
    }


def _largest_departures(result: Findings) -> list[dict[str, Any]]:
    """List the settings at which fitted runs depart most from the calibrated model, the farthest first.

    A departure is the root mean square, over the outputs, of the mean over repeats in its standard deviations.
    """
    runs, used = result.runs, result.split.fitted
    white = (
        runs.scale[:, None] * (runs.y - result.base.prediction) @ inverse_root(result.base.noise.run_covariance).T
    )
    departures: dict[tuple[str, ...], float] = {}
    for together in np.unique(runs.together[used]):
        rows = used & (runs.together == together)
        mean = white[rows].sum(0) / math.sqrt(rows.sum())
        settings = {name: of for name, of in runs.settings.items() if name != runs.time_name or runs.trace is None}
        at = tuple(f"{name} = {v[rows][0]:.4g}{unit}" for name, (v, unit) in settings.items())
        departures[at] = max(departures.get(at, 0.0), float(np.sqrt((mean**2).mean())))
    ranked = sorted(departures.items(), key=lambda item: -item[1])[:_REPEATED]
    return [{"at": list(at), "departure": departure} for at, departure in ranked]


def _next(result: Findings) -> dict[str, Any]:
    return {
        "explanations": [e.record() for e in result.explanations],
        "next_runs": [run.record() for run in result.next_runs],
        "next_batch": result.next_batch.record() if result.next_batch else None,
    }


def _outputs(runs: Runs) -> dict[str, Any]:
    return {
        "output_titles": {name: runs.title_of(name) for name in runs.outputs},
        "output_scales": {name: list(runs.scale_of(name)) for name in runs.outputs},
    }


def _data(result: Findings) -> dict[str, Any]:
    runs = result.runs
    scatter = runs.deviations(result.base.noise.run_covariance).tolist()
    ratios = np.broadcast_to(result.final.noise.session_ratio, len(runs.outputs)).tolist()
    ratio = dict(zip(runs.outputs, ratios, strict=True))
    reached = [name for rows, kind in runs.pieces if runs.along[rows].any() for name in kind.outputs] or ratio
    settings = runs.settings.items()
    return {
        "outputs": list(runs.outputs),
        **_outputs(runs),
        "number_of_runs": len(runs),
        "number_of_held_out_runs": int(result.split.test.sum()),
        "settings": {name: [float(v.min()), float(v.max()), unit] for name, (v, unit) in settings},
        "drawn_against": [runs.drawn[0], runs.drawn[1][0]],
        "scatter_of_a_run": dict(zip(runs.outputs, scatter, strict=True)),
        "scatter_of_sessions": math.sqrt(np.mean([ratio[name] for name in reached])),
        "scatter_of_sessions_by_output": {name: math.sqrt(ratio[name]) for name in reached},
        "sessions": list(runs.session_names),
        "fixed_before": result.fixed_before,
        "rows": result.rows,
        "rows_set_aside": list(map(str, result.excluded)),
        "number_of_rows_set_aside": count_of_rows(result.excluded),
        "summary_of_rows_set_aside": result.summary_of_excluded,
        "rows_of_little_weight": list(result.little_weight),
        "not_tried": list(result.not_tried),
        "limits": list(result.caveats),
    }
