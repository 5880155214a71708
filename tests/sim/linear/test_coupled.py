"""Chains that meet in time as well."""

from __future__ import annotations

import numpy as np
import pytest

from sim.linear import coupled
from sim.linear.spectral import differentiation
from tests.sim.linear.systems import joined_matrix, random_chains


@pytest.mark.parametrize(("n", "count", "instants"), [(2, 2, 2), (3, 3, 1), (6, 6, 3), (5, 8, 2)])
def test_the_factors_solve_the_dense_system_for_any_right_hand_side(n: int, count: int, instants: int) -> None:
    chains = random_chains(n, count, instants, seed=count)
    rng = np.random.default_rng(1)
    resistance, speed, D = rng.normal(size=(n, count, 3, 3)), rng.normal(size=count), differentiation(count)
    matrix = joined_matrix(chains, resistance, speed, D)
    system = coupled.new_coupled(np.empty(0), n, count, instants)
    coupling = coupled.Coupling(resistance, speed, D)
    for first in (True, False):
        s, t = rng.normal(size=(n, 3 * count)), rng.normal(size=4 * instants)
        right = np.concatenate([s.ravel(), t])
        if first:
            coupled.factor_and_solve(system, chains, coupling, s, t)
        else:
            coupled.solve(system, chains, s, t)
        assert matrix @ np.concatenate([s.ravel(), t]) == pytest.approx(right, abs=1e-10)
