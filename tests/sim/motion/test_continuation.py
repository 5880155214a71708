"""Continuation follows curves around folds, and locates where a value is zero."""

from __future__ import annotations

import numpy as np
import pytest

from sim.arrays import Floats
from sim.motion.continuation import first_point, follow, locate


class Cubic:
    """s − 1/2 = z − 4 z³, with folds at z = ±1/√12."""

    tolerance = 1e-10

    def correction(self, y: Floats, row: Floats, defect: float) -> Floats:
        z, s = y
        matrix = np.array([[12 * z**2 - 1, 1.0], row])
        return np.linalg.solve(matrix, [-(s - 0.5 - z + 4 * z**3), -defect])

    def tangent(self, y: Floats, row: Floats) -> Floats:
        return np.linalg.solve(np.array([[12 * y[0] ** 2 - 1, 1.0], row]), [0.0, 1.0])

    def moved(self, y: Floats, dy: Floats) -> Floats:
        return y + dy

    def is_valid(self, y: Floats) -> bool:
        return True


class Circle(Cubic):
    """z² + (s − 1/2)² = 1/16."""

    def correction(self, y: Floats, row: Floats, defect: float) -> Floats:
        z, s = y
        return np.linalg.solve(np.array([[2 * z, 2 * s - 1], row]), [-(z**2 + (s - 0.5) ** 2 - 1 / 16), -defect])

    def tangent(self, y: Floats, row: Floats) -> Floats:
        return np.linalg.solve(np.array([[2 * y[0], 2 * y[1] - 1], row]), [0.0, 1.0])


def test_a_curve_is_followed_around_both_folds_to_the_end() -> None:
    curve = Cubic()
    first = first_point(curve, np.array([0.6, 0.0]), 1.0)
    assert first is not None
    points = list(follow(curve, first, 500))
    assert points[-1].s == pytest.approx(1.0, abs=1e-6)
    assert points[-1].y[0] < -0.5
    signs = np.sign([point.turns for point in points])
    assert np.count_nonzero(np.diff(signs)) == 2
    for point in points:
        z, s = point.y
        assert s - 0.5 == pytest.approx(z - 4 * z**3, abs=1e-9)
        assert np.linalg.norm(point.tangent) == pytest.approx(1.0)


def test_folds_are_located() -> None:
    curve = Cubic()
    here = first_point(curve, np.array([0.6, 0.0]), 1.0)
    assert here is not None
    folds = []
    for point in follow(curve, here, 500):
        if here.turns * point.turns < 0:
            fold = locate(curve, here, point, lambda p: p.turns)
            assert fold is not None
            folds.append(fold.y[0])
        here = point
    assert folds == pytest.approx([1 / np.sqrt(12), -1 / np.sqrt(12)], abs=1e-6)


def test_a_closed_curve_is_followed_once() -> None:
    curve = Circle()
    first = first_point(curve, np.array([0.2, 0.4]), 1.0)
    assert first is not None
    points = list(follow(curve, first, 1000))
    around = sum(np.linalg.norm(b.y - a.y) for a, b in zip([first, *points[:-1]], points, strict=True))
    assert around == pytest.approx(np.pi / 2, rel=0.1)


def test_a_guess_too_far_away_is_no_solution() -> None:
    assert first_point(Cubic(), np.array([50.0, 0.5]), 1.0) is None
