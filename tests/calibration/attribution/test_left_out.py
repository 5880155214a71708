"""Numbers of a group are known to left-out runs as well as other runs know them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calibration.attribution.left_out import _of_groups_known_so_well
from calibration.statistics.statistical_model import Parameter


@pytest.mark.parametrize("variance", [0.0, 0.1, 1e12], ids=["known", "known roughly", "unknown"])
def test_a_start_is_as_certain_in_left_out_runs_as_others_know_it(variance: float) -> None:
    """As that of a swim whose first stretch is left out: later poses say little of where it began."""
    shared = Parameter("shared", "shared", 0.0, (-9.0, 9.0), 1.0)
    start = Parameter("start", "start", 0.0, (-9.0, 9.0), 1.0, of_group=("start", "part 1"))
    fit: Any = SimpleNamespace(fitted=(shared, start))
    slopes, white = np.array([[1.0, 1.0], [2.0, 1.0], [3.0, 1.0]]), np.array([1.0, 2.0, 6.0])
    covariance = np.array([[1e6, 0.0], [0.0, variance]])
    left = _of_groups_known_so_well(fit, white, covariance, slopes)
    dense = np.eye(3) + variance * np.outer(slopes[:, 1], slopes[:, 1])
    assert left @ left == pytest.approx(white @ np.linalg.solve(dense, white), rel=1e-3)
    if variance == 0:
        assert left == pytest.approx(white)
