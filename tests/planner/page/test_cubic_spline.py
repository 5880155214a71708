"""Splines are Python's, with both kinds of ends, also beyond them."""

from __future__ import annotations

import numpy as np
import pytest

from planner.vehicle.cubic_spline import spline_at
from tests.planner.page.page_core import answer, check_near


@pytest.mark.parametrize("flat_end", [False, True])
@pytest.mark.parametrize("count", [4, 9])
def test_splines(flat_end: bool, count: int) -> None:
    rng = np.random.default_rng(count)
    knots, values = np.cumsum(rng.uniform(0.3, 2, count)), rng.normal(size=(count, 5))
    places = np.array([*knots, *rng.uniform(knots[0] - 1, knots[-1] + 1, 30)])
    found = answer("cubic_spline.js", "splineAt", knots, values.ravel(), 5, places, flat_end)
    check_near(np.reshape(found, (-1, 5)), spline_at(knots, values, places, flat_end=flat_end), 1e-11)
