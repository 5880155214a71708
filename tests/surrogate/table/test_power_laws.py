"""Laws of force on head and disc need no learning: the networks are of the tails."""

from __future__ import annotations

import numpy as np
import pytest

from sim.model.groups import Groups
from sim.motion.steady import steady
from surrogate.table.model_file import load
from tests.sim.robots import CONTROL_VALUES

LAW = "law_Fx_wt_rectified_speed-100_length1000_tails1000"


def test_robots_of_several_numbers_of_tails_are_answered_in_one_query() -> None:
    tails, sizes = np.array([2.0, 3.0]), np.array([1.0, 1.5])
    columns = {name: np.full(2, float(value)) for name, value in CONTROL_VALUES.items()}
    answer = load().query(columns | {"N": tails, LAW: sizes})
    for row in range(2):
        one = {name: np.array([float(value)]) for name, value in CONTROL_VALUES.items()}
        with_law = Groups.from_columns(one | {"N": tails[row : row + 1], LAW: sizes[row : row + 1]})
        without = Groups.from_columns(one | {"N": tails[row : row + 1]})
        wanted = float(steady(with_law).omega_yr[0])
        assert answer["omega_yr_bar"][row] == pytest.approx(wanted, rel=5e-3)
        assert abs(wanted / float(steady(without).omega_yr[0]) - 1) > 0.02
