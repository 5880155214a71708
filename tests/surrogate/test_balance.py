"""Compiled queries: networks, inputs and motions against the same by torch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

import surrogate
from sim.compiling import folder_of_package
from surrogate.networks import compiled as perceptron
from surrogate.networks.compiled import evaluate_rows, packed
from surrogate.networks.ensemble import Ensemble
from surrogate.table.model_file import load
from surrogate.table.wrench_table import class_of, rows_of
from surrogate.training.simulated import drawn
from surrogate.wrench import heads as head
from surrogate.wrench import tails as tail
from surrogate.wrench.balance import inputs_rows, solve_rows
from tests.oracles.balance import linear_guess, solve
from tests.surrogate.small import rows, table


def test_loops_are_kept_by_all_files_of_the_package() -> None:
    """Loops of one folder are made of formulas in another one."""
    folder = folder_of_package(Path(surrogate.__file__).parent)
    assert Path(solve_rows.stats.cache_path).is_relative_to(folder)


def test_tanh_is_exact_to_the_last_digits() -> None:
    x = np.concatenate([np.linspace(-30, 30, 4001), [0.0, 1e-9, -1e-9, 800.0, -800.0]])
    found = x.copy()
    perceptron._tanh(found)
    assert np.abs(found - np.tanh(x)).max() < 5e-16


@pytest.mark.parametrize(("inputs", "width", "depth", "members"), [(7, 64, 3, 1), (6, 5, 1, 3), (9, 10, 2, 2)])
def test_networks_answer_as_with_torch(inputs: int, width: int, depth: int, members: int) -> None:
    network = Ensemble(inputs, 4, width=width, depth=depth, members=members, seed=3)
    generator = torch.Generator().manual_seed(4)
    for part in (network.bypass.data, network.shift, network.scale, network.mean, network.spread):
        part.copy_(1 + torch.rand(part.shape, generator=generator, dtype=torch.float64))
    x = torch.randn(20, inputs, generator=generator, dtype=torch.float64)
    assert evaluate_rows(packed(network), x.numpy()) == pytest.approx(network(x).detach().numpy(), rel=1e-12)


def test_motions_are_those_of_torch() -> None:
    robots = drawn(2000, 31, wide=False)
    robots = {name: values[robots["N"] > 1] for name, values in robots.items()}
    heads, tails = head.robots_of(robots)
    lookup = load().tails
    motion, converged = lookup.solve(heads, tails)
    assert converged.mean() > 0.999
    kind = class_of(tails.number)
    for k, network in enumerate(lookup.wrench[1:], 1):
        rows = torch.nonzero(kind == k)[:, 0]
        assert network is not None
        wanted, known = solve(head.at(heads, rows), tail.at(tails, rows), network)
        both = known.numpy() & converged[rows.numpy()]
        assert motion[rows.numpy()][both] == pytest.approx(wanted.numpy()[both], rel=1e-6)
    inputs = inputs_rows(tail.columns_of(tails), motion)[converged]
    by_torch = tail.inputs_of(tails, torch.from_numpy(motion)).numpy()[converged]
    assert inputs == pytest.approx(by_torch, rel=1e-10, abs=1e-12)


def test_forces_are_in_balance() -> None:
    robots = rows(256, 13, wide=False).robots
    heads, tails = head.robots_of(robots)
    found, converged = table().tails.solve(heads, tails)
    assert converged.mean() > 0.97
    network = table().tails.wrench[2]
    assert network is not None
    motion = torch.from_numpy(found)
    left = head.unbalanced(heads, tails, motion[:, :4], network)
    size = (heads.resistance.abs() @ motion.abs()[..., None])[..., 0]
    assert float((left / size)[torch.from_numpy(converged)].abs().max()) < 1e-6


def test_linear_theory_is_a_good_start() -> None:
    some = rows(256, 13, wide=False)
    found = rows_of(some.robots, some.motion)
    guess = linear_guess(found.heads, found.tails)
    assert float((guess[:, 3] / found.motion[:, 3] - 1).abs().median()) < 0.1
    assert float((guess[:, 2] / found.motion[:, 2] - 1).abs().median()) < 0.3
