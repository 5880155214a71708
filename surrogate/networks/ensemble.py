"""Networks of the look-up table: small multilayer perceptrons in double precision.

    h_0 = x,   h_i = tanh(W_i h_{i−1} + b_i),   y = W h + b + A x

K members are evaluated side by side; their mean is the answer. Inputs are shifted and scaled first. A scale
larger than the spread says that the output changes slowly along this input; the first weights are then small.
This is prior knowledge of the problem, and training gains much from it (docs/explanation/lookup.md).
"""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn


class Ensemble(nn.Module):
    """K perceptrons, each plus a linear map; inputs (M, F), outputs (M, O)."""

    shift: Tensor
    scale: Tensor
    mean: Tensor
    spread: Tensor

    def __init__(self, inputs: int, outputs: int, *, width: int, depth: int, members: int, seed: int):
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        sizes = [inputs, *[width] * depth, outputs]

        def random(*shape: int) -> Tensor:
            return torch.randn(*shape, generator=generator, dtype=torch.float64)

        pairs = list(pairwise(sizes))
        self.weights = nn.ParameterList(
            [nn.Parameter(random(members, i, o) / i**0.5 * (0.3 if k == depth else 1.0))
             for k, (i, o) in enumerate(pairs)]
        )  # fmt: skip
        self.biases = nn.ParameterList([nn.Parameter(0.3 * random(members, 1, o)) for _, o in pairs])
        self.bypass = nn.Parameter(torch.zeros(members, inputs, outputs, dtype=torch.float64))
        for name, size, value in (("shift", inputs, 0.0), ("scale", inputs, 1.0),
                                  ("mean", outputs, 0.0), ("spread", outputs, 1.0)):  # fmt: skip
            self.register_buffer(name, torch.full((size,), value, dtype=torch.float64))

    @property
    def shape(self) -> dict[str, int]:
        """Arguments that make a network of this form."""
        return {
            "inputs": self.bypass.shape[1],
            "outputs": self.bypass.shape[2],
            "width": self.weights[0].shape[2],
            "depth": len(self.weights) - 1,
            "members": self.bypass.shape[0],
        }

    def member(self, k: int) -> Ensemble:
        """Return a network of one member: a copy of member k."""
        alone = Ensemble(**{**self.shape, "members": 1}, seed=0).to(self.shift.device)
        state = self.state_dict()
        parameters = {name for name, _ in self.named_parameters()}
        alone.load_state_dict(
            {name: part[k : k + 1] if name in parameters else part for name, part in state.items()}
        )
        return alone

    def replace_member(self, k: int, alone: Ensemble) -> None:
        """Take the numbers of a network of one member as member k."""
        with torch.no_grad():
            for mine, other in zip(self.parameters(), alone.parameters(), strict=True):
                mine[k] = other[0]

    def standardised(self, x: Tensor) -> Tensor:
        """Return outputs of every member before `mean` and `spread`, (K, M, O), for standardised inputs (M, F)."""
        first = x.expand(self.bypass.shape[0], -1, -1)
        hidden = first
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            hidden = torch.tanh(torch.matmul(hidden, weight) + bias)
        return torch.matmul(hidden, self.weights[-1]) + self.biases[-1] + torch.matmul(first, self.bypass)

    def members_at(self, inputs: Tensor) -> Tensor:
        """Return outputs of every member, (K, M, O); of more inputs than it has, a network takes the first."""
        return (
            self.standardised((inputs[..., : len(self.shift)] - self.shift) / self.scale) * self.spread + self.mean
        )

    def forward(self, inputs: Tensor) -> Tensor:
        """Return the mean of the members, (M, O)."""
        return self.members_at(inputs).mean(0)
