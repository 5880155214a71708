"""Fit the curves of the response to a flip, from simulated flips, see `surrogate.table.response_table`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from sim.arrays import Floats
from surrogate.networks.checkpoints import TrainingContext
from surrogate.networks.ensemble import Ensemble
from surrogate.networks.training_loop import Settings, TrainableEnsemble, fit
from surrogate.table.response_table import (
    PARTS,
    SHAPES,
    Basis,
    ResponseTable,
    along_axes,
    flip_inputs,
)
from surrogate.wrench.heads import Heads, pack_robots
from surrogate.wrench.tails import Tails, tail_inputs

COMPONENTS = {"lag": 32, "memory": 32, "rest": 32, "spread": 8}
SETTINGS = Settings(width=48, depth=2, members=2, epochs=200, iterations=150)
_LEAST_SPREAD = 1e-6  # of the way in one unit of time
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
    parts = [fit_part(names, heads, tails, motion, curves, settings, work) for names in PARTS]
    bases = {name: basis for _, of_part in parts for name, basis in of_part.items()}
    return ResponseTable(tuple(network for network, _ in parts), bases)


def fit_part(
    names: Sequence[str],
    heads: Heads,
    tails: Tails,
    motion: Floats,
    curves: Mapping[str, Floats],
    settings: Settings,
    work: TrainingContext,
) -> tuple[Ensemble, dict[str, Basis]]:
    """Fit the network of some curves, one of PARTS, and their bases; see `fit_response`."""
    inputs, speeds = flip_inputs(pack_robots(heads, tails), motion, tail_inputs(tails, motion))
    known = np.all([np.isfinite(curves[n]).reshape(len(inputs), -1).all(1) for n in names], axis=0)
    if "spread" in names and (known & (tails.number == 2)).any():
        known &= tails.number == 2
    bases, targets = {}, []
    for name in names:
        scaled = (curves[name][known] / along_axes(speeds[known], SHAPES[name])).reshape(known.sum(), -1)
        if name == "spread":
            scaled = np.log(np.maximum(np.abs(scaled), _LEAST_SPREAD))
        bases[name] = _basis(scaled, COMPONENTS[name])
        targets.append((scaled - bases[name].mean) @ bases[name].vectors.T)
    sizes = [(len(bases[name].vectors), (3 / np.prod(SHAPES[name])) ** 0.5) for name in names]
    weights = np.concatenate([np.full(count, weight) for count, weight in sizes])
    unit = "of the logarithm" if "spread" in names else "% of the way in one unit of time"
    part = work.part(" and ".join(names))
    return _learned(inputs[known], np.concatenate(targets, -1), weights, settings, part, unit), bases


def _basis(flat: Floats, count: int) -> Basis:
    """Return the mean and the first components of curves (M, D)."""
    mean = np.quantile(flat, 0.5, axis=0, method="lower")
    vectors = np.linalg.svd(_without_outliers(flat - mean), full_matrices=False)[2]
    return Basis(mean, vectors[:count].copy())


def _learned(
    inputs: Floats, wanted: Floats, weights: Floats, settings: Settings, work: TrainingContext, unit: str
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
    fit(network, x, data, residual, settings, work, unit=unit)
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
