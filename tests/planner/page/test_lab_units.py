"""Motions in the units of a laboratory are Python's."""

from __future__ import annotations

import numpy as np
import pytest

from sim.motion.lab_units import lab_columns
from tests.planner.page.page_core import answer

MOTION = {"omega_h_bar": -12.5, "omega_t_bar": 40.25, "omega_yr_bar": -0.31, "R_yr_over_l": 0.42,
          "theta_deg": 31.5, "v_x": -0.03, "v_z": 0.11}  # fmt: skip


def test_lab_columns() -> None:
    wanted = lab_columns({name: np.array([value]) for name, value in MOTION.items()}, 9.5, 2.125)
    found = answer("lab_units.js", "labColumns", MOTION, 9.5, 2.125)
    assert set(wanted) - set(found) == {"circle_s"}
    for name, value in found.items():
        assert value == pytest.approx(float(wanted[name][0]), rel=1e-15)
