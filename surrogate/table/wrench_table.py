"""Networks for the mean wrench of the tails and for the gap between them, and the motion that they give.

The networks are fitted by `surrogate.training.fit_wrench`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sim.arrays import Floats, Integers
from surrogate.networks.ensemble import Ensemble
from surrogate.wrench.heads import Heads, straight_resistance
from surrogate.wrench.tails import INPUTS, SINGLE_INPUTS, Tails, linear_torque

CLASSES = (1, 2, 3)  # networks for N = 1, N = 2, and three or more tails
INPUT_COUNTS = (len(SINGLE_INPUTS), len(INPUTS), len(INPUTS))  # of these networks
SPREAD, TINY_SPREAD = 8, 1e-9  # the spread of the members among what widths depend on, as a logarithm
_LEAST_SURGE = 0.05  # of the speed: errors of v_z are relative to this at least


def network_index(count: Floats) -> Integers:
    """Return the index in CLASSES of robots with N tails, (M,)."""
    return np.minimum(count, CLASSES[-1]).astype(np.int64) - 1


def rows_by_network(kind: Integers) -> Iterator[tuple[int, Integers | slice]]:
    """Yield each index that is there, with its rows: all of them as a slice where there is one index only."""
    present = sorted(set(kind.tolist()))
    for k in present:
        yield k, slice(None) if len(present) == 1 else np.flatnonzero(kind == k)


@dataclass(frozen=True)
class WrenchTable:
    """Mean wrench and gap of tails, one network for each of CLASSES."""

    wrench: tuple[Ensemble | None, ...]  # None where no robots were learned
    gap: Ensemble


def motion_sensitivity(heads: Heads, tails: Tails, motion: Floats) -> Floats:
    """Return ∂(relative motion)/∂(wrench) with the drag of straight tails, (M, 4, 4)."""
    from surrogate.wrench.balance import inverses_of

    matrix = heads.resistance[:, :, :4].copy()
    matrix[:, :, 3] += heads.gain[:, None] * heads.resistance[:, :, 4]
    matrix[:, :3, :3] += straight_resistance(tails)
    drag_number = tails.zeta_perp * motion[:, 4]
    torque = tails.number * tails.zeta_perp * tails.offset**2 * linear_torque(drag_number)
    matrix[:, 3, 3] += heads.gain * torque
    v_x, v_z, yaw, head_spin, spin = motion.T
    speed = np.hypot(v_x, v_z)
    size = np.stack(
        [
            np.hypot(v_x, yaw / 2),
            np.maximum(np.abs(v_z), _LEAST_SURGE * speed),
            np.abs(yaw),
            np.minimum(np.abs(head_spin), spin) / 3,
        ],
        -1,
    )
    return inverses_of(matrix) / size[:, :, None]
