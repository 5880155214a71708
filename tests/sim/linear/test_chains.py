"""Chains that meet through the body alone."""

from __future__ import annotations

import numpy as np
import pytest

from sim.linear import chains as separate
from tests.sim.linear.systems import dense_matrix, random_chains


@pytest.mark.parametrize(("n", "count"), [(2, 1), (3, 2), (9, 5)])
def test_the_factors_solve_the_dense_system_for_any_right_hand_side(n: int, count: int) -> None:
    chains = random_chains(n, count, 1, seed=n)
    matrix = dense_matrix(chains)
    rng = np.random.default_rng(1)
    for first in (True, False):
        s, t = rng.normal(size=(n, count, 3)), rng.normal(size=4)
        right = np.concatenate([s.ravel(), t])
        if first:
            separate.factor_and_solve(chains, s, t)
        else:
            separate.solve(chains, s, t)
        assert matrix @ np.concatenate([s.ravel(), t]) == pytest.approx(right, abs=1e-11)
