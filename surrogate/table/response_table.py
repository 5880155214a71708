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
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.model.response import BEFORE, DWELLS, at_equal_dwells
from surrogate.networks.ensemble import Ensemble
from surrogate.wrench.heads import NUMBER

if TYPE_CHECKING:
    from surrogate.table.lookup import Motions

SHAPES = {
    "lag": (len(DWELLS), 3),
    "memory": (len(BEFORE), len(DWELLS), 3),
    "rest": (len(DWELLS), 3),
    "spread": (len(DWELLS), 3),
}
PARTS = (("lag",), ("memory", "rest"), ("spread",))  # what each network gives
SMALL_SURGE = 0.1  # of v_x
OF_HEAD = (0, 1, 2, 3, 5, 6)  # of the inputs of the head: all but the coupling of sway and turn
_KNOTS = np.log(DWELLS)


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
                if name == "spread":  # its logarithm was learned, of robots with two tails
                    curve = np.exp(np.where(robots[:, NUMBER, None] == 2, np.minimum(curve, 0.0), -np.inf))
                curves[name], first = curve.reshape(-1, *SHAPES[name]) * along_axes(speeds, SHAPES[name]), end
        curves["spread"] = np.abs(curves["spread"])
        return curves

    def put_flips(self, motions: Motions, dwells: Floats) -> None:
        """Write the response at equal dwells (M,) into the outputs of motions; NaN where none was learned."""
        put_flips(self.networks[:2], self.equal_dwells, motions, dwells)

    @cached_property
    def equal_dwells(self) -> Basis:
        """Lag and memory where the dwell before is as long: components of the lag, then of the memory."""
        lag, memory = self.bases["lag"], self.bases["memory"]
        mean = lag.mean + memory_at_equal_dwells(memory.mean[None])[0]
        return Basis(mean, np.concatenate([lag.vectors, memory_at_equal_dwells(memory.vectors)]))


def memory_at_equal_dwells(flat: Floats) -> Floats:
    """Return memories (C, K D 3) where the dwell before is as long as the dwell, (C, D 3)."""
    return at_equal_dwells(flat.reshape(-1, *SHAPES["memory"])).reshape(len(flat), -1)


def flip_inputs(robots: Floats, motion: Floats, inputs: Floats) -> tuple[Floats, Floats]:
    """Return inputs of the networks (M, 15), and (w, v_x, ω_yr), what the curves are divided by, (M, 3).

    Args:
        robots: (M, 39), see `surrogate.wrench.heads.pack_robots`.
        motion: (M, 5).
        inputs: `surrogate.wrench.tails.INPUTS`, (M, 7).
    """
    from surrogate.table.loops import flip_inputs_of

    found: tuple[Floats, Floats] = flip_inputs_of(robots, motion, inputs)
    return found


def put_flips(networks: Sequence[Ensemble], basis: Basis, motions: Motions, dwells: Floats) -> None:
    """Write the response at equal dwells, one a robot (M,), into the outputs of their motions.

    Args:
        networks: of lag and memory, the memory without or with what else its network gives.
        basis: of the lag, then of the memory where the dwell before is as long.
        motions: of M robots.
        dwells: (M,).
    """
    from surrogate.table.loops import put_flips as put

    (lag, memory), own = networks, (motions.robots, motions.motion, motions.inputs)
    numbers = (*lag.layers, *memory.layers, *basis, lag.shape["outputs"], _KNOTS)
    put(*numbers, *own, np.ascontiguousarray(dwells, dtype=float), motions.outside, motions.outputs)


def along_axes(speeds: Floats, shape: tuple[int, ...]) -> Floats:
    """Return speeds (M, 3) with axes of length 1 between, to multiply curves (M, *shape)."""
    return speeds.reshape(len(speeds), *[1] * (len(shape) - 1), 3)
