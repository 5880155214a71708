"""Fit networks: Adam in small batches, then L-BFGS on all rows, with a loss that few bad rows do not rule.

    loss = mean over rows of (|r|² + ε²)^¼,   r = residual of a row, in units of what is asked for

The error of a network is a hundred times larger in some corners than in the middle. Least squares would serve only
those corners: with it the median error is five times as large. ε falls from 0.1 to 0.0005 while Adam runs. The
optimiser needs double precision: the residuals are as small as 1e-5.

Everything is repeatable from the seed on one machine. Source: Liu and Nocedal (1989) for L-BFGS.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor
from tqdm import tqdm

from surrogate.network import Ensemble

Residual = Callable[[Tensor, Tensor], Tensor]  # y (K, m, O) of the rows at indices (m,) -> r (K, m, D)

_POWER = 0.25
_SOFTEST, _HARDEST = 0.1, 5e-4  # ε
_HISTORY = 80  # of L-BFGS
_STAGE = 100  # L-BFGS iterations between two looks at the time


@dataclass(frozen=True)
class Settings:
    """How to train; the seed makes it repeatable."""

    width: int = 64
    depth: int = 3
    members: int = 2
    epochs: int = 150  # of Adam
    batch: int = 256
    learning_rate: float = 4e-3
    iterations: int = 600  # of L-BFGS
    seed: int = 1


def fit(network: Ensemble, inputs: Tensor, residual: Residual, settings: Settings, title: str) -> None:
    """Train `network` in place.

    Args:
        network: with its shift and scale set.
        inputs: (M, F).
        residual: what is to be small.
        title: of the progress bar, which shows the median of |r|; empty for none.
    """
    for parameter in network.parameters():
        parameter.requires_grad_(True)
    x = (inputs - network.shift) / network.scale
    everything = torch.arange(len(x))
    batches = -(-len(x) // settings.batch)
    generator = torch.Generator().manual_seed(settings.seed)
    adam = torch.optim.Adam(network.parameters(), lr=settings.learning_rate)
    steps = max(settings.epochs * batches, 100)
    schedule = torch.optim.lr_scheduler.OneCycleLR(adam, settings.learning_rate, total_steps=steps, pct_start=0.1)
    stages = -(-settings.iterations // _STAGE)

    def outputs(rows: Tensor) -> Tensor:
        return network.standardised(x[rows]) * network.spread + network.mean

    def loss(rows: Tensor, soft: float) -> Tensor:
        squared = residual(outputs(rows), rows).square().sum(-1)
        return ((squared + soft**2) ** _POWER).mean(1).sum()

    def look(bar: tqdm) -> None:  # type: ignore[type-arg]
        with torch.no_grad():
            size = residual(outputs(everything), everything).norm(dim=-1).mean(0).median()
        bar.set_postfix_str(f"median residual {float(size):.2e}", refresh=False)
        bar.update()

    with tqdm(total=settings.epochs + stages, desc=title, delay=1.0, disable=not title) as bar:
        for epoch in range(settings.epochs):
            soft = _SOFTEST * (_HARDEST / _SOFTEST) ** (epoch / settings.epochs)
            for rows in torch.randperm(len(x), generator=generator).chunk(batches):
                adam.zero_grad(set_to_none=True)
                loss(rows, soft).backward()  # type: ignore[no-untyped-call]
                adam.step()
                schedule.step()
            look(bar)
        polish = torch.optim.LBFGS(
            network.parameters(), max_iter=_STAGE, max_eval=2 * _STAGE, history_size=_HISTORY,
            line_search_fn="strong_wolfe", tolerance_change=0.0, tolerance_grad=0.0,
        )  # fmt: skip

        def closure() -> Tensor:
            polish.zero_grad(set_to_none=True)
            value = loss(everything, _HARDEST)
            value.backward()  # type: ignore[no-untyped-call]
            return value

        for _ in range(stages):
            polish.step(closure)  # type: ignore[no-untyped-call]
            look(bar)
    for parameter in network.parameters():
        parameter.requires_grad_(False)
