"""The residuals of a hindrance: zero where the body is free, with the derivatives that differences give."""

from __future__ import annotations

import numpy as np
import pytest

from planner.jobs.hindered import Hindered
from planner.paths.obstacles import Circle, Footprint, FreeSpace, Polygon

BODY = Footprint(np.linspace(-0.5, 1.0, 6), 0.15)
SPACE = FreeSpace((Circle(1.0, 0.3, 0.4), Polygon.of([[-1, -1], [0, -1], [0, -0.4], [-1, -0.4]])))
POSES = np.array([[-3.0, 0.0, 0.0], [0.1, 0.0, 0.2], [0.4, -0.2, -0.5], [4.0, 0.0, 0.1]])


def hindered() -> Hindered:
    return Hindered(BODY, SPACE, 0.1, POSES[[0, -1], 2])


def test_residuals_are_what_the_discs_lack() -> None:
    residual, _ = hindered()(POSES)
    clearance = BODY.clearance(POSES, SPACE)
    assert residual.max(1) == pytest.approx(np.maximum(0.1 - clearance, 0.0), abs=1e-12)
    assert (residual[[0, -1]] == 0).all()


def test_derivatives_are_those_of_differences() -> None:
    _, slopes = hindered()(POSES)
    for i in range(3):
        step = np.zeros(3)
        step[i] = 1e-5
        difference = (hindered()(POSES + step)[0] - hindered()(POSES - step)[0]) / 2e-5
        assert slopes[..., i] == pytest.approx(difference, abs=1e-4)
