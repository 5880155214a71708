"""Forms that left-out runs cannot tell apart, and the intervals of numbers over all of them.

A form is the model with one effect, of fitted size or of the size that theory gives. Two forms are compared on the
fitted runs, each run predicted from the other sessions (`calibration.attribution.left_out`). Beside a claim, which
leaves no more than noise, a form whose error on left-out runs is `_FARTHER` times as large is none, however much
it owes to one condition.

Each number of the model has the envelope of its intervals over the forms that are as good as the best one. What a
form leaves counts as noise (Birge 1932). The envelope is right among the forms that were tried, and only there.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from calibration.attribution.hypothesis import Hypothesis, Origin
from calibration.attribution.left_out import left_out_error, paired_gain
from calibration.statistics.budget import skipped
from calibration.statistics.fit import Fit, birge, fit
from calibration.statistics.study import Study

_FARTHER = 1.5  # error of a form over that of a claim, which leaves no more than noise


def at_theory(study: Study, base: Fit) -> list[Hypothesis]:
    """Fit the model with each effect of the size that theory gives, if it gives one, and with all of them."""
    known = [(e,) for e in study.effects if e.theory is not None]
    together = [sum(known, ())] if len(known) > 1 else []
    forms = []
    for some in (*known, *together):
        if skipped("forms at the size of theory"):
            break
        start = {**base.parameters, **{e.name: e.theory for e in some}}
        form = Hypothesis(Origin.THEORY, some, fit(study.model, start, base.names, study.split.fitted, title=""))
        if np.isfinite(form.fitted.prediction).all():  # the model can be solved there
            forms.append(form)
    return forms


def forms_of_claims(
    study: Study, base: Fit, claims: Sequence[Hypothesis], candidates: Sequence[Hypothesis]
) -> list[Hypothesis]:
    """List claims that explain the runs, and the forms that left-out runs cannot tell from the best one.

    Those at the size of theory come first. An effect that was fitted counts also where it was not kept.
    """
    known = {claim.added for claim in claims}
    further = [c for c in candidates if c.added not in known and c.fit and c.fit.converged]
    alike = [claim.seen(left_out_error=left_out_error(study, claim.fitted)) for claim in claims]
    most = _FARTHER * (alike[0].evidence.left_out_error or 0.0)
    near = [form for form in as_good(study, claims[0], [*at_theory(study, base), *further])
            if (form.evidence.left_out_error or 0.0) < most]  # fmt: skip
    return [*(f for f in near if f.at_theory), *alike, *(f for f in near if not f.at_theory)]


def as_good(study: Study, best: Hypothesis, forms: Iterable[Hypothesis]) -> list[Hypothesis]:
    """Choose the forms that left-out runs cannot tell from the best one, and state their errors on these."""
    alike = [f for f in forms if f.fit is best.fit or not paired_gain(study, best.fitted, f.fitted).certain]
    return [form.seen(left_out_error=left_out_error(study, form.fitted)) for form in alike]


def envelope(study: Study, names: Sequence[str], forms: Sequence[Hypothesis]) -> dict[str, tuple[float, float]]:
    """Join the 95 % intervals of numbers over forms; nothing without forms."""
    ends: dict[str, list[float]] = {name: [] for name in names if forms}
    for form in forms:
        ratio = birge(study.model.runs, form.fitted, study.split.fitted)
        for name, of_name in ends.items():
            of_name += form.fitted.interval(name, ratio)
    return {name: (min(of_name), max(of_name)) for name, of_name in ends.items()}
