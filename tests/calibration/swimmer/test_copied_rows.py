"""Copies of measured rows are told from repeats, and repeats in coarse numbers from copies."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from calibration.swimmer.copied_rows import find_copies
from calibration.swimmer.measured_table import read_measurements
from sim.io.errors import InputError
from tests.calibration.toy_tables import calibrated, toy_table


def rows(*, digits: int, outputs: int, seed: int = 0, noise: float = 0.025) -> tuple[np.ndarray, np.ndarray]:
    """48 conditions, two runs each: inputs, and outputs about 2 to 9 with so many digits behind the point."""
    rng = np.random.default_rng(seed)
    mean = np.repeat(rng.uniform(2, 9, (48, outputs)), 2, 0)
    return np.repeat(np.arange(48.0), 2)[:, None], (mean * np.exp(noise * rng.normal(size=mean.shape))).round(
        digits
    )


def test_a_copied_block_is_found_and_nothing_else() -> None:
    inputs, outputs = rows(digits=3, outputs=4)
    assert find_copies(inputs, outputs) == {}
    block = np.r_[0:96, 10:30]
    assert find_copies(inputs[block], outputs[block]) == {96 + i: 10 + i for i in range(20)}
    one = np.r_[0:96, 5]
    assert find_copies(inputs[one], outputs[one]) == {96: 5}


def test_a_row_of_other_inputs_is_no_copy() -> None:
    inputs, outputs = rows(digits=3, outputs=4)
    outputs[4] = outputs[50]
    assert find_copies(inputs, outputs) == {}


@pytest.mark.parametrize("seed", range(20))
def test_repeats_in_coarse_numbers_are_kept(seed: int) -> None:
    """With two outputs in steps of 0.1, one in about thirty pairs of repeats agrees by chance."""
    inputs, outputs = rows(digits=1, outputs=2, seed=seed)
    assert find_copies(inputs, outputs) == {}


def test_coarse_repeats_do_agree_by_chance() -> None:
    """Otherwise the test above could not fail."""
    equal = [rows(digits=1, outputs=2, seed=seed)[1] for seed in range(20)]
    assert sum((outputs[::2] == outputs[1::2]).all(1).sum() for outputs in equal) > 20


@pytest.mark.usefixtures("toy_model")
def test_copied_rows_are_no_repeats() -> None:
    """The noise is taken from repeats: with 40 copies among 136 rows p was 0.003, and without them 0.24."""
    table = toy_table(3)
    copied = pd.concat([table, table[:40].assign(session="N=9", run=0)], ignore_index=True)
    runs = read_measurements(copied)
    assert len(runs) == len(table)
    assert runs.y == pytest.approx(read_measurements(table).y, rel=1e-14)
    assert runs.excluded[0] == "row 97: a copy of an earlier row, equal in all inputs and outputs (row 1)"
    assert len(runs.excluded) == 40
    result, without = calibrated(copied), calibrated(table)
    assert result.evidence.misfit.p_value == without.evidence.misfit.p_value
    assert result.conditions.summary_of_excluded[0].startswith(
        "40 of 136 rows (rows 97, 98, 99 and 37 more): a copy"
    )
    assert result.conditions.rows == 136


@pytest.mark.usefixtures("toy_model")
def test_copies_of_single_runs_are_no_repeats_either() -> None:
    table = toy_table(3)
    single = table[table["trial"] == 1]
    with pytest.raises(InputError, match="0 repeated runs, without 48 copies of rows"):
        read_measurements(pd.concat([single, single]))
