"""Numbers of a group that only left-out runs know are fitted to these; others are predicted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calibration.attribution.left_out import _without_own_numbers
from calibration.statistics.statistical_model import Parameter


@pytest.mark.parametrize(
    ("of_others", "of_these", "fitted"),
    [(0.0, 1.0, True), (0.01, 1.0, True), (1.0, 1.0, False), (0.0, 0.0, False)],
    ids=["others know nothing", "others know hardly anything", "both know", "nobody knows"],
)
def test_a_start_is_fitted_to_left_out_runs_where_others_hardly_know_it(
    of_others: float, of_these: float, fitted: bool
) -> None:
    """As that of a swim whose first stretch is left out: later poses say little of where it began."""
    out = np.arange(6) < 3
    tangents = np.where(out, of_these, of_others)[:, None, None] * np.ones((6, 1, 2))
    shared = Parameter("shared", "shared", 0.0, (-9.0, 9.0), 1.0)
    start = Parameter("start", "start", 0.0, (-9.0, 9.0), 1.0, of_group=("start", "part 1"))
    fit: Any = SimpleNamespace(fitted=(shared, start), tangents=tangents)
    white = np.array([1.0, 2.0, 6.0])
    left = _without_own_numbers(fit, white, ~out, out, lambda table: table[:, 0])
    assert left == pytest.approx(white - white.mean() if fitted else white)
