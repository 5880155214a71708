"""Which sessions are held out, which runs are outliers, and how excluded rows are said."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calibration.statistics.study import (
    caveat_of_excluded,
    count_of_rows,
    find_outliers,
    middle_session,
    summary_of_excluded,
)

SIGN = "has the wrong sign for its omega_rpm: the head turns against the motor"
EXCLUDED = (
    "row 9: theta_deg = nan is not a finite number",
    *(f"row {i}: omega_h_rpm = {i / 7:g} {SIGN}" for i in (2, 3, 5, 8)),
    *(f"row {i}: a copy of an earlier row, equal in all inputs and outputs (row {i - 10})" for i in (11, 12)),
    *(f"row {i}: R_yr is {i} standard deviations from its repeat" for i in (14, 17)),
    "column colour: not known, left out",
)


def runs_of(sizes: list[int]) -> Any:
    session = np.repeat(np.arange(len(sizes)), sizes)
    names = tuple(f"s{place:03d}" for place in range(len(sizes)))
    return SimpleNamespace(session=session, session_names=names, condition=np.arange(len(session)))


@pytest.mark.parametrize(
    ("sizes", "held_out"),
    [
        ([32] * 4, [2]),
        ([7] * 12, [6]),
        ([1] * 96, [44, 45, 46, 47, 48, 49, 50, 51]),  # one run, whose error says nothing, used to be held out
        ([30, 30, 2, 30, 30], [1, 2]),
    ],
    ids=["four", "twelve", "of one run each", "a short one in the middle"],
)
def test_neighbours_join_short_sessions(sizes: list[int], held_out: list[int]) -> None:
    runs = runs_of(sizes)
    held = middle_session(runs)
    assert sorted(set(runs.session[held].tolist())) == held_out
    assert not set(runs.session[held]) & set(runs.session[~held])


def pairs(count: int, seed: int) -> Any:
    """Conditions of two runs, with two outputs of unit noise."""
    y = np.random.default_rng(seed).normal(size=(2 * count, 2))
    condition, rows = np.repeat(np.arange(count), 2), np.arange(2 * count)
    return SimpleNamespace(y=y, condition=condition, rows=rows, outputs=("R_yr", "theta"))


def test_runs_that_were_mistracked_are_excluded_and_clean_ones_are_not() -> None:
    runs = pairs(200, seed=0)
    mistracked = np.arange(0, 400, 40)
    assert not find_outliers(runs, np.zeros_like(runs.y))[0].any()
    runs.y[mistracked, 1] += 16.0
    bad, reasons = find_outliers(runs, np.zeros_like(runs.y))
    assert set(np.flatnonzero(bad)) <= set(mistracked)
    assert bad.sum() >= 8
    assert all("theta is" in reason for reason in reasons)
    kept = runs.y[~bad]
    assert kept.std(0) == pytest.approx([1, 1], abs=0.12)
    effect = pairs(200, seed=1)
    effect.y[:200] += 15.0  # it changes all repeats
    assert not find_outliers(effect, np.zeros_like(effect.y))[0].any()


def test_excluded_rows_of_one_reason_are_one_line() -> None:
    assert summary_of_excluded(EXCLUDED, 40) == [
        f"4 of 40 rows (rows 2, 3, 5 and 1 more): omega_h_rpm {SIGN}",
        "2 of 40 rows (rows 11, 12): a copy of an earlier row, equal in all inputs and outputs",
        "2 of 40 rows (rows 14, 17): R_yr is standard deviations from its repeat",
        "row 9: theta_deg = nan is not a finite number",
        "column colour: not known, left out",
    ]
    assert summary_of_excluded((), 40) == []
    assert count_of_rows(EXCLUDED) == 9
    lines = (
        "row 1: N = 2.5 is not a whole number",
        "row 2: N = three is not a finite number",
        "row 3: N = 7 is not above 0",
    )
    assert summary_of_excluded(lines, 9) == list(lines)  # they differ in more than a value
    assert caveat_of_excluded(EXCLUDED, 45) == ()  # a fifth
    assert caveat_of_excluded(EXCLUDED, 44)[0].startswith("9 of 44 rows (20 %) were excluded")
