"""GMRES on dense matrices."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from sim.linear.gmres import combine, extend, new_krylov, start


def solved(matrix: np.ndarray, right: np.ndarray, most: int, tolerance: float) -> tuple[np.ndarray, list[float]]:
    """Solve; return the solution and the relative residuals that GMRES states on the way."""
    krylov = new_krylov(len(right), most)
    assert start(krylov, right) == pytest.approx(np.linalg.norm(right))
    left: list[float] = []
    for i in range(most):
        left.append(extend(krylov, i, matrix @ krylov.basis[i]))
        if left[-1] < tolerance:
            break
    return combine(krylov, len(left)), left


def test_it_solves_in_as_many_steps_as_there_are_unknowns() -> None:
    rng = np.random.default_rng(0)
    matrix, right = rng.normal(size=(12, 12)) + 3 * np.eye(12), rng.normal(size=12)
    found, left = solved(matrix, right, 12, 1e-13)
    assert matrix @ found == pytest.approx(right, abs=1e-10)
    assert all(b <= a * (1 + 1e-12) for a, b in pairwise(left))  # residuals never grow


def test_a_few_eigenvalues_away_from_one_cost_as_many_steps() -> None:
    """The identity and a change of rank three: four steps."""
    rng = np.random.default_rng(1)
    matrix = np.eye(40) + rng.normal(size=(40, 3)) @ rng.normal(size=(3, 40))
    right = rng.normal(size=40)
    found, left = solved(matrix, right, 40, 1e-10)
    assert len(left) == 4
    assert matrix @ found == pytest.approx(right, abs=1e-8)


def test_the_stated_residual_is_the_true_one() -> None:
    rng = np.random.default_rng(2)
    matrix, right = rng.normal(size=(30, 30)) + 8 * np.eye(30), rng.normal(size=30)
    for steps in (1, 4, 9):
        found, left = solved(matrix, right, steps, 0.0)
        true = np.linalg.norm(right - matrix @ found) / np.linalg.norm(right)
        assert left[-1] == pytest.approx(true, rel=1e-8)


def test_nothing_to_solve_for() -> None:
    krylov = new_krylov(5, 3)
    assert start(krylov, np.zeros(5)) == 0.0
    assert combine(krylov, 0) == pytest.approx(np.zeros(5))
