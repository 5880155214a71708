"""Which sessions are held out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calibration.statistics.study import middle_session


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
