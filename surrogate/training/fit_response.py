"""Fit the curves of the response to a flip, from simulated flips, see `surrogate.table.response_table`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from sim.arrays import Floats
from surrogate.networks.checkpoints import TrainingContext
from surrogate.networks.ensemble import Ensemble
from surrogate.networks.training_loop import Settings, fit
from surrogate.table.response_table import (
    PARTS,
    SHAPES,
    Basis,
    ResponseTable,
    along_axes,
    curve_speeds,
    response_inputs,
)
from surrogate.wrench.heads import Heads
from surrogate.wrench.tails import Tails

COMPONENTS = {"lag": 32, "memory": 32, "rest": 32, "spread": 20}
SETTINGS = Settings(width=48, depth=2, members=2, epochs=200, iterations=150)
_SMOOTH = 2.0  # standard deviations over which the components change


def fit_response(
    heads: Heads,
    tails: Tails,
    motion: Tensor,
    curves: Mapping[str, Floats],
    settings: Settings,
    work: TrainingContext,
) -> ResponseTable:
    """Fit a table to curves of robots, by name as in SHAPES, each (M, …, 3); NaN where one was not simulated."""
    inputs, speeds = response_inputs(tails, motion), curve_speeds(heads, motion)
    networks: list[Ensemble] = []
    bases: dict[str, Basis] = {}
    for names in PARTS:
        known = torch.stack([torch.as_tensor(np.isfinite(curves[n])).flatten(1).all(1) for n in names]).all(0)
        targets = []
        for name in names:
            scaled = torch.as_tensor(curves[name])[known] / along_axes(speeds[known], SHAPES[name])
            bases[name] = _basis(scaled.reshape(len(scaled), -1), COMPONENTS[name])
            targets.append((scaled.reshape(len(scaled), -1) - bases[name].mean) @ bases[name].vectors.T)
        sizes = [(len(bases[name].vectors), (3 / np.prod(SHAPES[name])) ** 0.5) for name in names]
        weights = torch.cat([torch.full((count,), weight, dtype=torch.float64) for count, weight in sizes])
        part = work.part(" and ".join(names))
        networks.append(_learned(inputs[known], torch.cat(targets, -1), weights, settings, part))
    return ResponseTable(tuple(networks), bases)


def _basis(flat: Tensor, count: int) -> Basis:
    """Return the mean and the first components of curves (M, D)."""
    mean = flat.median(0).values
    vectors = torch.linalg.svd(_without_outliers(flat - mean), full_matrices=False)[2]
    return Basis(mean, vectors[:count].clone())


def _learned(
    inputs: Tensor, wanted: Tensor, weights: Tensor, settings: Settings, work: TrainingContext
) -> Ensemble:
    """Fit a network that gives components (M, C)."""
    network = Ensemble(
        inputs.shape[1], wanted.shape[1], width=settings.width, depth=settings.depth, members=settings.members,
        seed=settings.seed,
    )  # fmt: skip
    network.shift.copy_(inputs.mean(0))
    network.scale.copy_(torch.clamp(inputs.std(0), min=1e-6) * _SMOOTH)
    network.spread.copy_(_spread(wanted))

    data = (wanted, weights.expand(len(wanted), -1))

    def residual(y: Tensor, wanted: Tensor, weights: Tensor) -> Tensor:
        return (y - wanted) * weights

    fit(network, inputs, data, residual, settings, work, unit="% of the way in one unit of time")
    return network


def _without_outliers(flat: Tensor) -> Tensor:
    """Return rows (M, D) with their size limited, so that a few of them do not choose the components."""
    size = flat.norm(dim=1, keepdim=True)
    return flat * torch.clamp(5 * size.median() / torch.clamp(size, min=1e-12), max=1.0)


def _spread(wanted: Tensor) -> Tensor:
    """Return half the range between the 16th and the 84th percentile, (C,)."""
    low, high = wanted.quantile(torch.tensor([0.16, 0.84], dtype=wanted.dtype), dim=0)
    return torch.clamp((high - low) / 2, min=1e-8)
