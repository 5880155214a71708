"""The zigzag against arcs, and the drift of a robot whose two directions differ."""

from __future__ import annotations

import numpy as np
import pytest

from planner.vehicle.rollout import Switches, trace
from planner.vehicle.zigzag import zigzag
from tests.planner.vehicles import vehicle


def test_an_even_robot_swims_straight_and_a_lopsided_one_at_an_angle() -> None:
    even, odd = zigzag(vehicle(), 0.8), zigzag(vehicle(bias=0.3), 0.8)
    assert even.drift == pytest.approx(0.0, abs=1e-12)
    assert even.dwells == pytest.approx((0.8, 0.8))
    assert odd.dwells[0] == pytest.approx(0.8)
    assert odd.dwells[1] / odd.dwells[0] == pytest.approx(1.3 / 0.7, rel=0.02)
    # With (T+, T−) that turn as far, the mean sideways speed is (Ω− v+ − Ω+ v−)/(Ω+ + Ω−), v without lags.
    assert odd.drift == pytest.approx(0.0424 * (0.7 - 1.3) / 2, rel=0.05)


def test_the_zigzag_is_that_of_arcs() -> None:
    """Without lags: net speed V cos θ sinc(ΩT/2), and the same arcs seen from their mean line."""
    car = vehicle(lag=0.0)
    found = zigzag(car, 2.0)
    angle = 0.0489 * 2.0 / 2
    assert found.net_speed == pytest.approx(0.0179 * np.sin(angle) / angle, rel=1e-6)
    pair = Switches(1, np.array([2.0, 2.0]), np.array([[0.0, 0.0, -angle]]))
    across = trace(car, pair, 0.0, samples=400)[:-1, 1]
    assert found.rms == pytest.approx(across.std(), rel=0.02)
