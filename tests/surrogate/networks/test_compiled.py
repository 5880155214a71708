"""Networks in compiled loops, with arrays and with torch."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from sim.linear.complex_step import derivative
from surrogate.networks.compiled import _tanh
from surrogate.networks.ensemble import Ensemble, state_shapes
from surrogate.networks.trainable import TrainableEnsemble


def test_tanh_is_exact_to_the_last_digits() -> None:
    x = np.concatenate([np.linspace(-30, 30, 4001), [0.0, 1e-9, -1e-9, 800.0, -800.0]])
    found = x.copy()
    _tanh(found, np.empty_like(found))
    assert np.abs(found - np.tanh(x)).max() < 5e-16


@pytest.mark.parametrize(("inputs", "width", "depth", "members"), [(7, 64, 3, 1), (6, 5, 1, 3), (9, 10, 2, 2)])
def test_networks_answer_alike_in_loops_with_arrays_and_with_torch(
    inputs: int, width: int, depth: int, members: int
) -> None:
    random = np.random.default_rng(4)
    shapes = state_shapes(inputs=inputs, outputs=4, width=width, depth=depth, members=members)
    network = Ensemble.from_state({name: random.uniform(0.5, 1.5, shape) for name, shape in shapes.items()})
    x = random.standard_normal((20, inputs))
    answer = network(x)
    assert network.packed.evaluate(x) == pytest.approx(answer, rel=1e-12)
    trainable = TrainableEnsemble(**network.shape, seed=0)
    trainable.load_state_dict({name: torch.from_numpy(array) for name, array in network.state.items()})
    y = trainable.standardised((torch.from_numpy(x) - trainable.shift) / trainable.scale)
    assert (y * trainable.spread + trainable.mean).mean(0).detach().numpy() == pytest.approx(answer, rel=1e-12)
    assert {k: a.tolist() for k, a in trainable.trained().state.items()} == {
        k: a.tolist() for k, a in network.state.items()
    }


def test_networks_carry_derivatives() -> None:
    """Of the mean of the members along a direction of the inputs, against differences."""
    network = TrainableEnsemble(5, 3, width=8, depth=2, members=2, seed=3).trained()
    random = np.random.default_rng(5)
    x, direction = random.standard_normal((7, 5)), random.standard_normal(5)
    wanted = (network(x + 1e-6 * direction) - network(x - 1e-6 * direction)) / 2e-6
    assert derivative(network, x, direction) == pytest.approx(wanted, rel=1e-6, abs=1e-9)
