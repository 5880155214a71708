"""Small dense matrices."""

from __future__ import annotations

import numpy as np
import pytest

from sim.linear.dense import invert, solve_dense


@pytest.mark.parametrize("size", [6, 18, 48])
def test_inverse(size: int) -> None:
    matrix = np.random.default_rng(size).normal(size=(size, size)) + size * np.eye(size)
    inverse = matrix.copy()
    invert(inverse)
    assert inverse @ matrix == pytest.approx(np.eye(size), abs=1e-11)


def test_dense_equations_need_row_exchanges() -> None:
    matrix = np.array([[0.0, 2.0, 1.0], [1.0, 1.0, 0.0], [3.0, 0.0, 1.0]])
    right = np.array([[1.0, 2.0], [2.0, 0.0], [3.0, 1.0]])
    found = right.copy()
    solve_dense(matrix.copy(), found)
    assert matrix @ found == pytest.approx(right, abs=1e-14)
