"""The table of the response to a flip: curves over the dwell (`sim.model.response`), learned from simulated flips.

The curves are lengths and angles. Over the speeds of the steady motion they are times, which vary little from
robot to robot:

    Δz/w, Δx/v_x, Δψ/ω_yr,   w² = v_z² + (v_x/10)²

(w and not v_z, because v_z may vanish). Lag, memory, rest and spread are each written in the principal
components of the rows that were learned. Two networks give the components: one for lag and spread, one for memory
and rest, which data sets hold for a part of their robots. A robot's inputs are those of its tails in steady motion
(`surrogate.wrench.tails`), how the drag of its head compares with that of its tails, and N.

The components are curves of the simulator. So the curves of the table are smooth, and constant for long dwells.
Left out: robots with one tail, and robots whose left and right turns differ. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sim.arrays import Floats
from sim.model.response import BEFORE, DWELLS
from surrogate.networks.checkpoints import Work
from surrogate.networks.ensemble import Ensemble
from surrogate.networks.training_loop import Settings, fit
from surrogate.wrench import tails as tail
from surrogate.wrench.heads import Heads
from surrogate.wrench.tails import Tails

SHAPES = {
    "lag": (len(DWELLS), 3),
    "memory": (len(BEFORE), len(DWELLS), 3),
    "rest": (len(DWELLS), 3),
    "spread": (len(DWELLS), 3),
}
PARTS = (("lag", "spread"), ("memory", "rest"))  # what each network gives
COMPONENTS = {"lag": 32, "memory": 32, "rest": 32, "spread": 20}
SETTINGS = Settings(width=48, depth=2, members=2, epochs=200, iterations=150)
_SMALL_SURGE = 0.1  # of v_x
_OF_HEAD = [0, 1, 2, 3, 5, 6]  # of the inputs of the head: all but the coupling of sway and turn
_SMOOTH = 2.0  # standard deviations over which the components change


class Basis(NamedTuple):
    """Principal components of one kind of curve, flattened: curve = mean + c · vectors."""

    mean: Tensor  # (D,)
    vectors: Tensor  # (C, D)


@dataclass(frozen=True)
class CurveTable:
    """Response curves of robots from their steady motion."""

    networks: tuple[Ensemble, ...]  # one for each of PARTS
    bases: Mapping[str, Basis]

    def curves(self, heads: Heads, tails: Tails, motion: Tensor) -> dict[str, Floats]:
        """Lag, memory, rest and spread, each (M, …, 3) as in SHAPES, in l, l, rad, for a positive motor."""
        inputs, speeds = inputs_of(tails, motion), speeds_of(heads, motion)
        found = {}
        for names, network in zip(PARTS, self.networks, strict=True):
            sizes = [len(self.bases[name].vectors) for name in names]
            for name, components in zip(names, network(inputs).split(sizes, -1), strict=True):
                curve = self.bases[name].mean + components @ self.bases[name].vectors
                scaled = curve.reshape(-1, *SHAPES[name]) * _along(speeds, SHAPES[name])
                found[name] = np.asarray(scaled.numpy())
        found["spread"] = np.maximum(found["spread"], 0.0)
        return found


def inputs_of(tails: Tails, motion: Tensor) -> Tensor:
    """Inputs of the network, (M, 15)."""
    extra = [torch.log(tails.number), (tails.number == 2).double()]
    return torch.cat([tail.inputs_of(tails, motion), tails.head[:, _OF_HEAD], torch.stack(extra, -1)], -1)


def speeds_of(heads: Heads, motion: Tensor) -> Tensor:
    """(w, v_x, ω_yr) of the head's centre, (M, 3): what the curves are divided by."""
    v_x, v_z, yaw = motion[:, 0], motion[:, 1], motion[:, 2]
    sway = v_x + yaw * heads.length / 2
    return torch.stack([torch.hypot(v_z, _SMALL_SURGE * sway), sway, yaw], -1)


def learn_curves(
    heads: Heads, tails: Tails, motion: Tensor, curves: Mapping[str, Floats], settings: Settings, work: Work
) -> CurveTable:
    """A table from the curves of robots, by name as in SHAPES, each (M, …, 3); NaN where one was not simulated."""
    inputs, speeds = inputs_of(tails, motion), speeds_of(heads, motion)
    networks: list[Ensemble] = []
    bases: dict[str, Basis] = {}
    for names in PARTS:
        known = torch.stack([torch.as_tensor(np.isfinite(curves[n])).flatten(1).all(1) for n in names]).all(0)
        targets = []
        for name in names:
            scaled = torch.as_tensor(curves[name])[known] / _along(speeds[known], SHAPES[name])
            bases[name] = _basis(scaled.reshape(len(scaled), -1), COMPONENTS[name])
            targets.append((scaled.reshape(len(scaled), -1) - bases[name].mean) @ bases[name].vectors.T)
        sizes = [(len(bases[name].vectors), (3 / np.prod(SHAPES[name])) ** 0.5) for name in names]
        weights = torch.cat([torch.full((count,), weight, dtype=torch.float64) for count, weight in sizes])
        part = work.part(" and ".join(names))
        networks.append(_learned(inputs[known], torch.cat(targets, -1), weights, settings, part))
    return CurveTable(tuple(networks), bases)


def _basis(flat: Tensor, count: int) -> Basis:
    """Mean and the first components of curves (M, D)."""
    mean = flat.median(0).values
    vectors = torch.linalg.svd(_without_outliers(flat - mean), full_matrices=False)[2]
    return Basis(mean, vectors[:count].clone())


def _learned(inputs: Tensor, wanted: Tensor, weights: Tensor, settings: Settings, work: Work) -> Ensemble:
    """A network that gives components (M, C)."""
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


def _along(speeds: Tensor, shape: tuple[int, ...]) -> Tensor:
    """Speeds (M, 3) with axes of length 1 between, to multiply curves (M, *shape)."""
    return speeds.reshape(len(speeds), *[1] * (len(shape) - 1), 3)


def _without_outliers(flat: Tensor) -> Tensor:
    """Rows (M, D) with their size limited, so that a few of them do not choose the components."""
    size = flat.norm(dim=1, keepdim=True)
    return flat * torch.clamp(5 * size.median() / torch.clamp(size, min=1e-12), max=1.0)


def _spread(wanted: Tensor) -> Tensor:
    """Half the range between the 16th and the 84th percentile, (C,)."""
    low, high = wanted.quantile(torch.tensor([0.16, 0.84], dtype=wanted.dtype), dim=0)
    return torch.clamp((high - low) / 2, min=1e-8)
