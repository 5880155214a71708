"""Fit the curves of the response to a flip, from simulated flips, see `surrogate.table.response_table`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from sim.arrays import Floats
from surrogate.networks.checkpoints import TrainingContext
from surrogate.networks.ensemble import Ensemble
from surrogate.networks.trainable import TrainableEnsemble
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
    motion: Floats,
    curves: Mapping[str, Floats],
    settings: Settings,
    work: TrainingContext,
) -> ResponseTable:
    """Fit a table to curves of robots, by name as in SHAPES, each (M, …, 3); NaN where one was not simulated."""
    inputs, speeds = response_inputs(tails, motion), curve_speeds(heads, motion)
    networks: list[Ensemble] = []
    bases: dict[str, Basis] = {}
    for names in PARTS:
        known = np.all([np.isfinite(curves[n]).reshape(len(inputs), -1).all(1) for n in names], axis=0)
        targets = []
        for name in names:
            scaled = curves[name][known] / along_axes(speeds[known], SHAPES[name])
            bases[name] = _basis(scaled.reshape(len(scaled), -1), COMPONENTS[name])
            targets.append((scaled.reshape(len(scaled), -1) - bases[name].mean) @ bases[name].vectors.T)
        sizes = [(len(bases[name].vectors), (3 / np.prod(SHAPES[name])) ** 0.5) for name in names]
        weights = np.concatenate([np.full(count, weight) for count, weight in sizes])
        part = work.part(" and ".join(names))
        networks.append(_learned(inputs[known], np.concatenate(targets, -1), weights, settings, part))
    return ResponseTable(tuple(networks), bases)


def _basis(flat: Floats, count: int) -> Basis:
    """Return the mean and the first components of curves (M, D)."""
    mean = np.quantile(flat, 0.5, axis=0, method="lower")
    vectors = np.linalg.svd(_without_outliers(flat - mean), full_matrices=False)[2]
    return Basis(mean, vectors[:count].copy())


def _learned(
    inputs: Floats, wanted: Floats, weights: Floats, settings: Settings, work: TrainingContext
) -> Ensemble:
    """Fit a network that gives components (M, C)."""
    network = TrainableEnsemble(
        inputs.shape[1], wanted.shape[1], width=settings.width, depth=settings.depth, members=settings.members,
        seed=settings.seed,
    )  # fmt: skip
    network.shift.copy_(torch.from_numpy(inputs.mean(0)))
    network.scale.copy_(torch.from_numpy(np.maximum(inputs.std(0, ddof=1), 1e-6) * _SMOOTH))
    network.spread.copy_(torch.from_numpy(_spread(wanted)))

    data = (torch.from_numpy(wanted), torch.from_numpy(weights).expand(len(wanted), -1))

    def residual(y: Tensor, wanted: Tensor, weights: Tensor) -> Tensor:
        return (y - wanted) * weights

    x = torch.from_numpy(inputs)
    fit(network, x, data, residual, settings, work, unit="% of the way in one unit of time")
    return network.trained()


def _without_outliers(flat: Floats) -> Floats:
    """Return rows (M, D) with their size limited, so that a few of them do not choose the components."""
    size = np.linalg.norm(flat, axis=1, keepdims=True)
    typical = np.quantile(size, 0.5, method="lower")
    return flat * np.minimum(5 * typical / np.maximum(size, 1e-12), 1.0)


def _spread(wanted: Floats) -> Floats:
    """Return half the range between the 16th and the 84th percentile, (C,)."""
    low, high = np.quantile(wanted, [0.16, 0.84], axis=0)
    return np.maximum((high - low) / 2, 1e-8)
