"""Which sessions are held out, and which runs are outliers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calibration.statistics.study import find_outliers, middle_session


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


def test_an_effect_that_changes_all_repeats_excludes_none() -> None:
    runs = pairs(200, seed=1)
    runs.y[:200] += 15.0
    assert not find_outliers(runs, np.zeros_like(runs.y))[0].any()
