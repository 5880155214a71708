"""Numbers of a group are known to left-out runs as well as other runs know them."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.attribution.left_out import _known_so_well


@pytest.mark.parametrize("variance", [0.0, 0.1, 1e12], ids=["known", "known roughly", "unknown"])
def test_a_start_is_as_certain_in_left_out_runs_as_others_know_it(variance: float) -> None:
    """As that of a swim whose first stretch is left out: later poses say little of where it began."""
    slopes, white = np.ones((3, 1)), np.array([1.0, 2.0, 6.0])
    left = _known_so_well(white, slopes, np.array([[variance]]))
    dense = np.eye(3) + variance * slopes @ slopes.T
    assert left @ left == pytest.approx(white @ np.linalg.solve(dense, white), rel=1e-3)
    if variance == 0:
        assert left == pytest.approx(white)
