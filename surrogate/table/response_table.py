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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.model.response import BEFORE, DWELLS, at_equal_dwells
from surrogate.networks.ensemble import Ensemble
from surrogate.wrench.heads import Heads
from surrogate.wrench.tails import Tails

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

    def curves(self, heads: Heads, tails: Tails, motion: Floats, inputs: Floats) -> dict[str, Floats]:
        """Return lag, memory, rest and spread, each (M, …, 3) as in SHAPES, in l, l, rad, for a positive motor."""
        speeds, curves = curve_speeds(heads, motion), {}
        for name, components in self._components(tails, inputs).items():
            curve = self.bases[name].mean + components @ self.bases[name].vectors
            if name == "spread":  # its logarithm was learned, of robots with two tails
                curve = np.exp(np.where((tails.number == 2)[:, None], np.minimum(curve, 0.0), -np.inf))
            curves[name] = curve.reshape(-1, *SHAPES[name]) * along_axes(speeds, SHAPES[name])
        curves["spread"] = np.abs(curves["spread"])
        return curves

    def lags(self, heads: Heads, tails: Tails, motion: Floats, inputs: Floats, dwells: Floats) -> Floats:
        """Return lags at equal dwells (M,), for a positive motor, (M, 3); NaN where none was learned."""
        return lags_at_equal_dwells(self.networks[:2], self.equal_dwells, heads, tails, motion, inputs, dwells)

    @cached_property
    def equal_dwells(self) -> Basis:
        """Lag and memory where the dwell before is as long: components of the lag, then of the memory."""
        lag, memory = self.bases["lag"], self.bases["memory"]
        mean = lag.mean + memory_at_equal_dwells(memory.mean[None])[0]
        return Basis(mean, np.concatenate([lag.vectors, memory_at_equal_dwells(memory.vectors)]))

    def _components(self, tails: Tails, inputs: Floats) -> dict[str, Floats]:
        """Return the components of each kind of curve, (M, C)."""
        inputs, components = response_inputs(tails, inputs), {}
        for names, network in zip(PARTS, self.networks, strict=True):
            answer, first = network(inputs), 0
            for name in names:
                end = first + len(self.bases[name].vectors)
                components[name], first = answer[:, first:end], end
        return components


def memory_at_equal_dwells(flat: Floats) -> Floats:
    """Return memories (C, K D 3) where the dwell before is as long as the dwell, (C, D 3)."""
    return at_equal_dwells(flat.reshape(-1, *SHAPES["memory"])).reshape(len(flat), -1)


def response_inputs(tails: Tails, inputs: Floats) -> Floats:
    """Return inputs of the network, (M, 15), from `surrogate.wrench.tails.INPUTS` (M, 7)."""
    two = (tails.number == 2).astype(float)
    return np.column_stack([inputs, tails.head[:, _OF_HEAD], np.log(tails.number), two])


def curve_speeds(heads: Heads, motion: Floats) -> Floats:
    """Return (w, v_x, ω_yr) of the head's centre, (M, 3): what the curves are divided by."""
    v_x, v_z, yaw = motion[:, 0], motion[:, 1], motion[:, 2]
    sway = v_x + yaw * heads.length / 2
    return np.column_stack([np.hypot(v_z, _SMALL_SURGE * sway), sway, yaw])


def along_axes(speeds: Floats, shape: tuple[int, ...]) -> Floats:
    """Return speeds (M, 3) with axes of length 1 between, to multiply curves (M, *shape)."""
    return speeds.reshape(len(speeds), *[1] * (len(shape) - 1), 3)


def lags_at_equal_dwells(
    networks: Sequence[Ensemble],
    basis: Basis,
    heads: Heads,
    tails: Tails,
    motion: Floats,
    inputs: Floats,
    dwells: Floats,
) -> Floats:
    """Return lags at equal dwells, one a robot (M,), for a positive motor, (M, 3).

    Args:
        networks: of lag and memory, the memory without or with what else its network gives.
        basis: of the lag, then of the memory where the dwell before is as long.
        heads, tails, motion, inputs: M robots, their motions (M, 5), and `surrogate.wrench.tails.INPUTS` (M, 7).
        dwells: (M,).
    """
    inputs = response_inputs(tails, inputs)
    components = np.concatenate([network(inputs) for network in networks], 1)[:, : len(basis.vectors)]
    curves = (basis.mean + components @ basis.vectors).reshape(-1, *SHAPES["lag"])
    return between_dwells(curves, dwells) * curve_speeds(heads, motion)


_KNOTS = np.log(DWELLS)
_NEAR = np.arange(4)
_APART = [
    np.prod([_KNOTS[i + k] - _KNOTS[i + j] for j in range(4) if j != k])
    for i in range(len(DWELLS) - 3)
    for k in range(4)
]


def between_dwells(curves: Floats, dwells: Floats) -> Floats:
    """Interpolate curves (M, D, 3), one dwell a row (M,): cubic in ln T̄ through four knots, then constant."""
    place = np.log(np.minimum(dwells, DWELLS[-1]))
    first = np.clip(np.searchsorted(_KNOTS, place) - 2, 0, len(_KNOTS) - 4)
    near = first[:, None] + _NEAR
    a, b, c, d = (place[:, None] - _KNOTS[near]).T
    weights = np.array([b * c * d, a * c * d, a * b * d, a * b * c]).T / np.reshape(_APART, (-1, 4))[first]
    return np.einsum("mk,mka->ma", weights, curves[np.arange(len(near))[:, None], near])
