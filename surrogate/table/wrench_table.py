"""The table of the tails: networks for the mean wrench and for the gap between tails, learned from simulated
robots.

Rows are steady motions of robots with any heads. The wrench needs no simulation of its own: the head's balance
gives it from the robot's own motion, W = R (v_x, v_z, ω_yr, ω_h, ω_t). So heads may be drawn far wider than
robots are.

The residual of a row is the change of the robot's motion that a wrong wrench makes,

    r = K⁻¹ (W_table − W),   relative to v, v_z, ω_yr, ω_h,

where K is the resistance of head and straight tails. So the networks learn what a query asks for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sim.arrays import Flags, Floats
from surrogate.compile_loops import compile_once
from surrogate.networks.checkpoints import Work
from surrogate.networks.compiled import Packed, evaluate_rows, packed
from surrogate.networks.ensemble import Ensemble
from surrogate.networks.training_loop import Settings, fit
from surrogate.wrench import heads as head
from surrogate.wrench import tails as tail
from surrogate.wrench.balance import solve_rows
from surrogate.wrench.heads import Heads
from surrogate.wrench.tails import Tails

CLASSES = (1, 2, 3)  # networks for N = 1, N = 2, and three or more tails
TURNS = 1.3  # largest |ω_yr/ω_t| that is learned
_OUTLIER = 10.0  # rows that weigh more than this many times the median weigh only so much
_LEAST_SURGE = 0.05  # of the speed: errors of v_z are relative to this at least
_GAP = Settings(width=24, depth=2, members=1, epochs=60, iterations=200)


def class_of(count: Tensor) -> Tensor:
    """Index in CLASSES of robots with N tails, (M,)."""
    return torch.clamp(count, max=float(CLASSES[-1])).long() - 1


@dataclass(frozen=True)
class TailTable:
    """Mean wrench and gap of tails, one network for each of CLASSES."""

    wrench: tuple[Ensemble | None, ...]  # None where no robots were learned
    gap: Ensemble

    def solve(self, heads: Heads, tails: Tails) -> tuple[Floats, Flags]:
        """(v_x, v_z, ω_yr, ω_h, ω_t) in balance for a positive motor, (M, 5); and which robots converged, (M,)."""
        compile_once()
        motion = np.full((len(tails.number), 5), np.nan)
        converged = np.zeros(len(motion), dtype=bool)
        speeds, drags = torch.stack([heads.speed, heads.gain], 1).numpy(), tail.columns_of(tails)
        resistances = heads.resistance.contiguous().numpy()
        kind = class_of(tails.number).numpy()
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
        """ω_t, ω_h, ω_yr, v_x and v_z of the head's centre, R_yr, θ in degrees, and the gap, each (M,)."""
        yaw, surge = heads.sense * motion[:, 2], motion[:, 1]
        sway = heads.sense * (motion[:, 0] + motion[:, 2] * heads.length / 2)
        radius = torch.sqrt(sway**2 + surge**2) / yaw.abs()
        angle = torch.rad2deg(torch.atan2(sway.abs(), surge))
        spins = heads.sense * motion[:, 4], heads.sense * motion[:, 3]
        return (*spins, yaw, sway, surge, radius, angle, gap)

    def quick_gap(self, tails: Tails, inputs: Floats) -> Tensor:
        """`tail_gap` with known inputs (M, 7) of the networks; without derivatives."""
        inputs = np.column_stack([inputs, np.log(tails.number.numpy())])
        return _gap(tails, torch.from_numpy(evaluate_rows(self._packed_gap, inputs)[:, 0]))

    def tail_gap(self, tails: Tails, motion: Tensor) -> Tensor:
        """Smallest distance between tails over 2 r0, (M,); infinite for one tail."""
        return _gap(tails, self.gap(_gap_inputs(tails, motion))[:, 0])


def _gap(tails: Tails, share: Tensor) -> Tensor:
    """The gap over 2 r0 from its share of the distance of the clamps."""
    return torch.where(tails.number > 1, share * _clamp_distance(tails) / (2 * tails.radius), torch.inf)


class Rows(NamedTuple):
    """Simulated steady motions of M robots: what is learned."""

    heads: Heads
    tails: Tails
    motion: Tensor  # (M, 5): (v_x of J, v_z, ω_yr, ω_h, ω_t), positive motor
    gap: Tensor  # (M,)

    def at(self, rows: Tensor) -> Rows:
        """The rows at indices or flags (M',)."""
        return Rows(
            head.at(self.heads, rows),
            tail.at(self.tails, rows),
            self.motion[rows],
            self.gap[rows],
        )


def rows_of(robots: Mapping[str, Floats], motion: Mapping[str, Floats]) -> Rows:
    """Rows from columns of robots, effects included, and of their steady motion, each (M,)."""
    heads, tails = head.robots_of(robots)
    found = {name: torch.as_tensor(np.asarray(motion[name]), dtype=torch.float64) for name in
             ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "tail_gap")}  # fmt: skip
    sense, yaw = heads.sense, found["omega_yr_bar"]
    at_disc = found["v_x"] - yaw * heads.length / 2
    parts = [
        sense * at_disc,
        found["v_z"],
        sense * yaw,
        sense * found["omega_h_bar"],
        sense * found["omega_t_bar"],
    ]
    return Rows(heads, tails, torch.stack(parts, -1), found["tail_gap"])


def learnable(rows: Rows) -> Flags:
    """Rows that a table may learn, (M,): tails that turn with the motor, faster than the robot yaws."""
    _, _, yaw, _, spin = rows.motion.unbind(-1)
    return np.asarray(((spin > 0) & (yaw > 0) & (yaw < TURNS * spin)).numpy())


def sensitivity_of(heads: Heads, tails: Tails, motion: Tensor) -> Tensor:
    """∂(relative motion)/∂(wrench) with the drag of straight tails, (M, 4, 4)."""
    matrix = heads.resistance[:, :, :4].clone()
    matrix[:, :, 3] += heads.gain[:, None] * heads.resistance[:, :, 4]
    matrix[:, :3, :3] += head.straight_resistance(tails)
    drag_number = tails.zeta_perp * motion[:, 4]
    torque = tails.number * tails.zeta_perp * tails.offset**2 * tail.torque_of(drag_number)
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


def learn_tails(rows: Rows, settings: Settings, work: Work) -> TailTable:
    """Networks of all CLASSES from rows that are `learnable`."""
    kind = class_of(rows.tails.number)
    networks: list[Ensemble | None] = []
    for k, count in enumerate(CLASSES):
        part = work.part(f"tails of N = {count}{' and more' if count == CLASSES[-1] else ''}")
        some = rows.at(kind == k)
        known = len(some.motion) > 0
        networks.append(_learn_wrench(some, settings, part, count) if known else None)
    many = rows.at(rows.tails.number > 1)
    gap = _learn_gap(many, _GAP, work.part("gap"))
    return TailTable(tuple(networks), gap)


def _learn_wrench(rows: Rows, settings: Settings, work: Work, count: int) -> Ensemble:
    """The network of one of CLASSES."""
    inputs = (tail.inputs_with_head if count == 1 else tail.inputs_of)(rows.tails, rows.motion)
    weight = sensitivity_of(rows.heads, rows.tails, rows.motion)
    matrix = weight @ tail.units_of(rows.tails, rows.motion)
    wrench = (rows.heads.resistance @ rows.motion[..., None])[..., 0]
    wanted = (weight @ (wrench - tail.straight_wrench(rows.tails, rows.motion))[..., None])[..., 0]
    mean, spread = (torch.tensor(part, dtype=torch.float64) for part in tail.TYPICAL)
    size = torch.linalg.matrix_norm(matrix * spread)
    share = torch.clamp(_OUTLIER * size.median() / size, max=1.0)
    network = _new(settings, inputs, outputs=len(mean))
    _prepare(network, mean, spread, count)

    def residual(y: Tensor, matrix: Tensor, wanted: Tensor) -> Tensor:
        return (matrix @ y[..., None])[..., 0] - wanted

    fit(network, inputs, (matrix, wanted), residual, settings, work, weights=share, unit="% of their motion")
    return network


def _prepare(network: Ensemble, mean: Tensor, spread: Tensor, count: int) -> None:
    network.mean.copy_(mean)
    network.spread.copy_(spread)
    smoothness = (*tail.SMOOTHNESS, *tail.HEAD_SMOOTHNESS)[: len(network.scale)]
    network.scale.mul_(torch.tensor(smoothness, dtype=torch.float64) / 1.5)
    if count == CLASSES[-1]:
        network.scale[-1] = 1e9  # the head's spin drag plays no part


def _new(settings: Settings, inputs: Tensor, outputs: int) -> Ensemble:
    network = Ensemble(
        inputs.shape[1], outputs, width=settings.width, depth=settings.depth, members=settings.members,
        seed=settings.seed,
    )  # fmt: skip
    network.shift.copy_(inputs.mean(0))
    network.scale.copy_(torch.clamp(inputs.std(0), min=1e-6))
    return network


def _clamp_distance(tails: Tails) -> Tensor:
    return 2 * tails.offset * torch.sin(torch.pi / torch.clamp(tails.number, min=2.0))


def _gap_inputs(tails: Tails, motion: Tensor) -> Tensor:
    return torch.cat([tail.inputs_of(tails, motion), torch.log(tails.number)[:, None]], -1)


def _learn_gap(rows: Rows, settings: Settings, work: Work) -> Ensemble:
    inputs = _gap_inputs(rows.tails, rows.motion)
    share = rows.gap * 2 * rows.tails.radius / _clamp_distance(rows.tails)
    network = _new(settings, inputs, outputs=1)
    network.mean.fill_(0.5)
    network.spread.fill_(0.3)

    def residual(y: Tensor, share: Tensor) -> Tensor:
        return y - share[:, None]

    fit(network, inputs, (share,), residual, settings, work, unit="% of the distance between the clamps")
    return network
