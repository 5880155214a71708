"""Batches of runs that tell two rivals apart: chosen for all runs together."""

from __future__ import annotations

import math

import numpy as np
import pytest

from calibration.statistics.fit import fit
from calibration.statistics.statistical_model import Noise, start_values
from calibration.verdict.experiment import Rival
from calibration.verdict.next_runs import BATCH, STOP, Pair, _greedy, _together, next_runs
from tests.calibration.toy_tables import TRUTH, toy_swimmer, toy_table


def test_runs_add_up_where_nothing_is_fitted_and_repeat_where_one_is_best() -> None:
    difference = np.array([[1.0], [3.0], [2.0]])
    none = np.zeros((3, 1, 1))
    chosen, strength = _greedy([Pair(difference, none, np.eye(1))], Noise(np.array([[0.5]]), 0.0))
    assert chosen == [1] * BATCH
    assert strength == pytest.approx(BATCH * 9 / 0.5)


def test_a_parameter_that_can_be_fitted_again_makes_runs_differ() -> None:
    """The rival can shift all outputs alike, so one setting alone decides nothing however often it is repeated."""
    difference = np.array([[1.0], [-1.0]])
    shift, wide = np.ones((2, 1, 1)), np.array([[1e6]])
    pair = Pair(difference, shift, wide)
    assert _together([pair], Noise(np.eye(1), 0.0), [0] * 8) == pytest.approx(0, abs=1e-3)
    chosen, strength = _greedy([pair], Noise(np.eye(1), 0.0))
    assert chosen == [0] * 4 + [1] * 4
    assert strength == pytest.approx(8, rel=1e-3)


def test_a_shift_of_the_session_is_no_evidence() -> None:
    """Runs of one day may all be shifted alike; two opposite settings are not."""
    difference, none = np.array([[1.0], [-1.0]]), np.zeros((2, 1, 1))
    pair = Pair(difference, none, np.eye(1))
    alike, opposite = (_together([pair], Noise(np.eye(1), 10.0), places)[0] for places in ([0, 0], [0, 1]))
    assert alike == pytest.approx(2 / 21)
    assert opposite == pytest.approx(2.0)


def test_a_batch_serves_all_pairs_of_rivals() -> None:
    """The first setting tells the first two apart, the second the others: a batch for all has both."""
    none = np.zeros((2, 1, 1))
    pairs = [Pair(np.array(d)[:, None], none, np.eye(1)) for d in ([3.0, 0.0], [0.0, 2.0], [0.0, 2.0])]
    chosen, strength = _greedy(pairs, Noise(np.eye(1), 0.0))
    assert set(chosen) == {0, 1}
    assert chosen.count(1) > chosen.count(0)
    assert strength == pytest.approx(min(9 * chosen.count(0), 4 * chosen.count(1)))


def test_a_batch_is_stated_with_its_settings_and_where_to_stop() -> None:
    model = toy_swimmer(toy_table(2, end_over_end_drag=5.0), TRUTH)
    used = np.ones(len(model.runs), bool)
    common = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    fits = [
        fit(model, start_values(model), (*common, name), used, title="")
        for name in ("end_over_end_drag", "disc_drag")
    ]
    batch = next_runs([Rival("", fitted, model) for fitted in fits])[1]
    assert len(batch.settings) == BATCH
    assert batch.stop == pytest.approx(2 * math.log(STOP))
    assert 0 <= batch.decides <= 1
    assert {"N", "l_cm", "omega_rpm"} == set(batch.settings[0])
