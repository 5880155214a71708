"""Networks for the mean wrench of the tails and for the gap between them, and the motion that they give.

The networks are fitted by `surrogate.training.fit_wrench`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from sim.arrays import Flags, Floats
from surrogate.loops import compile_once
from surrogate.networks.compiled import Packed, evaluate_rows, packed
from surrogate.networks.ensemble import Ensemble
from surrogate.wrench.balance import solve_rows
from surrogate.wrench.heads import Heads, straight_resistance
from surrogate.wrench.tails import Tails, linear_torque, pack_tails, tail_inputs

CLASSES = (1, 2, 3)  # networks for N = 1, N = 2, and three or more tails
_LEAST_SURGE = 0.05  # of the speed: errors of v_z are relative to this at least


def network_index(count: Tensor) -> Tensor:
    """Return the index in CLASSES of robots with N tails, (M,)."""
    return torch.clamp(count, max=float(CLASSES[-1])).long() - 1


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
        speeds, drags = torch.stack([heads.speed, heads.gain], 1).numpy(), pack_tails(tails)
        resistances = heads.resistance.contiguous().numpy()
        kind = network_index(tails.number).numpy()
        for k, network in enumerate(self._packed):
            rows = np.flatnonzero(kind == k)
            if len(rows) and network is not None:
                motion[rows], converged[rows] = solve_rows(network, speeds[rows], resistances[rows], drags[rows])
        return motion, converged

    @cached_property
    def _packed(self) -> list[Packed | None]:
        return [None if network is None else packed(network) for network in self.wrench]

    @cached_property
    def _packed_gap(self) -> Packed:
        return packed(self.gap)

    def outputs(self, heads: Heads, motion: Tensor, gap: Tensor) -> tuple[Tensor, ...]:
        """Compute ω_t, ω_h, ω_yr, v_x and v_z of the head's centre, R_yr, θ in degrees, and the gap, each (M,)."""
        yaw, surge = heads.sense * motion[:, 2], motion[:, 1]
        sway = heads.sense * (motion[:, 0] + motion[:, 2] * heads.length / 2)
        radius = torch.sqrt(sway**2 + surge**2) / yaw.abs()
        angle = torch.rad2deg(torch.atan2(sway.abs(), surge))
        spins = heads.sense * motion[:, 4], heads.sense * motion[:, 3]
        return (*spins, yaw, sway, surge, radius, angle, gap)

    def quick_gap(self, tails: Tails, inputs: Floats) -> Tensor:
        """Return `tail_gap` with known inputs (M, 7) of the networks; without derivatives."""
        inputs = np.column_stack([inputs, np.log(tails.number.numpy())])
        return _gap(tails, torch.from_numpy(evaluate_rows(self._packed_gap, inputs)[:, 0]))

    def tail_gap(self, tails: Tails, motion: Tensor) -> Tensor:
        """Return the smallest distance between tails over 2 r0, (M,); infinite for one tail."""
        return _gap(tails, self.gap(gap_inputs(tails, motion))[:, 0])


def _gap(tails: Tails, share: Tensor) -> Tensor:
    """Return the gap over 2 r0 from its share of the distance of the clamps."""
    return torch.where(tails.number > 1, share * clamp_distance(tails) / (2 * tails.radius), torch.inf)


def motion_sensitivity(heads: Heads, tails: Tails, motion: Tensor) -> Tensor:
    """Return ∂(relative motion)/∂(wrench) with the drag of straight tails, (M, 4, 4)."""
    matrix = heads.resistance[:, :, :4].clone()
    matrix[:, :, 3] += heads.gain[:, None] * heads.resistance[:, :, 4]
    matrix[:, :3, :3] += straight_resistance(tails)
    drag_number = tails.zeta_perp * motion[:, 4]
    torque = tails.number * tails.zeta_perp * tails.offset**2 * linear_torque(drag_number)
    matrix[:, 3, 3] += heads.gain * torque
    v_x, v_z, yaw, head_spin, spin = motion.unbind(-1)
    speed = torch.hypot(v_x, v_z)
    size = torch.stack(
        [
            torch.hypot(v_x, yaw / 2),
            torch.maximum(v_z.abs(), _LEAST_SURGE * speed),
            yaw.abs(),
            torch.minimum(head_spin.abs(), spin) / 3,
        ],
        -1,
    )
    return torch.linalg.inv_ex(matrix)[0] / size[:, :, None]


def clamp_distance(tails: Tails) -> Tensor:
    return 2 * tails.offset * torch.sin(torch.pi / torch.clamp(tails.number, min=2.0))


def gap_inputs(tails: Tails, motion: Tensor) -> Tensor:
    return torch.cat([tail_inputs(tails, motion), torch.log(tails.number)[:, None]], -1)
