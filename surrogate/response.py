"""The table of the response to a flip: curves over the dwell (`sim.model.response`), learned from simulated flips.

The curves are lengths and angles. Over the speeds of the steady motion they are times, which vary little from
robot to robot:

    Δz/w, Δx/v_x, Δψ/ω_yr,   w² = v_z² + (v_x/10)²

(w and not v_z, because v_z may vanish). Lag, memory, rest, and size and form of the spread (`encoded_spread`) are
each written in the principal components of the rows that were learned. Three networks give the components: one
for the lag, one for memory and rest, which data sets hold for a part of their robots, and one for the spread.
Robots with two tails have a spread; with more, the lag does not depend on the phase of the disc. A robot's inputs
are those of its tails in steady motion (`surrogate.tails`), how the drag of its head compares with that of its
tails, and N.

The components are curves of the simulator. So the curves of the table are smooth, and constant for long dwells.
Left out: robots with one tail, and robots whose left and right turns differ. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from common.arrays import Floats, Integers
from sim.jit import compiled_fast
from sim.linear.lane_arrays import copy
from sim.mechanics.planar import zigzag_speed
from sim.model.response import BEFORE, DWELLS, at_equal_dwells
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.domain import INSIDE, NO_RESPONSE
from surrogate.motions import Motions
from surrogate.network import BLOCK, Ensemble, Layers, evaluate
from surrogate.tails import INPUTS, PLACES

SHAPES = {
    "lag": (len(DWELLS), 3),
    "memory": (len(BEFORE), len(DWELLS), 3),
    "rest": (len(DWELLS), 3),
    "spread": (len(DWELLS), 3),
}
PARTS = (("lag",), ("memory", "rest"), ("spread",))  # what each network gives
# Numbers of a curve as it is learned, see `encoded_spread`.
COUNTS = {name: math.prod(shape) for name, shape in SHAPES.items()} | {"spread": 3 * (len(DWELLS) + 1)}
SMALL_SURGE = 0.1  # of v_x
TINY_SPREAD = 1e-12  # squared, of the way in one unit of time
LEAST_FORM = 1e-3  # of the square of a spread over its mean: a sum of components may be negative
OF_HEAD = (0, 1, 2, 3, 5, 6)  # of the inputs of the head: all but the coupling of sway and turn
_KNOTS = np.log(DWELLS)
_INPUTS, _FLIP = len(INPUTS), len(STEADY_OUTPUTS)  # inputs of the tails; the place of the first output of a flip
FLIP_INPUTS = _INPUTS + len(OF_HEAD) + 2


class Basis(NamedTuple):
    """Principal components of one kind of curve, flattened: curve = mean + c · vectors."""

    mean: Floats  # (D,)
    vectors: Floats  # (C, D)


@dataclass(frozen=True)
class ResponseTable:
    """Response curves of robots from their steady motion."""

    networks: tuple[Ensemble, ...]  # one for each of PARTS
    bases: Mapping[str, Basis]

    def curves(self, robots: Floats, motion: Floats, inputs: Floats) -> dict[str, Floats]:
        """Return lag, memory, rest and spread, each (M, …, 3) as in SHAPES, in l, l, rad, for a positive motor."""
        x, speeds = flip_inputs(robots, motion, inputs)
        curves = {}
        for names, network in zip(PARTS, self.networks, strict=True):
            answer, first = network(x), 0
            for name in names:
                basis = self.bases[name]
                end = first + len(basis.vectors)
                curve = basis.mean + answer[:, first:end] @ basis.vectors
                if name == "spread":  # of robots with two tails
                    curve = np.where(robots[:, PLACES.number, None] == 2, decoded_spread(curve), 0.0)
                curves[name], first = curve.reshape(-1, *SHAPES[name]) * along_axes(speeds, SHAPES[name]), end
        curves["spread"] = np.abs(curves["spread"])
        return curves

    def put_flips(self, motions: Motions, dwells: Floats) -> None:
        """Write the response at equal dwells (M,) into the outputs of motions; NaN where none was learned."""
        lag, memory = self.networks[:2]
        numbers = (lag.layers, memory.layers, *self.equal_dwells, lag.shape["outputs"], _KNOTS)
        own = (motions.robots, motions.motion, motions.inputs)
        write_flips(*numbers, *own, np.ascontiguousarray(dwells, dtype=float), motions.outside, motions.outputs)

    @cached_property
    def equal_dwells(self) -> Basis:
        """Lag and memory where the dwell before is as long: components of the lag, then of the memory."""
        lag, memory = self.bases["lag"], self.bases["memory"]
        mean = lag.mean + memory_at_equal_dwells(memory.mean[None])[0]
        return Basis(mean, np.concatenate([lag.vectors, memory_at_equal_dwells(memory.vectors)]))


def encoded_spread(spread: Floats) -> Floats:
    """Return what is learned of spreads (M, D, 3), (M, 3 + 3 D): of each axis the size, then the form.

    That is the mean square over the dwells, as a logarithm, and the square over it, which is smooth where the
    spread is small and its logarithm is not. All are scaled to errors of the spread; the first acts on D dwells.
    """
    square = np.maximum(spread**2, TINY_SPREAD)
    size = square.mean(1)
    form = (square / size[:, None] / 2).reshape(len(spread), -1)
    return np.concatenate([np.log(size) * (spread.shape[1] ** 0.5 / 2), form], 1)


def decoded_spread(learned: Floats) -> Floats:
    """Return spreads, flat (M, 3 D), from what is learned of them (M, 3 + 3 D)."""
    size = np.exp(np.minimum(learned[:, :3] * (2 / len(DWELLS) ** 0.5), 0.0))
    form = np.maximum(2 * learned[:, 3:].reshape(-1, *SHAPES["spread"]), LEAST_FORM)
    return np.asarray(np.sqrt(form * size[:, None])).reshape(len(learned), -1)


def memory_at_equal_dwells(flat: Floats) -> Floats:
    """Return memories (C, K D 3) where the dwell before is as long as the dwell, (C, D 3)."""
    return at_equal_dwells(flat.reshape(-1, *SHAPES["memory"])).reshape(len(flat), -1)


def along_axes(speeds: Floats, shape: tuple[int, ...]) -> Floats:
    """Return speeds (M, 3) with axes of length 1 between, to multiply curves (M, *shape)."""
    return speeds.reshape(len(speeds), *[1] * (len(shape) - 1), 3)


@compiled_fast
def _put_flip_inputs(robot: Floats, motion: Floats, inputs: Floats, x: Floats, speeds: Floats) -> None:
    """Write the inputs of the networks of a flip (15,), and what their curves are multiplied by (3,)."""
    head, number = robot[PLACES.head], robot[PLACES.number]
    for i in range(_INPUTS):
        x[i] = inputs[i]
    for i, index in enumerate(OF_HEAD):
        x[_INPUTS + i] = head[index]
    x[FLIP_INPUTS - 2], x[FLIP_INPUTS - 1] = np.log(number), 1.0 if number == 2 else 0.0
    sway = motion[0] + motion[2] * robot[PLACES.head_length] / 2
    speeds[0], speeds[1], speeds[2] = np.hypot(motion[1], SMALL_SURGE * sway), sway, motion[2]


@compiled_fast
def flip_inputs(robots: Floats, motion: Floats, inputs: Floats) -> tuple[Floats, Floats]:
    """Return inputs of the networks (M, 15), and (w, v_x, ω_yr), what the curves are divided by, (M, 3).

    Args:
        robots: (M, ROBOT_NUMBERS), see `surrogate.tails.pack_robots`.
        motion: (M, 5).
        inputs: `surrogate.tails.INPUTS`, (M, 7).
    """
    x, speeds = np.empty((len(robots), FLIP_INPUTS)), np.empty((len(robots), 3))
    for row in range(len(robots)):
        _put_flip_inputs(robots[row], motion[row], inputs[row], x[row], speeds[row])
    return x, speeds


@compiled_fast
def write_flips(
    lag: Layers, memory: Layers, mean: Floats, vectors: Floats, components: int, knots: Floats, robots: Floats,
    motion: Floats, inputs: Floats, dwells: Floats, outside: Integers, outputs: Floats,
) -> None:  # fmt: skip
    """Write the response to flips with equal dwells, and mark robots whose response was not learned.

    A lag between the dwells of its curve is cubic in ln T̄ through four knots, and constant after the last one.

    Args:
        lag, memory: networks of the lag and of the memory.
        mean, vectors: of lag and memory at equal dwells, (D 3,) and (C, D 3).
        components: number of vectors of the lag, which come first.
        knots: ln T̄ of the curves, (D,).
        robots, motion, inputs: of M robots, see `surrogate.motions.Motions`.
        dwells: (M,).
        outside, outputs: written to.
    """
    x, of_lag = np.empty((BLOCK, FLIP_INPUTS)), np.empty((BLOCK, lag.rest.shape[1]))
    speeds, of_memory, near = np.empty((BLOCK, 3)), np.empty((BLOCK, memory.rest.shape[1])), np.empty(12)
    own = np.empty(3)
    for begin in range(0, len(robots), BLOCK):
        count = min(BLOCK, len(robots) - begin)
        for k in range(count):
            _put_flip_inputs(robots[begin + k], motion[begin + k], inputs[begin + k], x[k], speeds[k])
        evaluate(lag, x[:count], of_lag[:count])
        evaluate(memory, x[:count], of_memory[:count])
        for k in range(count):
            row = begin + k
            place = min(np.log(dwells[row]), knots[-1])
            first = min(max(np.searchsorted(knots, place) - 2, 0), len(knots) - 4)
            # Only the four knots about the dwell are needed of a curve: 12 numbers of 75.
            copy(near, mean[3 * first : 3 * first + 12])
            for c in range(len(vectors)):
                size = of_lag[k, c] if c < components else of_memory[k, c - components]
                for i in range(12):
                    near[i] += size * vectors[c, 3 * first + i]
            own[:] = 0.0
            for i in range(4):
                weight = 1.0
                for j in range(4):
                    if j != i:
                        weight *= (place - knots[first + j]) / (knots[first + i] - knots[first + j])
                for axis in range(3):
                    own[axis] += weight * near[3 * i + axis] * speeds[k, axis]
            outputs[_FLIP, row] = zigzag_speed(
                own[0], own[1], own[2], motion[row, 1], speeds[k, 1], speeds[k, 2], dwells[row]
            )
            outputs[_FLIP + 1, row], outputs[_FLIP + 2, row], outputs[_FLIP + 3, row] = own[2], own[1], own[0]
            if outside[row] == INSIDE and not abs(own.sum()) < np.inf:
                outside[row] = NO_RESPONSE
