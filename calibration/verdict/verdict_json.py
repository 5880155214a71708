"""verdict.json: the record of a verdict."""

from __future__ import annotations

from typing import Any

from calibration.statistics.pull import Pull
from calibration.verdict.contents import MODELS
from calibration.verdict.next_steps import next_steps
from calibration.verdict.verdict import Verdict
from sim.io.provenance import provenance


def verdict_record(result: Verdict, *, table: str) -> dict[str, Any]:
    """Write a verdict as verdict.json has it; its keys are a format, and older than the names here."""
    final, misfit, learnt, errors = result.final, result.evidence.misfit, result.corrections.learnt, result.errors
    parameter_titles = {p.name: p.title for p in result.base.fitted}
    parameters = {
        name: {
            "value": final.parameters[name],
            "interval": list(result.fits.final_intervals[name]),
            "value_all_runs": result.fits.final_refit.parameters[name],
        }
        for name in final.names
        if name in result.fits.final_refit.parameters
    }
    return {
        "verdict": result.verdict,
        "effects": list(result.effects),
        "sentence": result.sentence,
        "next_steps": next_steps(result),
        "parameters": parameters,
        "in_form_only": list(result.in_form_only),
        "imitability": [c.imitable for c in result.explaining],
        "transfer_p": [c.transfer for c in result.explaining],
        "imitable": any(c.uncertain for c in result.explaining),
        "effects_instead": [[e.name for e in c.claimed] for c in result.evidence.rival_effects],
        "numbers_instead": [p.parameter.name for p in result.evidence.rival_numbers],
        "wrong_numbers": [[p.parameter.name for p in alike] for alike in result.wrong_numbers],
        "numbers_as_given": [_number_record(p) for p in result.fits.pulls],
        "halved_tolerances": [
            {"name": name, "title": parameter_titles[name], "smallest_detectable_sizes_fall_by": gain}
            for name, gain in result.halved_tolerances.items()
        ],
        "moves": [move.record for move in result.moves],
        "nearest": result.nearest.record() if result.nearest else None,
        **{f"error_{name}": errors.rms.get(name) for name in MODELS},
        "harmless": result.harmless,
        "held_out_error_falls": result.held_out_error_falls,
        "error_after_interval": list(errors.after_interval),
        "noise_ceiling": errors.noise,
        "errors_by_output": errors.by_output,
        "p_value": misfit.p_value,
        "p_general": misfit.general_p,
        "p_of_each_test": misfit.p,
        "critical_z": misfit.critical_z,
        "candidates": [
            {
                "effect": c.effect.name,
                "z": c.z,
                "survived_share": c.survived,
                "smallest_detectable": c.detectable,
                "smallest_detectable_if_numbers_were_exact": c.detectable_exact,
                "smallest_detectable_with_half_of_a_tolerance": dict(c.detectable_halved),
                "size": c.refit.parameters[c.effect.name] if c.refit else None,
                "deviance": c.refit.deviance if c.refit else None,
                "session_gain": [c.gain, c.gain_error],
                "verdict": c.verdict,
            }
            for c in result.evidence.candidates
        ],
        "untestable": result.evidence.untestable,
        "generic_features": list(result.corrections.regression.features),
        "correction_terms": list(learnt.terms) if learnt else [],
        "laws": result.corrections.law.to_dict() if result.corrections.law else None,
        "explanations": [e.record() for e in result.next.explanations],
        "sessions": list(result.conditions.sessions),
        "next_runs": [run.record() for run in result.next.runs],
        "next_batch": result.next.batch.record() if result.next.batch else None,
        "locked_test": result.conditions.split.names,
        "locked_p_value": errors.p_value,
        "fixed_before": result.conditions.hash,
        "rows_set_aside": list(result.conditions.excluded),
        "rows_of_little_weight": list(result.conditions.little_weight),
        "limits": list(result.conditions.caveats),
        "table": table,
        "provenance": provenance({"table": table}),
    }


def _number_record(pull: Pull) -> dict[str, Any]:
    nuisance = pull.parameter
    return {
        "name": nuisance.name,
        "title": nuisance.title,
        "given": nuisance.start,
        "sigma": nuisance.sigma,
        "scale": "logarithm" if nuisance.logarithmic else "as it is",
        "change": pull.change,
        "change_error": pull.error,
        "change_by_the_runs_alone": pull.alone,
        "change_by_the_runs_alone_error": pull.alone_error,
        "pull": pull.z,
        "words": pull.words,
    }
