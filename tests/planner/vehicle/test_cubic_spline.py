"""Cubic splines against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from planner.vehicle.cubic_spline import spline_at


@pytest.mark.parametrize("count", [4, 5, 26])
@pytest.mark.parametrize("flat_end", [False, True])
def test_splines_are_those_of_scipy(count: int, flat_end: bool) -> None:
    """Between the knots, at them, and beyond them."""
    random = np.random.default_rng(count)
    knots = np.cumsum(random.uniform(0.1, 1.0, count))
    values = random.standard_normal((count, 3, 2))
    places = np.concatenate([np.linspace(knots[0] - 0.05, knots[-1] + 0.05, 301), knots])
    ends = ("not-a-knot", "clamped") if flat_end else "not-a-knot"
    wanted = CubicSpline(knots, values, bc_type=ends)(places)
    assert spline_at(knots, values, places, flat_end=flat_end) == pytest.approx(wanted, rel=1e-12, abs=1e-12)
