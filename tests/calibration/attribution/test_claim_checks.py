"""Checks of claims: what could imitate them, whether they carry over to other runs, and what pairs cost."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import calibration.attribution.claim_checks
from calibration.attribution.claim_checks import (
    SEEN,
    absorbable_shares,
    fitted_again,
    imitability,
    transfer_p,
)
from calibration.attribution.refits import IMITABLE, SURE, Candidate, ebic
from calibration.statistics.fit import Fit, fit
from calibration.statistics.statistical_model import parameter, start_values
from calibration.statistics.study import Study
from calibration.swimmer.swimmer import COEFFICIENTS, SwimmerModel
from calibration.verdict.calibrate import calibrate
from calibration.verdict.record import verdict_record
from sim.arrays import Flags, Floats
from tests.calibration.toy_tables import DRAG, FEW_DRAWS, TRUTH, on_the_toy, toy_swimmer, toy_table
from tests.shared import shared

SIZE = 3.0


@shared
def plain() -> SwimmerModel:
    return toy_swimmer(toy_table(8))


def everywhere(model: SwimmerModel) -> Flags:
    return np.ones(len(model.runs), dtype=bool)


def planted(share: Floats | float) -> SwimmerModel:
    """The model with runs that have the drag by this share (n,)."""
    model = plain()
    truth = {**start_values(model), **{name: getattr(TRUTH, name) for name in COEFFICIENTS}}
    clean, present = model.predict([truth, {**truth, DRAG: SIZE}])
    y = model.runs.y + np.broadcast_to(share, len(clean))[:, None] * (present - clean)
    return replace(model, runs=replace(model.runs, y=y))


def claimed(model: SwimmerModel) -> Fit:
    start = {**start_values(model), DRAG: SIZE}
    return fit(model, start, (*COEFFICIENTS, DRAG), everywhere(model), title="")


def transferred(model: SwimmerModel, used: Flags) -> float:
    return transfer_p(Study.fitted_to(model, used, seed=1), claimed(model))


def test_a_strong_claim_is_hard_to_imitate_and_a_weak_one_is_not() -> None:
    model = toy_swimmer(toy_table(2, **{DRAG: 5.0}), TRUTH)
    names = (*(p.name for p in (*model.coefficients, *model.nuisances)), DRAG)
    refit = fit(model, {**start_values(model), DRAG: 5.0}, names, everywhere(model), title="")
    shares = absorbable_shares(Study.fitted_to(model, everywhere(model), seed=1), refit, (DRAG,))
    assert ((shares > -1e-9) & (shares < 1)).all()
    weak, middle, strong = (imitability(shares, strength) for strength in (SEEN / 2, 2 * SEEN, 20 * SEEN))
    assert weak >= middle >= strong
    assert weak > IMITABLE > strong
    assert imitability(np.array([1.0, 0.5]), 10.0) == 0.5  # what is absorbed whole leaves nothing to notice
    assert imitability(np.array([0.5]), SEEN - 0.1) == 1.0


def test_an_effect_carries_over_from_short_tails_and_few_and_a_mimic_does_not() -> None:
    runs, near = plain().runs, fitted_again(plain().runs, everywhere(plain()))
    assert set(np.unique(runs.tails[near])) == {2, 3, 4}
    assert set(np.unique(runs.length[near].round(3))) == {0.05, 0.08}
    assert near.sum() == len(near) // 2
    for further, carries in ((1.0, True), (3.0, False)):
        model = planted(np.where(near, 1.0, further))
        assert (transferred(model, everywhere(model)) >= SURE) == carries
    alike = (runs.length < 0.06) & (runs.tails <= 4)
    assert transferred(planted(1.0), alike) == 1.0  # they say nothing


def test_a_claim_that_does_not_carry_over_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration.attribution.claim_checks, "transfer_p", lambda *_, **__: 0.001)
    with on_the_toy(few=True):
        uncertain = calibrate(planted(2.0), draws=FEW_DRAWS, progress=False)
    assert uncertain.effects == (DRAG,)
    assert "or something outside the catalogue" in uncertain.sentence
    assert verdict_record(uncertain, table="")["transfer_p"] == [0.001]


def test_an_effect_beside_a_wrong_number_is_in_doubt_and_pairs_pay_for_their_number() -> None:
    """Two effects cost one parameter more, and the logarithm of how many pairs there are."""
    model, used = plain(), everywhere(plain())
    refit = claimed(planted(1.0))
    effect = parameter(model, DRAG)
    sure = Candidate(effect, (effect,), 8.0, 1.0, 1.0, 1.0, "kept", refit, None, 1.0, 0.1)
    pull: Any = object()
    freed = replace(refit, wrong_numbers=((pull,),))
    assert not sure.uncertain
    assert replace(sure, claimed=(parameter(model, "disc_drag"), effect)).uncertain
    assert replace(sure, refit=freed).uncertain
    study = Study.fitted_to(model, used)
    cost = ebic(study, refit, 2) - ebic(study, refit, 1)
    assert cost == pytest.approx(2 * math.log((len(model.effects) - 1) / 2))
    assert ebic(study, freed, 2) - ebic(study, refit, 2) == pytest.approx(math.log(study.values))
