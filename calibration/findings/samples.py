"""Draw numbers and effects from what the runs leave open, for anyone who carries a verdict on.

Each form that left-out runs cannot tell from the others gets its share of the samples. Within a form they are
normal, each number on its own scale, with the covariance of the fit to all runs, widened for an estimated noise
and for what the form leaves (Birge 1932).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from calibration.findings.findings import Findings
from calibration.statistics.fit import Fit, birge
from calibration.statistics.study import FinalRefit, final_refit
from common.errors import InputError

FORM = "form"  # the column that names it


def open_forms(result: Findings) -> dict[str, FinalRefit]:
    """Return what is handed on, and then the forms that are as good, each fitted to all runs, by their titles."""
    handed_on = result.final_refit
    if not {p.name for p in handed_on.fitted}.issuperset(result.final.names):  # the form was not kept
        return {"": handed_on}
    forms = sorted(result.forms, key=lambda form: form.fit is not result.final)
    return {form.title: _refit(result, form.fitted) for form in forms} or {"": handed_on}


def _refit(result: Findings, fitted: Fit) -> FinalRefit:
    """Fit a form to all runs; what it leaves counts as noise."""
    refit = result.final_refit
    if fitted is result.final and result.nearest:  # its covariance has that already
        return refit
    if fitted is not result.final:
        refit = final_refit(fitted.refitted(result.runs, result.split.kept))
    return replace(refit, covariance=birge(result.runs, fitted, result.split.fitted) * refit.covariance)


def draw_samples(forms: Mapping[str, FinalRefit], count: int, seed: int) -> pd.DataFrame:
    """Draw `count` rows: a column for each number and effect, and `form`, the title of the row's form.

    An effect that a form does not have is at its null. Rows are in random order.
    """
    if count < 1:
        raise InputError(f"samples: {count}; give a number of rows from 1")
    random, parts = np.random.default_rng(seed), []
    nulls = {p.name: p.start for refit in forms.values() for p in refit.fitted}
    for place, (title, refit) in enumerate(forms.items()):
        share = len(range(place, count, len(forms)))
        steps = random.multivariate_normal(np.zeros(len(refit.fitted)), refit.covariance, share, method="eigh")
        columns = {
            p.name: p.moved(np.full(share, refit.parameters[p.name]), steps[:, at])
            for at, p in enumerate(refit.fitted)
        }
        values = {name: refit.parameters.get(name, null) for name, null in nulls.items()}
        parts.append(pd.DataFrame({**values, **columns, FORM: title}, index=range(share)))
    return pd.concat(parts).iloc[random.permutation(count)].reset_index(drop=True)
