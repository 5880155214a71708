"""The record of a verdict: the content of verdict.json, flat, from which every text is made.

Its keys are a format, and older than the names here. `calibration.words` has the texts.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from calibration.attribution.nearest import largest_along
from calibration.attribution.refits import UNSEEN, Candidate
from calibration.attribution.wrong_numbers import notable_pull
from calibration.statistics.between_repeats import Difference
from calibration.statistics.excluded import count_of_rows
from calibration.statistics.fit import Fit, Pull, least_determined
from calibration.statistics.gls import inverse_root
from calibration.statistics.statistical_model import Parameter, Runs
from calibration.verdict.findings import Findings
from calibration.words.quantities import difference_in_words
from calibration.words.render import next_steps, sentence
from common.provenance import provenance

MODELS = ("uncalibrated", "before", "after", "law", "new_specimen")  # with stated errors
_REPEATED = 5  # settings that are proposed for repeats where nothing explains the residual
_NEAR = 0.5  # share of the residual that the best effect must remove to be named where none explains it


def verdict_record(result: Findings, *, table: str, path: dict[str, Any] | None = None) -> dict[str, Any]:
    """Write a verdict as verdict.json has it, with the errors on paths."""
    record = facts(result)
    return {
        **{key: record[key] for key in ("verdict", "effects")},
        "sentence": sentence(record),
        "next_steps": next_steps(record),
        **record,
        "table": table,
        "provenance": provenance({"table": table}),
        "path": path,
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
        "laws": result.law.to_dict(result.final if result.explaining else None) if result.law else None,
        "described": result.described,
        **_next(result),
        **_data(result),
    }


def shown(parameter: Parameter) -> dict[str, Any]:
    """Write what a reader needs with a number: its title, unit, and value as given (of an effect its null)."""
    return {
        "title": parameter.title,
        "unit": parameter.unit,
        "shown": parameter.shown,
        "given": parameter.start,
        "scale": "logarithm" if parameter.logarithmic else "as it is",
    }


def _fitted(result: Findings) -> dict[str, Any]:
    final, refit = result.final, result.final_refit.parameters
    fitted = {p.name: p for p in (*result.base.fitted, *final.fitted)}
    intervals = result.final_intervals
    return {
        "parameters": {
            name: {
                **shown(fitted[name]),
                "value": final.parameters[name],
                "interval": list(intervals[name]),
                "value_all_runs": refit[name],
            }
            for name in final.names
            if name in refit
        },
        "parameters_without_effects": {
            name: {"value": result.base.parameters[name], "interval": list(interval)}
            for name, interval in result.base_intervals.items()
        },
        "least_determined": _least_determined(final),
        "subject": result.runs.subject,
    }


def _least_determined(final: Fit) -> dict[str, Any] | None:
    """Write the direction in the coefficients that the runs determine worst, and its standard deviation."""
    if not any(p.logarithmic and p.sigma is None for p in final.fitted):
        return None
    direction, error = least_determined(final)
    return {"direction": direction, "error": error}


def _claims(result: Findings) -> dict[str, Any]:
    found, nearest = result.found, result.nearest
    return {
        "claims": [
            {"title": c.title, "words": c.words, "effects": [e.name for e in c.claimed]} for c in result.explaining
        ],
        "in_form_only": list(result.in_form_only),
        "imitability": [c.imitable for c in result.explaining],
        "transfer_p": [c.transfer for c in result.explaining],
        "imitable": any(c.uncertain for c in result.explaining)
        or bool(result.explaining and result.gain_is_certain is False),
        "effects_instead": [[e.name for e in c.claimed] for c in found.rival_effects],
        "claims_instead": [c.title for c in found.rival_effects],
        "nearest": {**shown(nearest.effect), **nearest.record()} if nearest else None,
        "nearest_candidate": _nearest_candidate(result),
        "not_fitted": [{"title": c.title, "reason": c.reason} for c in result.not_fitted],
        "halving": result.halving,
        "certain": [e.name for e in result.certain],
        "undecided": [" and ".join(e.title for e in rest) for rest in result.undecided],
        "candidates": [_candidate(c) for c in found.candidates],
        "untestable": result.untestable,
        "forms": [form.record() for form in result.forms],
        "turns": [vars(turn) for turn in result.turns],
    }


def _candidate(c: Candidate) -> dict[str, Any]:
    return {
        "effect": c.effect.name,
        **shown(c.effect),
        "bounds": list(c.effect.bounds),
        "shows": c.detectable < UNSEEN,
        "z": c.z,
        "survived_share": c.survived,
        "smallest_detectable": c.detectable,
        "smallest_detectable_if_numbers_were_exact": c.detectable_exact,
        "size": c.refit.parameters[c.effect.name] if c.refit else None,
        "deviance": c.refit.deviance if c.refit else None,
        "session_gain": [c.gain, c.gain_error],
        "left_out_error_ratio": None if math.isnan(c.left_out) else c.left_out,
        "verdict": c.reason,
    }


def _nearest_candidate(result: Findings) -> dict[str, Any] | None:
    """Find the single effect that removes most of the residual, if one was refitted and removes much."""
    refits = [(c.refit.deviance, c.effect.title, c.reason) for c in result.found.candidates if c.refit]
    if not refits:
        return None
    (deviance, title, reason), before = min(refits), result.base.deviance
    expected = int(result.split.fitted.sum()) * result.base.prediction.shape[1]
    share = (before - deviance) / max(before - expected, 1e-9)
    return {"title": title, "removed_share": share, "reason": reason} if share >= _NEAR else None


def _numbers(result: Findings) -> dict[str, Any]:
    pulls = result.pulls
    learnt = [p for p in pulls if p.learnt]
    explained = result.verdict not in ("partial", "unexplained")
    notable = explained and learnt and abs(learnt[0].z) > notable_pull(len(learnt))
    return {
        "number_check": result.found.number_check and result.found.number_check.record(),
        "numbers_instead": [p.parameter.name for p in result.found.rival_numbers],
        "rival_numbers": [_number(p) for p in result.found.rival_numbers],
        "wrong_numbers": [[p.parameter.name for p in alike] for alike in result.wrong_numbers],
        "wrong_number_records": [[_number(p) for p in alike] for alike in result.wrong_numbers],
        "notable_number": learnt[0].words if notable else None,
        "numbers_as_given": [_number(p) for p in pulls],
        "differences": [_difference(d, result.runs) for d in result.differences],
        "moves": [{"words": move.words, **move.record} for move in result.moves],
    }


def _difference(d: Difference, runs: Runs) -> dict[str, Any]:
    names = ("output", "column", "where", "against", "of_reading", "size", "z", "p")
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
        "error_corrected": result.error_corrected,
        "harmless": result.harmless,
        "held_out_error_falls": result.held_out_error_falls,
        "advice": result.advice,
        "error_after_interval": list(errors.after_interval),
        "gain_interval": errors.gain_interval and list(errors.gain_interval),
        "gain_is_certain": result.gain_is_certain,
        "errors_of_conditions": vars(errors.of_conditions) if errors.of_conditions else None,
        "withdrawn": [claim.record() for claim in result.withdrawn],
        "noise_ceiling": errors.noise,
        "noise_known": result.runs.noise_known,
        "errors_by_output": errors.by_output,
        "locked_test": result.split.names,
        "locked_p_value": errors.p_value,
        "held_out_runs_agree": result.held_out_runs_agree,
    }


def _tests(result: Findings) -> dict[str, Any]:
    misfit = result.found.misfit
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
    found: dict[tuple[str, ...], float] = {}
    for condition in np.unique(runs.condition[used]):
        rows = used & (runs.condition == condition)
        mean = white[rows].sum(0) / math.sqrt(rows.sum())
        at = tuple(f"{name} = {v[rows][0]:.4g}{unit}" for name, (v, unit) in runs.settings.items())
        found[at] = max(found.get(at, 0.0), float(np.sqrt((mean**2).mean())))
    ranked = sorted(found.items(), key=lambda item: -item[1])[:_REPEATED]
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
    scatter = np.sqrt(np.diag(result.base.noise.run_covariance)).tolist()
    settings = runs.settings.items()
    return {
        "outputs": list(runs.outputs),
        **_outputs(runs),
        "number_of_runs": len(runs),
        "number_of_held_out_runs": int(result.split.test.sum()),
        "settings": {name: [float(v.min()), float(v.max()), unit] for name, (v, unit) in settings},
        "drawn_against": [runs.drawn[0], runs.drawn[1][0]],
        "scatter_of_a_run": dict(zip(runs.outputs, scatter, strict=True)),
        "scatter_of_sessions": math.sqrt(np.mean(result.final.noise.session_ratio)),
        "scatter_of_sessions_by_output": dict(
            zip(runs.outputs, np.sqrt(result.final.noise.session_ratio).tolist(), strict=True)
        ),
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
