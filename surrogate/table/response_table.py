"""The table of the response to a flip: curves over the dwell (`sim.model.response`), learned from simulated flips.

The curves are lengths and angles. Over the speeds of the steady motion they are times, which vary little from
robot to robot:

    Δz/w, Δx/v_x, Δψ/ω_yr,   w² = v_z² + (v_x/10)²

(w and not v_z, because v_z may vanish). Lag, memory, rest and the logarithm of the spread are each written in the
principal components of the rows that were learned. Three networks give the components: one for the lag, one for
memory and rest, which data sets hold for a part of their robots, and one for the spread. Robots with two tails
have a spread; with more, the lag does not depend on the phase of the disc. A robot's inputs are those of its tails
in steady motion (`surrogate.wrench.tails`), how the drag of its head compares with that of its tails, and N.

The components are curves of the simulator. So the curves of the table are smooth, and constant for long dwells.
Left out: robots with one tail, and robots whose left and right turns differ. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.model.response import BEFORE, DWELLS, at_equal_dwells
from surrogate.networks.ensemble import Ensemble
from surrogate.wrench.heads import Heads
from surrogate.wrench.tails import Tails, tail_inputs

SHAPES = {
    "lag": (len(DWELLS), 3),
    "memory": (len(BEFORE), len(DWELLS), 3),
    "rest": (len(DWELLS), 3),
    "spread": (len(DWELLS), 3),
}
PARTS = (("lag",), ("memory", "rest"), ("spread",))  # what each network gives
_SMALL_SURGE = 0.1  # of v_x
_OF_HEAD = [0, 1, 2, 3, 5, 6]  # of the inputs of the head: all but the coupling of sway and turn


class Basis(NamedTuple):
    """Principal components of one kind of curve, flattened: curve = mean + c · vectors."""

    mean: Floats  # (D,)
    vectors: Floats  # (C, D)


@dataclass(frozen=True)
class ResponseTable:
    """Response curves of robots from their steady motion."""

    networks: tuple[Ensemble, ...]  # one for each of PARTS
    bases: Mapping[str, Basis]

    def curves(self, heads: Heads, tails: Tails, motion: Floats) -> dict[str, Floats]:
        """Return lag, memory, rest and spread, each (M, …, 3) as in SHAPES, in l, l, rad, for a positive motor."""
        speeds, curves = curve_speeds(heads, motion), {}
        for name, components in self._components(tails, motion).items():
            curve = self.bases[name].mean + components @ self.bases[name].vectors
            if name == "spread":  # its logarithm was learned, of robots with two tails
                curve = np.exp(np.where((tails.number == 2)[:, None], np.minimum(curve, 0.0), -np.inf))
            curves[name] = curve.reshape(-1, *SHAPES[name]) * along_axes(speeds, SHAPES[name])
        curves["spread"] = np.abs(curves["spread"])
        return curves

    @cached_property
    def equal_dwells(self) -> Basis:
        """Lag and memory where the dwell before is as long: components of the lag, then of the memory."""
        lag, memory = self.bases["lag"], self.bases["memory"]
        mean = lag.mean + memory_at_equal_dwells(memory.mean[None])[0]
        return Basis(mean, np.concatenate([lag.vectors, memory_at_equal_dwells(memory.vectors)]))

    def _components(self, tails: Tails, motion: Floats) -> dict[str, Floats]:
        """Return the components of each kind of curve, (M, C)."""
        inputs, components = response_inputs(tails, motion), {}
        for names, network in zip(PARTS, self.networks, strict=True):
            answer, first = network.packed.evaluate(inputs), 0
            for name in names:
                end = first + len(self.bases[name].vectors)
                components[name], first = answer[:, first:end], end
        return components


def memory_at_equal_dwells(flat: Floats) -> Floats:
    """Return memories (C, K D 3) where the dwell before is as long as the dwell, (C, D 3)."""
    return at_equal_dwells(flat.reshape(-1, *SHAPES["memory"])).reshape(len(flat), -1)


def response_inputs(tails: Tails, motion: Floats) -> Floats:
    """Return inputs of the network, (M, 15)."""
    two = (tails.number == 2).astype(float)
    return np.column_stack([tail_inputs(tails, motion), tails.head[:, _OF_HEAD], np.log(tails.number), two])


def curve_speeds(heads: Heads, motion: Floats) -> Floats:
    """Return (w, v_x, ω_yr) of the head's centre, (M, 3): what the curves are divided by."""
    v_x, v_z, yaw = motion[:, 0], motion[:, 1], motion[:, 2]
    sway = v_x + yaw * heads.length / 2
    return np.column_stack([np.hypot(v_z, _SMALL_SURGE * sway), sway, yaw])


def along_axes(speeds: Floats, shape: tuple[int, ...]) -> Floats:
    """Return speeds (M, 3) with axes of length 1 between, to multiply curves (M, *shape)."""
    return speeds.reshape(len(speeds), *[1] * (len(shape) - 1), 3)


def between_dwells(curves: Floats, dwells: Floats) -> Floats:
    """Interpolate curves (M, D, 3), one dwell a row (M,): cubic in ln T̄ through four knots, then constant."""
    knots = np.log(DWELLS)
    place = np.log(np.minimum(dwells, DWELLS[-1]))
    first = np.clip(np.searchsorted(knots, place) - 2, 0, len(knots) - 4)
    rows, total = np.arange(len(dwells)), np.zeros((len(dwells), 3))
    for i in range(4):
        weight = np.ones(len(dwells))
        for j in range(4):
            if j != i:
                weight *= (place - knots[first + j]) / (knots[first + i] - knots[first + j])
        total += weight[:, None] * curves[rows, first + i]
    return total
