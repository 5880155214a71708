"""The table backwards."""

from __future__ import annotations

import numpy as np
import pytest

from sim.io.errors import InputError
from surrogate.table.inverse import inverse
from tests.surrogate.small import robots_inside, table


def test_inverse_finds_the_coefficients() -> None:
    robots = robots_inside(3)
    found = table().query(robots)
    targets = {name: found[name] for name in ("omega_t_bar", "omega_yr_bar", "v_z")}
    bounds = {"C_t": (0.5, 8.0), "C_r": (0.5, 6.0), "C_yr": (0.2, 12.0)}
    solved = inverse(table(), robots, targets, bounds)
    for target in range(3):
        own = solved.target == target
        distance = [np.abs(solved.inputs[name][own] / robots[name][target] - 1) for name in bounds]
        assert np.max(distance, axis=0).min() < 1e-3
    with pytest.raises(InputError, match="1 targets for 3 free inputs"):
        inverse(table(), robots, {"v_z": found["v_z"]}, bounds)
