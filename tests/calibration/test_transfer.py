"""A claim must carry over from short tails and few of them to the other runs; what only looks like it does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import calibration.attribution.doubts
from calibration.attribution.candidate import Candidate
from calibration.attribution.transfer_test import SURE, fitted_again, transfer_p
from calibration.statistics.fit import Fit, fit
from calibration.statistics.forward_model import parameter, start_values
from calibration.statistics.pulls import pulls
from calibration.statistics.study import Study
from calibration.swimmer.swimmer import COEFFICIENTS, SwimmerModel
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict_json import verdict_record
from sim.arrays import Flags, Floats
from tests.calibration.toy_tables import TRUTH, toy_swimmer, toy_table

EFFECT = "end_over_end_drag"
SIZE = 3.0


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
    own = model()
    rest = ~fitted_again(own.runs, everywhere(own))
    for further, carries in ((1.0, True), (3.0, False)):
        there = planted(own, np.where(rest, further, 1.0))
        p = transfer_p(Study.fitted_to(there, everywhere(there), seed=1), claimed(there))
        assert (p >= SURE) == carries


@pytest.mark.usefixtures("toy_model")
def test_runs_that_are_all_alike_say_nothing() -> None:
    own = planted(model(), np.ones(len(model().runs)))
    short = own.runs.length < 0.06
    few = short & (own.runs.tails <= 4)
    assert transfer_p(Study.fitted_to(own, few, seed=1), claimed(own)) == 1.0


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_a_claim_that_does_not_carry_over_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    there = planted(model(), np.full(len(model().runs), 2.0))
    monkeypatch.setattr(calibration.attribution.doubts, "transfer_p", lambda *_, **__: 0.001)
    doubted = calibrate(there, progress=False)
    assert doubted.effects == (EFFECT,)
    assert "or something outside the catalogue" in doubted.sentence
    assert verdict_record(doubted, table="")["transfer_p"] == [0.001]


@pytest.mark.usefixtures("toy_model")
def test_an_effect_beside_a_wrong_number_is_in_doubt() -> None:
    """It is a pair: something outside the catalogue finds two things that explain it more easily than one."""
    refit = claimed(planted(model(), np.ones(len(model().runs))))
    own = model()
    effect = parameter(own, EFFECT)
    sure = Candidate(effect, (), 8.0, 1.0, 1.0, 1.0, "kept", refit, None, 1.0, 0.1)
    assert not sure.doubted
    pull = pulls(fit(own, start_values(own), names(own), everywhere(own), title=""), own.nuisances)[0]
    assert replace(sure, refit=replace(refit, wrong_numbers=((pull,),))).doubted
