"""Forms that left-out runs cannot tell apart, and the intervals of numbers over all of them.

A form is the model with one effect, of fitted size or of the size that theory gives. Two forms are compared on the
fitted runs, each run predicted from the other sessions (`refits.left_out_residuals`), by the difference of the log
likelihoods, paired over conditions: two gains share the runs without either form, so their own standard errors say
nothing about which one is larger. With C conditions of differences D_c,

    D = Σ_c D_c,   σ_D² = C Var D_c,

and the forms are as good as each other while D ≤ t σ_D, with the 97.5 % quantile t of Student's distribution of
C − 1 degrees of freedom: a few conditions prove little. Beside a claim, which leaves no more than noise, a form
whose error on left-out runs is `_FARTHER` times as large is none, however much it owes to one condition.

Each number of the model has the envelope of its intervals over the forms that are as good as the best one. What a
form leaves counts as noise (Birge 1932). The envelope is right among the forms that were tried, and only there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import t as student
from scipy.stats import wilcoxon

from calibration.attribution.refits import Candidate, left_out_residual, left_out_residuals, left_out_rows
from calibration.statistics.budget import skipped
from calibration.statistics.fit import Fit, birge, fit
from calibration.statistics.statistical_model import Parameter
from calibration.statistics.study import Study
from common.arrays import Floats

_QUANTILE = 0.975
_FARTHER = 1.5  # error of a form over that of a claim, which leaves no more than noise


class PairedGain(NamedTuple):
    """By how much a model predicts left-out runs better than another one, in log likelihood."""

    of_conditions: Floats  # (c,)

    @property
    def gain(self) -> float:
        return float(self.of_conditions.sum())

    @property
    def error(self) -> float:
        """Standard error, over conditions."""
        count = len(self.of_conditions)
        return float(self.of_conditions.std(ddof=1)) * math.sqrt(count) if count > 1 else math.inf

    @property
    def certain(self) -> bool:
        """Whether its 95 % interval is above zero."""
        return self.gain > float(student.ppf(_QUANTILE, max(len(self.of_conditions) - 1, 1))) * self.error

    @property
    def consistent(self) -> bool:
        """Whether conditions gain, by a signed-rank test: one that gains far more than others proves no less."""
        some = self.of_conditions[self.of_conditions != 0]
        return len(some) > 1 and bool(wilcoxon(some, alternative="greater").pvalue < 1 - _QUANTILE)


def paired_gain(study: Study, one: Fit, other: Fit) -> PairedGain:
    """Compare the predictions of `one` with those of `other`, in the noise of `one`."""
    return gain_of_residuals(study, *left_out_residuals(study, other, one))


def gain_of_residuals(study: Study, before: Floats, after: Floats, b: float = 1.0) -> PairedGain:
    """Compare two left-out residuals, in the noise b S."""
    rows = left_out_rows(study)
    gains = ((before**2 - after**2) / (2 * b)).reshape(len(rows), -1).sum(1)
    condition = np.unique(study.model.runs.condition[rows], return_inverse=True)[1].reshape(-1)
    return PairedGain(np.asarray(np.bincount(condition, weights=gains), dtype=float))


@dataclass(frozen=True)
class Form:
    """The model with an effect, or with several."""

    effects: tuple[Parameter, ...]
    fit: Fit
    at_theory: bool  # it has the size that theory gives, which is not fitted
    error: float = math.nan  # relative rms on left-out runs

    @property
    def at_an_end(self) -> bool:
        """Whether the fitted size of one of the effects is at an end of its range."""
        fitted = [e for e in self.effects if e.name in self.fit.names]
        return any(np.isclose(self.fit.parameters[e.name], e.bounds, atol=0.0).any() for e in fitted)

    @property
    def title(self) -> str:
        """The effects in words, with the size if theory gives it."""
        title = " and ".join(e.title for e in self.effects)
        if not self.at_theory:
            return title
        sizes = " and ".join(f"{e.theory:g}" for e in self.effects)
        return f"{title} at the size{'s' * (len(self.effects) > 1)} of theory, {sizes}"

    def record(self) -> dict[str, Any]:
        return {
            "title": self.title,
            "sizes": {e.name: self.fit.parameters[e.name] for e in self.effects},
            "theory": self.at_theory,
            "error": self.error,
        }


def at_theory(study: Study, base: Fit) -> list[Form]:
    """Fit the model with each effect of the size that theory gives, if it gives one, and with all of them."""
    known = [(e,) for e in study.effects if e.theory is not None]
    together = [sum(known, ())] if len(known) > 1 else []
    forms = []
    for some in (*known, *together):
        if skipped("forms at the size of theory"):
            break
        start = {**base.parameters, **{e.name: e.theory for e in some}}
        form = Form(some, fit(study.model, start, base.names, study.split.fitted, title=""), True)
        if np.isfinite(form.fit.prediction).all():  # the model can be solved there
            forms.append(form)
    return forms


def forms_of_claims(
    study: Study, base: Fit, claims: Sequence[Candidate], candidates: Sequence[Candidate]
) -> list[Form]:
    """List claims that explain the runs, and the forms that left-out runs cannot tell from the best one.

    Those at the size of theory come first. An effect that was refitted counts also where it was not kept.
    """
    claimed = [Form(c.claimed, c.refit, False) for c in claims if c.refit]
    known = {form.effects for form in claimed}
    fitted = [
        Form(c.claimed, c.refit, False) for c in candidates
        if c.claimed not in known and c.refit and c.refit.converged
    ]  # fmt: skip
    alike = [replace(form, error=_error_left_out(study, form.fit)) for form in claimed]
    near = as_good(study, claimed[0], [*at_theory(study, base), *fitted])
    near = [form for form in near if form.error < _FARTHER * alike[0].error]
    return [*(f for f in near if f.at_theory), *alike, *(f for f in near if not f.at_theory)]


def as_good(study: Study, best: Form, forms: Iterable[Form]) -> list[Form]:
    """Choose the forms that left-out runs cannot tell from the best one, and state their errors on these."""
    alike = [f for f in forms if f.fit is best.fit or not paired_gain(study, best.fit, f.fit).certain]
    return [replace(form, error=_error_left_out(study, form.fit)) for form in alike]


def _error_left_out(study: Study, fitted: Fit) -> float:
    white = left_out_residual(study, fitted, fitted.noise)
    return math.sqrt(float((white**2).mean())) * fitted.noise.rms


def envelope(study: Study, names: Sequence[str], forms: Sequence[Form]) -> dict[str, tuple[float, float]]:
    """Join the 95 % intervals of numbers over forms; nothing without forms."""
    ends: dict[str, list[float]] = {name: [] for name in names if forms}
    for form in forms:
        ratio = birge(study.model.runs, form.fit, study.split.fitted)
        for name, of_name in ends.items():
            of_name += form.fit.interval(name, ratio)
    return {name: (min(of_name), max(of_name)) for name, of_name in ends.items()}
