"""Networks that torch trains; as trained they are a `surrogate.networks.ensemble.Ensemble`."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from surrogate.networks.ensemble import SHARED, Ensemble, state_shapes


class TrainableEnsemble(nn.Module):
    """K perceptrons, each plus a linear map; inputs (M, F), outputs (M, O)."""

    shift: Tensor
    scale: Tensor
    mean: Tensor
    spread: Tensor

    def __init__(self, inputs: int, outputs: int, *, width: int, depth: int, members: int, seed: int):
        super().__init__()
        self.shape = {"inputs": inputs, "outputs": outputs, "width": width, "depth": depth, "members": members}
        shapes = state_shapes(**self.shape)
        generator = torch.Generator().manual_seed(seed)

        def random(name: str) -> Tensor:
            return torch.randn(*shapes[name], generator=generator, dtype=torch.float64)

        layers = range(depth + 1)
        weights = [random(f"weights.{k}") for k in layers]
        weights = [w / w.shape[1] ** 0.5 * (0.3 if k == depth else 1.0) for k, w in enumerate(weights)]
        self.weights = nn.ParameterList([nn.Parameter(weight) for weight in weights])
        self.biases = nn.ParameterList([nn.Parameter(0.3 * random(f"biases.{k}")) for k in layers])
        self.bypass = nn.Parameter(torch.zeros(shapes["bypass"], dtype=torch.float64))
        for name, value in zip(SHARED, (0.0, 1.0, 0.0, 1.0), strict=True):
            self.register_buffer(name, torch.full(shapes[name], value, dtype=torch.float64))

    def trained(self) -> Ensemble:
        """Return the network with its numbers of now."""
        return Ensemble.from_state(
            {k: part.detach().cpu().numpy().copy() for k, part in self.state_dict().items()}
        )

    def member(self, k: int) -> TrainableEnsemble:
        """Return a network of one member: a copy of member k."""
        alone = TrainableEnsemble(**{**self.shape, "members": 1}, seed=0).to(self.shift.device)
        state = self.state_dict()
        alone.load_state_dict({n: part if n in SHARED else part[k : k + 1] for n, part in state.items()})
        return alone

    def replace_member(self, k: int, alone: TrainableEnsemble) -> None:
        """Take the numbers of a network of one member as member k."""
        with torch.no_grad():
            for mine, other in zip(self.parameters(), alone.parameters(), strict=True):
                mine[k] = other[0]

    def standardised(self, x: Tensor) -> Tensor:
        """Return outputs of every member before `mean` and `spread`, (K, M, O), for standardised inputs (M, F)."""
        hidden = x = x.expand(self.bypass.shape[0], -1, -1)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            hidden = torch.tanh(hidden @ weight + bias)
        return hidden @ self.weights[-1] + self.biases[-1] + x @ self.bypass
