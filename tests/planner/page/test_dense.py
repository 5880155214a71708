"""Small systems of equations, with exchanges of rows."""

from __future__ import annotations

import numpy as np

from tests.planner.page.page_core import answer, check_near


def test_the_inverse() -> None:
    rng = np.random.default_rng(0)
    for size in (1, 3, 4):
        matrix = rng.normal(size=(size, size))
        matrix[0, 0] = 1e-14 if size > 1 else 2.0
        check_near(answer("dense.js", "inverse", matrix), np.linalg.inv(matrix), 1e-11)


def test_a_matrix_without_an_inverse() -> None:
    assert not np.isfinite(answer("dense.js", "inverse", [[1.0, 2.0], [2.0, 4.0]])).all()
