"""The rules by which hypotheses are judged, as data: what each refuses, of which origin, by which evidence.

Rules stand in the order in which they are applied, the cheapest first. Evidence is measured when a rule weighs it:
the first rule that refuses a hypothesis is its reason, and what later rules would have weighed stays untested.
They differ between origins on purpose. An effect that is claimed must leave no more than noise, while an effect
that is adopted as a description need not, but must predict runs that it has not seen; a number that differs in
some runs must be off by no more than is credible.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, cast

import numpy as np

from calibration.attribution.hypothesis import Hypothesis, Origin, Reason, SetErrors
from calibration.statistics.fit import Fit
from calibration.statistics.shifted import Shift, Shifted
from calibration.statistics.study import Study

INDISTINGUISHABLE = 6.63  # χ² with one degree of freedom, 99 %
UNSEEN = 1e9  # smallest detectable size of an effect that changes nothing
IMITABLE = 0.05  # imitability index above which a claim is uncertain
SURE = 0.01  # p-value of the transfer test below which it is
IMPLAUSIBLE = 5.0  # standard deviations of a number's prior: a ruler is seldom wrong by so many
CERTAIN = 5.0  # standard deviations of a number that differs in some runs
CREDIBLE = 10.0  # tolerances of such a number: a camera may be bumped, but no head is a third shorter on a day
REJECTED = 0.01  # p of held-out runs
CURVED = 0.3  # share of the best score's z² below which an effect is not fitted if it leaves too much
_REMOVED = 0.5  # least share of what is beyond noise that a description removes
_VAGUE = math.log(100.0)  # half width of the interval of a logarithm, which says nothing


class Stage(StrEnum):
    """When a rule is applied, and so what it does."""

    SCORE = "refused by its score, without a fit"
    FIT = "refused by its fit"
    DOUBT = "kept, and uncertain"
    HELD_OUT = "withdrawn"


@dataclass(frozen=True)
class Trial:
    """Against what hypotheses are judged, and how each field of their evidence is measured."""

    study: Study
    base: Fit  # without what they add
    measures: Mapping[str, Callable[[Hypothesis], Any]] = field(default_factory=dict)
    needed: float = 0.0  # |z| of a score that is beyond noise
    largest: float = 0.0  # the largest score
    most: float = math.inf  # deviance that noise may leave
    single: float = math.inf  # EBIC of the best single effect

    def measured(self, hypothesis: Hypothesis, name: str) -> Hypothesis:
        """Measure a field of the evidence, unless it is known or there is no measure of it."""
        if name not in self.measures or getattr(hypothesis.evidence, name) is not None:
            return hypothesis
        return hypothesis.seen(**{name: self.measures[name](hypothesis)})


@dataclass(frozen=True)
class Rule:
    """What is held against hypotheses of some origins."""

    stage: Stage
    origins: tuple[Origin, ...]
    reason: Reason
    text: str  # when it applies, for the documentation
    applies: Callable[[Hypothesis, Trial], bool]
    weighs: str = ""  # a field of the evidence


def judge(hypothesis: Hypothesis, trial: Trial, rules: Sequence[Rule], stage: Stage = Stage.FIT) -> Hypothesis:
    """Return a hypothesis with the reason of the first rule that refuses it, and the evidence measured for it."""
    for rule in _of(rules, stage, hypothesis):
        hypothesis = trial.measured(hypothesis, rule.weighs)
        if rule.applies(hypothesis, trial):
            return replace(hypothesis, reason=rule.reason)
    return replace(hypothesis, reason=Reason.KEPT if stage is Stage.FIT else hypothesis.reason)


def doubted(hypothesis: Hypothesis, trial: Trial, rules: Sequence[Rule]) -> Hypothesis:
    """Return a hypothesis with all that makes it uncertain."""
    doubts = []
    for rule in _of(rules, Stage.DOUBT, hypothesis):
        hypothesis = trial.measured(hypothesis, rule.weighs)
        if rule.applies(hypothesis, trial):
            doubts.append(rule.reason)
    return replace(hypothesis, doubts=tuple(doubts))


def _of(rules: Sequence[Rule], stage: Stage, hypothesis: Hypothesis) -> list[Rule]:
    return [rule for rule in rules if rule.stage is stage and hypothesis.origin in rule.origins]


def _wrong_sign(h: Hypothesis, _: Trial) -> bool:
    (low, high), expected = h.effect.bounds, h.evidence.expected or 0.0
    return not low <= expected <= high and (expected < low) == (h.effect.start == low)


def _leaves_much(h: Hypothesis, trial: Trial) -> bool:
    # A fit takes z² from the deviance if the model is linear. `CURVED` allows for its curvature.
    left = trial.base.deviance - h.score**2 / CURVED
    return h.score**2 < CURVED * trial.largest**2 and left > trial.most


def _includes_null(h: Hypothesis, trial: Trial) -> bool:
    """Tell whether the interval includes the null, by the covariance and by the deviance there.

    Along a bent valley the covariance alone says nothing.
    """
    low, high = interval_at_second(h)
    alike = trial.base.wrong_numbers == h.fitted.wrong_numbers  # otherwise the base lacks more than the effect
    falls = trial.base.deviance - h.fitted.deviance
    return low <= h.effect.start <= high and not (alike and falls > h.fitted.risen(h.effect.name))


def interval_at_second(hypothesis: Hypothesis) -> tuple[float, float]:
    """Compute the 95 % interval of an effect, with its second number as it was fitted.

    A weak effect's size and second number cannot be told apart, and the interval over both would hold the null.
    """
    effect, refit = hypothesis.effect, hypothesis.fitted
    i = refit.names.index(effect.name)
    if effect.second is None or refit.held[i]:
        return refit.interval(effect.name)
    j = refit.names.index(effect.second.name)
    V = refit.covariance
    share = 1 - V[i, j] ** 2 / (V[i, i] * V[j, j])
    half = refit.half_width(i) * math.sqrt(max(share, 0.0))
    return refit.parameters[effect.name] - half, refit.parameters[effect.name] + half


def _leaves_residual(h: Hypothesis, level: float) -> bool:
    return h.evidence.remainder is not None and h.evidence.remainder.p_value < level


def predicts_no_better(h: Hypothesis, _: Trial) -> bool:
    """Tell whether a hypothesis does not predict left-out sessions better, beyond the error of that."""
    gain, error = h.evidence.session_gain or (0.0, 0.0)
    return gain <= error


def _form_predicts_no_better(h: Hypothesis, _: Trial) -> bool:
    return h.evidence.paired is not None and not (h.evidence.paired.certain or h.evidence.paired.consistent)


def _removes_little(h: Hypothesis, trial: Trial) -> bool:
    return (h.evidence.removed or 0.0) < _REMOVED and trial.study.model.runs.noise_known


def _vague(h: Hypothesis, _: Trial) -> bool:
    return h.logarithmic and bool(np.diff(np.log(np.abs(h.evidence.interval or (1.0, 1.0))))[0] > 2 * _VAGUE)


def _form_includes_null(h: Hypothesis, _: Trial) -> bool:
    low, high = h.evidence.interval or (-math.inf, math.inf)
    return not h.evidence.sizes and low <= h.effect.start <= high


def _number_not_credible(h: Hypothesis, _: Trial) -> bool:
    """Tell whether a number differs by more than is credible; half a turn may be a little more by its error."""
    number = shift_of(h).parameter
    if number.sigma is None:
        return False
    if number.plausible:
        low, high = h.fitted.interval(h.effect.name)
        return low > number.plausible[1] or high < number.plausible[0]
    return abs(h.size) > CREDIBLE * number.sigma


def _refutes(h: Hypothesis, _: Trial) -> bool:
    return bool(refuting(h))


def refuting(hypothesis: Hypothesis) -> list[SetErrors]:
    """List the sets of runs that refute a hypothesis, of those to which it was not fitted.

    Conditions without which a number of the model runs to a bound say nothing about it.
    """
    sets = hypothesis.evidence.held_out or ()
    return [one for one in sets if one.after > one.before and one.p_value < REJECTED and one.determined]


def shift_of(move: Hypothesis) -> Shift:
    """Return the shift of a number that differs in some runs."""
    return next(s for s in cast(Shifted, move.model).shifts if s.change.name == move.effect.name)


_EFFECTS = (Origin.EFFECT, Origin.PAIR)
_CLAIMS = (*_EFFECTS, Origin.NUMBER)
_FORMS = (Origin.FORM, Origin.THEORY)
_FITTED = (*_EFFECTS, *_FORMS, Origin.MOVE)

RULES = (
    Rule(Stage.SCORE, _EFFECTS, Reason.NO_CHANGE, "no size changes the runs",
         lambda h, _: (h.evidence.detectable or 0.0) > UNSEEN),
    Rule(Stage.SCORE, _EFFECTS, Reason.ABSORBED,
         "less than 3 % of its signal (of poses 1 %) survives the projection",
         lambda h, trial: (h.evidence.survived or 0.0) < trial.study.model.runs.least_surviving),
    Rule(Stage.SCORE, _EFFECTS, Reason.NOISE, "|z| is below the critical one",
         lambda h, trial: abs(h.score) < trial.needed),
    Rule(Stage.SCORE, _EFFECTS, Reason.WRONG_SIGN,
         "the size by the score is beyond the end of its range that is the null",
         _wrong_sign),
    Rule(Stage.SCORE, _EFFECTS, Reason.LEAVES_MUCH,
         f"z² is below {CURVED:g} of the largest, and the deviance less z²/{CURVED:g} is far above noise",
         _leaves_much),
    Rule(Stage.FIT, _EFFECTS, Reason.NO_TIME, "the search ended during its fit", lambda h, _: h.fitted.stopped),
    Rule(Stage.FIT, _FITTED, Reason.NOT_CONVERGED, "its fit did not converge",
         lambda h, _: not h.fitted.converged),
    Rule(Stage.FIT, (Origin.PAIR,), Reason.COSTS_MORE, "its extended BIC is above that of the best single effect",
         lambda h, trial: (h.evidence.cost or -math.inf) >= trial.single, "cost"),
    Rule(Stage.FIT, _EFFECTS, Reason.LEAVES_RESIDUAL, "the p-value of the residual that it leaves is below α/2",
         lambda h, trial: _leaves_residual(h, trial.study.level / 2), "remainder"),  # a true one is seldom lost
    Rule(Stage.FIT, (Origin.NUMBER,), Reason.LEAVES_RESIDUAL,
         "the p-value of the residual that it leaves is below α",
         lambda h, trial: _leaves_residual(h, trial.study.level), "remainder"),
    Rule(Stage.FIT, _EFFECTS, Reason.INCLUDES_NULL, "the 95 % interval of the new effect includes its null",
         _includes_null),
    Rule(Stage.FIT, _EFFECTS, Reason.NOT_PREDICTIVE,
         "the gain over left-out sessions is below its standard error, and no effect that is kept fits as well",
         predicts_no_better, "session_gain"),
    Rule(Stage.FIT, (Origin.MOVE,), Reason.NOISE,
         f"its score is below {CERTAIN:g} standard deviations of what the fit with it leaves",
         lambda h, _: abs(h.score) < CERTAIN * math.sqrt(h.evidence.birge)),
    Rule(Stage.FIT, (Origin.MOVE,), Reason.GAINS_LITTLE,
         f"it lowers the deviance by less than {INDISTINGUISHABLE}",
         lambda h, trial: trial.base.deviance - h.fitted.deviance < INDISTINGUISHABLE),
    Rule(Stage.FIT, (Origin.MOVE,), Reason.NOT_CREDIBLE,
         f"the number is off by more than {CREDIBLE:g} of its tolerances", _number_not_credible),
    Rule(Stage.FIT, _FORMS, Reason.NOT_PREDICTIVE,
         "the paired gain on left-out runs is neither certain nor consistent over conditions",
         _form_predicts_no_better, "paired"),
    Rule(Stage.FIT, _FORMS, Reason.REMOVES_LITTLE,
         f"it removes less than {_REMOVED:.0%} of what is beyond noise on left-out runs; where the noise is known",
         _removes_little),
    Rule(Stage.FIT, (Origin.FORM,), Reason.INCLUDES_NULL,
         "sizes differ, and by a t-test the mean of those that specimens ask for may be the null",
         lambda h, _: h.evidence.differs is False, "differs"),
    Rule(Stage.FIT, (Origin.FORM,), Reason.VAGUE,
         "sizes differ, and the interval of their mean spans a factor of 10⁴",
         _vague, "interval"),
    Rule(Stage.FIT, (Origin.FORM,), Reason.INCLUDES_NULL, "the interval of its one size includes the null",
         _form_includes_null, "interval"),
    Rule(Stage.DOUBT, (Origin.PAIR,), Reason.ONE_OF_MANY, "always", lambda *_: True),
    Rule(Stage.DOUBT, _CLAIMS, Reason.IMITABLE, f"the imitability index is above {IMITABLE:g}",
         lambda h, _: (h.evidence.imitable or 0.0) > IMITABLE, "imitable"),
    Rule(Stage.DOUBT, _CLAIMS, Reason.DOES_NOT_TRANSFER,
         f"the p-value of the transfer test is below {SURE:g}",
         lambda h, _: (1.0 if h.evidence.transfer is None else h.evidence.transfer) < SURE, "transfer"),
    Rule(Stage.DOUBT, (Origin.NUMBER,), Reason.IMPLAUSIBLE,
         f"it is off by more than {IMPLAUSIBLE:g} of its tolerances",
         lambda h, _: any(pull.tolerances > IMPLAUSIBLE for pull in h.evidence.pulls)),
    Rule(Stage.HELD_OUT, (*_EFFECTS, *_FORMS), Reason.REFUTED,
         f"the error on held-out sessions or left-out conditions rises, and they reject it, p < {REJECTED:g}",
         _refutes, "held_out"),
)  # fmt: skip
