"""Compiled queries: networks, inputs and motions against the same with arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import surrogate
from sim.compiling import folder_of_package
from surrogate.table.jacobian import numbers_of
from surrogate.table.model_file import load
from surrogate.table.wrench_table import network_index
from surrogate.training.fit_wrench import wrench_samples
from surrogate.training.simulated import draw_robots
from surrogate.wrench.balance import inverses_of
from surrogate.wrench.heads import heads_and_tails, unbalanced
from surrogate.wrench.motions import solve_rows
from tests.oracles.balance import linear_guess, solve
from tests.surrogate.small import rows, table


def test_loops_are_kept_by_all_files_of_the_package() -> None:
    """Loops of one folder are made of formulas in another one."""
    folder = folder_of_package(Path(surrogate.__file__).parent)
    assert solve_rows.path.parent == folder


def test_motions_are_those_of_another_method() -> None:
    robots = draw_robots(2000, 31, wide=False)
    robots = {name: values[robots["N"] > 1] for name, values in robots.items()}
    heads, tails = heads_and_tails(robots)
    lookup = load().tails
    motion, converged = lookup.solve(heads, tails)
    assert converged.mean() > 0.999
    kind = network_index(tails.number)
    for k, network in enumerate(lookup.wrench[1:], 1):
        rows = np.flatnonzero(kind == k)
        assert network is not None
        wanted, known = solve(heads.at(rows), tails.at(rows), numbers_of(network))
        both = known & converged[rows]
        assert motion[rows][both] == pytest.approx(wanted[both], rel=1e-6)


def test_inverses() -> None:
    """Of matrices of any size; one without an inverse gives numbers that are not finite."""
    matrices = np.random.default_rng(2).standard_normal((5, 3, 3))
    matrices[4] = 0.0
    before = matrices.copy()
    inverses = inverses_of(matrices)
    assert (matrices == before).all()
    assert inverses[:4] @ matrices[:4] == pytest.approx(np.broadcast_to(np.eye(3), (4, 3, 3)), abs=1e-12)
    assert not np.isfinite(inverses[4]).any()


def test_forces_are_in_balance() -> None:
    robots = rows(256, 13, wide=False).robots
    heads, tails = heads_and_tails(robots)
    found, converged = table().tails.solve(heads, tails)
    assert converged.mean() > 0.97
    network = table().tails.wrench[2]
    assert network is not None
    left = unbalanced(heads, tails, found[:, :4], numbers_of(network))
    size = (np.abs(heads.resistance) @ np.abs(found)[..., None])[..., 0]
    assert np.abs((left / size)[converged]).max() < 1e-6


def test_linear_theory_is_a_good_start() -> None:
    some = rows(256, 13, wide=False)
    found = wrench_samples(some.robots, some.motion)
    guess = linear_guess(found.heads, found.tails)
    assert np.median(np.abs(guess[:, 3] / found.motion[:, 3] - 1)) < 0.1
    assert np.median(np.abs(guess[:, 2] / found.motion[:, 2] - 1)) < 0.3
