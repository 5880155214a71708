"""Friction of the contact line: derivatives along its force and its speed."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.statistics.statistical_model import by_differences, start_values
from calibration.swimmer.candidate_effects import influences
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from tests.calibration.toy_tables import START, TRUTH

FRICTION, SPEED = "contact_line", "contact_line_speed"


def test_derivatives_along_both_numbers() -> None:
    second = influences()[FRICTION].parameter.second
    assert second is not None
    assert second.name == SPEED
    table = make_table(TRUTH, seed=2, tails=(2, 3), lengths_cm=(6.0, 9.0), title="")
    model = SwimmerModel(START, read_measurements(table))
    at = {**start_values(model), FRICTION: 0.3, SPEED: 6.0}
    ours, J = model.derivatives(at, [FRICTION, SPEED])
    theirs, differences = by_differences(model, at, [FRICTION, SPEED])
    assert ours == pytest.approx(theirs, abs=1e-3)
    scale = np.abs(differences).max((0, 1))
    assert (scale > 1e-4).all()
    assert (np.abs(J - differences).max((0, 1)) < 0.05 * scale).all()
