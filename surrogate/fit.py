"""Fit networks: Adam in small batches, then BFGS on all rows, with a loss that few bad rows do not rule.

    loss = mean over rows of (|r|² + ε²)^¼,   r = residual of a row, in units of what is asked for

The error of a network is a hundred times larger in some corners than in the middle. Least squares would serve only
those corners: with it the median error is five times as large. ε falls from 0.1 to 0.0005 while Adam runs. The
optimiser needs double precision: the residuals are as small as 1e-5.

BFGS keeps its whole matrix (`surrogate.quasi_newton`). In equal time L-BFGS ends with errors two to four times as
large (docs/explanation/lookup.md). Everything is repeatable from the seed on one machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.nn.utils import parameters_to_vector, vector_to_parameters
from tqdm import tqdm

from surrogate.network import Ensemble
from surrogate.quasi_newton import Minimiser

Bar = Any  # tqdm is generic for type checkers only
Residual = Callable[[Tensor, Tensor], Tensor]  # y (K, m, O) of the rows at indices (m,) -> r (K, m, D)

_POWER = 0.25
_SOFTEST, _HARDEST = 0.1, 5e-4  # ε
_STAGE = 50  # BFGS iterations between two steps of the progress bar


@dataclass(frozen=True)
class Settings:
    """How to train; the seed makes it repeatable."""

    width: int = 64
    depth: int = 3
    members: int = 2
    epochs: int = 150  # of Adam
    batch: int = 256
    learning_rate: float = 4e-3
    iterations: int = 600  # of BFGS
    seed: int = 1


def fit(network: Ensemble, inputs: Tensor, residual: Residual, settings: Settings, title: str) -> None:
    """Train `network` in place.

    Args:
        network: with its shift and scale set.
        inputs: (M, F).
        residual: what is to be small.
        title: of the progress bar, which shows the median of |r|; empty for none.
    """
    x = (inputs - network.shift) / network.scale
    stages = -(-settings.iterations // _STAGE) * settings.members
    with tqdm(total=settings.epochs + stages, desc=title, delay=1.0, disable=not title) as bar:
        _adam(network, x, residual, settings, bar)
        for k in range(settings.members):
            alone = network.member(k)
            _polish(alone, x, residual, settings.iterations, bar)
            network.replace_member(k, alone)
    network.requires_grad_(False)


def _adam(network: Ensemble, x: Tensor, residual: Residual, settings: Settings, bar: Bar) -> None:
    """Small batches, all members side by side."""
    network.requires_grad_(True)
    generator = torch.Generator().manual_seed(settings.seed)
    adam = torch.optim.Adam(network.parameters(), lr=settings.learning_rate)
    batches = -(-len(x) // settings.batch)
    steps = max(settings.epochs * batches, 100)
    schedule = torch.optim.lr_scheduler.OneCycleLR(adam, settings.learning_rate, total_steps=steps, pct_start=0.1)
    for epoch in range(settings.epochs):
        soft = _SOFTEST * (_HARDEST / _SOFTEST) ** (epoch / settings.epochs)
        for rows in torch.randperm(len(x), generator=generator).chunk(batches):
            adam.zero_grad(set_to_none=True)
            _loss(_residuals(network, x, residual, rows), soft).backward()  # type: ignore[no-untyped-call]
            adam.step()
            schedule.step()
        _look(network, x, residual, bar)


def _polish(network: Ensemble, x: Tensor, residual: Residual, iterations: int, bar: Bar) -> None:
    """All rows at once, one member."""
    network.requires_grad_(True)
    parameters = list(network.parameters())
    everything = torch.arange(len(x))

    def value_and_gradient(point: Tensor) -> tuple[float, Tensor]:
        vector_to_parameters(point, parameters)
        value = _loss(_residuals(network, x, residual, everything), _HARDEST)
        slopes = torch.autograd.grad(value, parameters)
        return value.item(), parameters_to_vector(slopes).detach()

    minimiser = Minimiser(value_and_gradient, parameters_to_vector(parameters).detach())
    for i in range(1, iterations + 1):
        moved = minimiser.step()
        if i % _STAGE == 0 or i == iterations:
            vector_to_parameters(minimiser.x, parameters)
            _look(network, x, residual, bar)
        if not moved:
            break
    vector_to_parameters(minimiser.x, parameters)


def _residuals(network: Ensemble, x: Tensor, residual: Residual, rows: Tensor) -> Tensor:
    return residual(network.standardised(x[rows]) * network.spread + network.mean, rows)


def _loss(residuals: Tensor, soft: float) -> Tensor:
    return ((residuals.square().sum(-1) + soft**2) ** _POWER).mean(1).sum()


def _look(network: Ensemble, x: Tensor, residual: Residual, bar: Bar) -> None:
    """Advance the bar and show the median residual."""
    with torch.no_grad():
        size = _residuals(network, x, residual, torch.arange(len(x))).norm(dim=-1).mean(0).median()
    bar.set_postfix_str(f"median residual {float(size):.2e}", refresh=False)
    bar.update()
