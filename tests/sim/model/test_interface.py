"""Side force on the head from the viscosity profile."""

from __future__ import annotations

import math

import pytest

from sim.model.interface import side_force_coefficient


def test_side_force_coefficient_of_the_paper_s_profile() -> None:
    assert side_force_coefficient() == pytest.approx(-1.4026, abs=1e-4)
    assert side_force_coefficient(steepness=5000.0) == pytest.approx(-2 * math.sqrt(1 - 0.49), rel=1e-3)
