"""Networks for the mean wrench of the tails and for the gap between them, and the motion that they give.

The networks are fitted by `surrogate.training.fit_wrench`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sim.arrays import Flags, Floats, Integers
from sim.linear.complex_step import angle, length, magnitude
from surrogate.loops import compile_once
from surrogate.networks.ensemble import Ensemble
from surrogate.wrench.balance import inverses_of
from surrogate.wrench.heads import Heads, pack_robots, straight_resistance
from surrogate.wrench.motions import solve_robots
from surrogate.wrench.tails import INPUTS, SINGLE_INPUTS, Tails, linear_torque, tail_inputs

CLASSES = (1, 2, 3)  # networks for N = 1, N = 2, and three or more tails
INPUT_COUNTS = (len(SINGLE_INPUTS), len(INPUTS), len(INPUTS))  # of these networks
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

    def solve(self, heads: Heads, tails: Tails) -> tuple[Floats, Flags]:
        """Solve for (v_x, v_z, ω_yr, ω_h, ω_t), (M, 5), of a positive motor; tell which robots converged, (M,)."""
        compile_once()
        motion = np.full((len(tails.number), 5), np.nan)
        converged = np.zeros(len(motion), dtype=bool)
        robots = pack_robots(heads, tails)
        for k, rows in rows_by_network(network_index(tails.number)):
            network = self.wrench[k]
            if network is not None:
                motion[rows], converged[rows] = solve_robots(network.packed, robots[rows])
        return motion, converged

    def outputs(self, heads: Heads, motion: Floats, gap: Floats) -> tuple[Floats, ...]:
        """Compute ω_t, ω_h, ω_yr, v_x and v_z of the head's centre, R_yr, θ in degrees, and the gap, each (M,)."""
        yaw, surge = heads.sense * motion[:, 2], motion[:, 1]
        sway = heads.sense * (motion[:, 0] + motion[:, 2] * heads.length / 2)
        radius = length(sway, surge) / magnitude(yaw)
        slip = angle(magnitude(sway), surge) * (180 / np.pi)
        spins = heads.sense * motion[:, 4], heads.sense * motion[:, 3]
        return (*spins, yaw, sway, surge, radius, slip, gap)

    def quick_gap(self, tails: Tails, inputs: Floats) -> Floats:
        """Return `tail_gap` with known inputs (M, 7) of the networks; without derivatives."""
        inputs = np.column_stack([inputs, np.log(tails.number)])
        return _gap(tails, self.gap.packed.evaluate(inputs)[:, 0])

    def tail_gap(self, tails: Tails, motion: Floats) -> Floats:
        """Return the smallest distance between tails over 2 r0, (M,); infinite for one tail."""
        return _gap(tails, self.gap(gap_inputs(tails, motion))[:, 0])


def _gap(tails: Tails, share: Floats) -> Floats:
    """Return the gap over 2 r0 from its share of the distance of the clamps."""
    return np.where(tails.number > 1, share * clamp_distance(tails) / (2 * tails.radius), np.inf)


def motion_sensitivity(heads: Heads, tails: Tails, motion: Floats) -> Floats:
    """Return ∂(relative motion)/∂(wrench) with the drag of straight tails, (M, 4, 4)."""
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


def clamp_distance(tails: Tails) -> Floats:
    return 2 * tails.offset * np.sin(np.pi / np.maximum(tails.number, 2.0))


def gap_inputs(tails: Tails, motion: Floats) -> Floats:
    return np.concatenate([tail_inputs(tails, motion), np.log(tails.number)[:, None]], -1)
