"""Deprecated attributes of a verdict, and where they are now."""

from __future__ import annotations

OLD_NAMES = {
    "base_intervals": "fits.base_intervals",
    "final_intervals": "fits.final_intervals",
    "misfit": "evidence.misfit",
    "draws": "evidence.draws",
    "candidates": "evidence.candidates",
    "numbers": "fits.pulls",
    "instead": "evidence.rival_effects",
    "generic": "corrections.regression",
    "predictive": "corrections.learnt",
    "explanations": "next.explanations",
    "next_batch": "next.batch",
    "error_after_interval": "errors.after_interval",
    "locked_p": "errors.p_value",
    "delivered": "fits.final_refit",
    "errors_by_output": "errors.by_output",
    "locked": "conditions.split.names",
    "sessions": "conditions.sessions",
    "used": "conditions.split.fitted",
    "uncalibrated": "fits.uncalibrated",
    "untestable": "evidence.untestable",
    "plan_hash": "conditions.hash",
    "set_aside": "conditions.excluded",
    "limits": "conditions.caveats",
}
