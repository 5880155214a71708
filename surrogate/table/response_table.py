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

from sim.arrays import Floats
from sim.model.response import BEFORE, DWELLS
from surrogate.networks.compiled import evaluate_rows
from surrogate.networks.ensemble import Ensemble
from surrogate.wrench.heads import Heads
from surrogate.wrench.tails import Tails, tail_inputs

SHAPES = {
    "lag": (len(DWELLS), 3),
    "memory": (len(BEFORE), len(DWELLS), 3),
    "rest": (len(DWELLS), 3),
    "spread": (len(DWELLS), 3),
}
PARTS = (("lag", "spread"), ("memory", "rest"))  # what each network gives
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
        inputs, speeds = response_inputs(tails, motion), curve_speeds(heads, motion)
        curves = {}
        for names, network in zip(PARTS, self.networks, strict=True):
            ends = np.cumsum([len(self.bases[name].vectors) for name in names])[:-1]
            answer = evaluate_rows(network.packed, inputs)
            for name, components in zip(names, np.split(answer, ends, axis=1), strict=True):
                curve = self.bases[name].mean + components @ self.bases[name].vectors
                curves[name] = curve.reshape(-1, *SHAPES[name]) * along_axes(speeds, SHAPES[name])
        curves["spread"] = np.maximum(curves["spread"], 0.0)
        return curves


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
