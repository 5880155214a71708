"""Rules as data: which one refuses, what is measured for it, and that each reason has its rule."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibration.attribution.effects import with_look_alikes
from calibration.attribution.hypothesis import Evidence, Hypothesis, Origin, Reason, SetErrors
from calibration.attribution.left_out import PairedGain
from calibration.attribution.rules import RULES, Stage, Trial, doubted, judge
from calibration.laws.laws import LAW_RULES
from calibration.statistics.study import Study
from tests.calibration.toy_tables import DRAG, effect

ALL = (*RULES, *LAW_RULES)
SOURCES = {Reason.KEPT, Reason.NOT_NEEDED, Reason.NOT_SOLVED}  # given where hypotheses are made


def claim() -> tuple[Hypothesis, Trial]:
    """An effect that is kept, and against what it was judged; nothing is measured of it yet."""
    result = effect()
    (found,) = result.claims
    study = Study(result.base.model, result.split)
    evidence = found.evidence
    measures = {name: lambda _, name=name: getattr(evidence, name) for name in ("remainder", "session_gain")}
    return replace(found, evidence=evidence.of_score()), Trial(study, result.base, measures)


def test_each_reason_has_a_rule() -> None:
    assert {rule.reason for rule in ALL} | SOURCES == set(Reason)


@pytest.mark.slow
def test_evidence_is_measured_when_a_rule_weighs_it_and_not_after_a_refusal() -> None:
    given, trial = claim()
    assert given.evidence.remainder is None
    kept = judge(given, trial, RULES)
    assert kept.kept
    assert kept.effect.name == DRAG
    assert kept.evidence.remainder is not None
    assert kept.evidence.session_gain is not None
    refused = judge(replace(given, fit=replace(given.fitted, converged=False)), trial, RULES)
    assert refused.reason is Reason.NOT_CONVERGED
    assert refused.evidence.remainder is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("origin", "evidence", "reason"),
    [
        (Origin.EFFECT, {"session_gain": (1.0, 2.0)}, Reason.NOT_PREDICTIVE),
        (Origin.PAIR, {"cost": 11.0}, Reason.COSTS_MORE),
        (Origin.FORM, {"paired": None, "removed": 0.4}, Reason.REMOVES_LITTLE),
        (Origin.FORM, {"removed": 0.6, "differs": False}, Reason.INCLUDES_NULL),
        (Origin.FORM, {"removed": 0.6, "interval": (-1.0, 1.0)}, Reason.INCLUDES_NULL),
        (Origin.FORM, {"removed": 0.6, "interval": (4.0, 6.0)}, Reason.KEPT),
        (Origin.THEORY, {"removed": 0.6, "interval": (-1.0, 1.0)}, Reason.KEPT),  # its size is not fitted
    ],
)
def test_a_rule_is_of_some_origins(origin: Origin, evidence: dict[str, object], reason: Reason) -> None:
    given, trial = claim()
    trial = replace(trial, single=10.0)
    assert judge(replace(given, origin=origin, evidence=Evidence(**evidence)), trial, RULES).reason is reason


@pytest.mark.slow
def test_what_fits_as_well_as_a_claim_is_its_rival() -> None:
    """An effect that misses the gain on left-out sessions by chance is kept beside one that does not."""
    given, _ = claim()
    missed = replace(given, reason=Reason.NOT_PREDICTIVE)
    worse = replace(missed, fit=replace(given.fitted, deviance=given.fitted.deviance + 7))
    null = replace(given, reason=Reason.INCLUDES_NULL)
    assert [h.kept for h in with_look_alikes([given, missed, worse, null])] == [True, True, False, False]
    assert not any(h.kept for h in with_look_alikes([missed, worse]))


@pytest.mark.slow
def test_a_form_predicts_better_if_many_conditions_gain_or_all_together_do() -> None:
    given, trial = claim()
    form = replace(given, origin=Origin.FORM).seen(removed=0.9, interval=(4.0, 6.0))
    gains = {(1.0, 1.1, 0.9, 1.0): True, (9.0, -8.0, 7.0, -9.0): False}
    for of_conditions, kept in gains.items():
        assert judge(form.seen(paired=PairedGain(np.array(of_conditions))), trial, RULES).kept is kept


@pytest.mark.slow
def test_what_runs_refute_is_withdrawn_if_they_determine_its_numbers() -> None:
    given, trial = claim()
    for p, determined, refuted in ((0.001, True, True), (0.001, False, False), (0.2, True, False)):
        errors = SetErrors("day 2", 0.02, 0.03, p, determined)
        tested = judge(given.seen(held_out=(errors,)), trial, RULES, Stage.HELD_OUT)
        assert (tested.reason is Reason.REFUTED) is refuted


@pytest.mark.slow
def test_doubts_are_all_that_apply() -> None:
    given, trial = claim()
    pair = replace(given, origin=Origin.PAIR).seen(imitable=0.3, transfer=0.001)
    assert doubted(pair, trial, RULES).doubts == (Reason.ONE_OF_MANY, Reason.IMITABLE, Reason.DOES_NOT_TRANSFER)
    assert doubted(given.seen(imitable=0.0, transfer=0.5), trial, RULES).doubts == ()
