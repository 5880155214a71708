"""Checks of claims: the imitability index is high for a weak claim, and a claim must carry over to other runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import calibration.attribution.claim_checks
from calibration.attribution.claim_checks import (
    SEEN,
    absorbable_shares,
    deformations,
    fitted_again,
    imitability,
    transfer_p,
)
from calibration.attribution.refits import IMITABLE, SURE, Candidate
from calibration.attribution.wrong_numbers import pulls
from calibration.statistics.fit import Fit, fit
from calibration.statistics.statistical_model import parameter, start_values
from calibration.statistics.study import Study
from calibration.swimmer.swimmer import COEFFICIENTS, SwimmerModel
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict_json import verdict_record
from sim.arrays import Flags, Floats
from tests.calibration.toy_tables import FEW_DRAWS, TRUTH, toy_swimmer, toy_table

EFFECT = "end_over_end_drag"
SIZE = 3.0


def test_a_strong_claim_is_hard_to_imitate_and_a_weak_one_is_not() -> None:
    model = toy_swimmer(toy_table(2, **{EFFECT: 5.0}), TRUTH)
    names = (*(p.name for p in (*model.coefficients, *model.nuisances)), EFFECT)
    used = np.ones(len(model.runs), bool)
    refit = fit(model, {**start_values(model), EFFECT: 5.0}, names, used, title="")
    shares = absorbable_shares(Study.fitted_to(model, used, seed=1), refit, (EFFECT,))
    assert ((shares > -1e-9) & (shares < 1)).all()
    strengths = [imitability(shares, strength) for strength in (SEEN / 2, 2 * SEEN, 20 * SEEN)]
    assert strengths == sorted(strengths, reverse=True)
    assert strengths[0] > IMITABLE > strengths[-1]


def test_what_is_absorbed_whole_leaves_nothing_to_notice() -> None:
    assert imitability(np.array([1.0, 0.5]), 10.0) == 0.5
    assert imitability(np.array([0.5]), SEEN - 0.1) == 1.0


def test_departures_are_smooth_in_the_inputs_and_equal_in_repeats() -> None:
    model = toy_swimmer(toy_table(3))
    used = np.ones(len(model.runs), bool)
    drawn = np.log(deformations(model.runs, used, 2000, seed=0))
    assert drawn.std() == pytest.approx(0.5, rel=0.05)
    for condition in np.unique(model.runs.condition):
        assert np.ptp(drawn[model.runs.condition == condition], axis=0).max() < 1e-9


def model() -> SwimmerModel:
    return toy_swimmer(toy_table(8))


def everywhere(swimmer: SwimmerModel) -> Flags:
    return np.ones(len(swimmer.runs), dtype=bool)


def planted(swimmer: SwimmerModel, share: Floats) -> SwimmerModel:
    """The effect on each run by this share (n,)."""
    truth = {**start_values(swimmer), **{name: getattr(TRUTH, name) for name in COEFFICIENTS}}
    clean, present = swimmer.predict([truth, {**truth, EFFECT: SIZE}])
    y = swimmer.runs.y + share[:, None] * (present - clean)
    return replace(swimmer, runs=replace(swimmer.runs, y=y))


def names(swimmer: SwimmerModel) -> tuple[str, ...]:
    return tuple(p.name for p in (*swimmer.coefficients, *swimmer.nuisances))


def claimed(swimmer: SwimmerModel) -> Fit:
    start = {**start_values(swimmer), EFFECT: SIZE}
    return fit(swimmer, start, (*COEFFICIENTS, EFFECT), everywhere(swimmer), title="")


def test_short_tails_and_few_are_fitted() -> None:
    runs = model().runs
    near = fitted_again(runs, everywhere(model()))
    assert set(np.unique(runs.tails[near])) == {2, 3, 4}
    assert set(np.unique(runs.length[near].round(3))) == {0.05, 0.08}
    assert near.sum() == len(near) // 2


@pytest.mark.usefixtures("toy_model")
def test_an_effect_carries_over_and_a_mimic_does_not() -> None:
    plain = model()
    further_runs = ~fitted_again(plain.runs, everywhere(plain))
    for further, carries in ((1.0, True), (3.0, False)):
        swimmer = planted(plain, np.where(further_runs, further, 1.0))
        p = transfer_p(Study.fitted_to(swimmer, everywhere(swimmer), seed=1), claimed(swimmer))
        assert (p >= SURE) == carries


@pytest.mark.usefixtures("toy_model")
def test_runs_that_are_all_alike_say_nothing() -> None:
    swimmer = planted(model(), np.ones(len(model().runs)))
    short = swimmer.runs.length < 0.06
    few = short & (swimmer.runs.tails <= 4)
    assert transfer_p(Study.fitted_to(swimmer, few, seed=1), claimed(swimmer)) == 1.0


@pytest.mark.usefixtures("toy_model")
def test_a_claim_that_does_not_carry_over_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    swimmer = planted(model(), np.full(len(model().runs), 2.0))
    monkeypatch.setattr(calibration.attribution.claim_checks, "transfer_p", lambda *_, **__: 0.001)
    uncertain = calibrate(swimmer, draws=FEW_DRAWS, progress=False)
    assert uncertain.effects == (EFFECT,)
    assert "or something outside the catalogue" in uncertain.sentence
    assert verdict_record(uncertain, table="")["transfer_p"] == [0.001]


@pytest.mark.usefixtures("toy_model")
def test_an_effect_beside_a_wrong_number_is_in_doubt() -> None:
    """It is a pair: something outside the catalogue finds two things that explain it more easily than one."""
    refit = claimed(planted(model(), np.ones(len(model().runs))))
    swimmer = model()
    effect = parameter(swimmer, EFFECT)
    sure = Candidate(effect, (effect,), 8.0, 1.0, 1.0, 1.0, "kept", refit, None, 1.0, 0.1)
    assert not sure.uncertain
    assert replace(sure, claimed=(parameter(swimmer, "disc_drag"), effect)).uncertain
    pull = pulls(
        fit(swimmer, start_values(swimmer), names(swimmer), everywhere(swimmer), title=""), swimmer.nuisances
    )[0]
    assert replace(sure, refit=replace(refit, wrong_numbers=((pull,),))).uncertain
