"""Compiled networks against the same by torch."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from surrogate.networks.compiled import _tanh, evaluate_rows, packed
from surrogate.networks.ensemble import Ensemble


def test_tanh_is_exact_to_the_last_digits() -> None:
    x = np.concatenate([np.linspace(-30, 30, 4001), [0.0, 1e-9, -1e-9, 800.0, -800.0]])
    found = x.copy()
    _tanh(found)
    assert np.abs(found - np.tanh(x)).max() < 5e-16


@pytest.mark.parametrize(("inputs", "width", "depth", "members"), [(7, 64, 3, 1), (6, 5, 1, 3), (9, 10, 2, 2)])
def test_networks_answer_as_with_torch(inputs: int, width: int, depth: int, members: int) -> None:
    network = Ensemble(inputs, 4, width=width, depth=depth, members=members, seed=3)
    generator = torch.Generator().manual_seed(4)
    for part in (network.bypass.data, network.shift, network.scale, network.mean, network.spread):
        part.copy_(1 + torch.rand(part.shape, generator=generator, dtype=torch.float64))
    x = torch.randn(20, inputs, generator=generator, dtype=torch.float64)
    assert evaluate_rows(packed(network), x.numpy()) == pytest.approx(network(x).detach().numpy(), rel=1e-12)
