"""The imitability index: high where a claim is weak, low where it is strong."""

from __future__ import annotations

import math

import numpy as np
import pytest

from calibration.attribution.imitability import DOUBT, SEEN, absorbable_shares, deformations, imitability
from calibration.attribution.pairs import ebic
from calibration.statistics.fit import fit
from calibration.statistics.forward_model import start_values
from calibration.statistics.study import Study
from tests.calibration.toy_tables import TRUTH, toy_swimmer, toy_table

HIDDEN = "end_over_end_drag"


def test_a_strong_claim_is_hard_to_imitate_and_a_weak_one_is_not() -> None:
    model = toy_swimmer(toy_table(2, **{HIDDEN: 5.0}), TRUTH)
    names = (*(p.name for p in (*model.coefficients, *model.nuisances)), HIDDEN)
    used = np.ones(len(model.runs), bool)
    refit = fit(model, {**start_values(model), HIDDEN: 5.0}, names, used, title="")
    shares = absorbable_shares(Study.fitted_to(model, used, seed=1), refit, (HIDDEN,))
    assert ((shares > -1e-9) & (shares < 1)).all()
    strengths = [imitability(shares, strength) for strength in (SEEN / 2, 2 * SEEN, 20 * SEEN)]
    assert strengths == sorted(strengths, reverse=True)
    assert strengths[0] > DOUBT > strengths[-1]


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


def test_pairs_pay_for_their_number() -> None:
    """Two effects cost one parameter more, and the logarithm of how many pairs there are."""
    model = toy_swimmer(toy_table(4))
    used = np.ones(len(model.runs), bool)
    names = tuple(p.name for p in model.coefficients)
    one = fit(model, start_values(model), names, used, title="")
    count = len(model.effects)
    study = Study.fitted_to(model, used)
    cost = ebic(study, one, 2) - ebic(study, one, 1)
    assert cost == pytest.approx(2 * math.log((count - 1) / 2))
