"""Fit the networks of the tails: their mean wrench and the gap between them, from simulated robots.

Samples are steady motions of robots with any heads. The wrench needs no simulation of its own: the head's balance
gives it from the robot's motion, W = R (v_x, v_z, ω_yr, ω_h, ω_t). So heads may be drawn far wider than
robots are.

The residual of a sample is the change of the robot's motion that a wrong wrench makes,

    r = K⁻¹ (W_table − W),   relative to v, v_z, ω_yr, ω_h,

where K is the resistance of head and straight tails. So the networks learn what a query asks for.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sim.arrays import Flags, Floats, Integers
from surrogate.networks.checkpoints import TrainingContext
from surrogate.networks.ensemble import Ensemble
from surrogate.networks.training_loop import Settings, TrainableEnsemble, fit
from surrogate.table.wrench_table import (
    CLASSES,
    INPUT_COUNTS,
    WrenchTable,
    motion_sensitivity,
    network_index,
)
from surrogate.wrench.heads import Heads, heads_and_tails
from surrogate.wrench.tails import (
    SINGLE_SMOOTHNESS,
    SMOOTHNESS,
    TYPICAL,
    Tails,
    network_inputs,
    straight_wrench,
    tail_inputs,
    wrench_slopes,
)

TURNS = 1.3  # largest |ω_yr/ω_t| that is learned
_OUTLIER = 10.0  # rows that weigh more than this many times the median weigh only so much
_GAP = Settings(width=24, depth=2, members=1, epochs=60, iterations=200)


class WrenchSamples(NamedTuple):
    """Simulated steady motions of M robots: what is learned."""

    heads: Heads
    tails: Tails
    motion: Floats  # (M, 5): (v_x of J, v_z, ω_yr, ω_h, ω_t), positive motor
    gap: Floats  # (M,)

    def at(self, rows: Integers | Flags) -> WrenchSamples:
        """Return the rows at indices or flags (M',)."""
        return WrenchSamples(self.heads.at(rows), self.tails.at(rows), self.motion[rows], self.gap[rows])


def wrench_samples(robots: Mapping[str, Floats], motion: Mapping[str, Floats]) -> WrenchSamples:
    """Return samples from columns of robots, effects included, and of their steady motion, each (M,)."""
    heads, tails = heads_and_tails(robots)
    columns = {name: np.asarray(motion[name], dtype=float) for name in
             ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "tail_gap")}  # fmt: skip
    sense, yaw = heads.sense, columns["omega_yr_bar"]
    at_disc = columns["v_x"] - yaw * heads.length / 2
    parts = [
        sense * at_disc,
        columns["v_z"],
        sense * yaw,
        sense * columns["omega_h_bar"],
        sense * columns["omega_t_bar"],
    ]
    return WrenchSamples(heads, tails, np.stack(parts, -1), columns["tail_gap"])


def learnable(rows: WrenchSamples) -> Flags:
    """Return rows that a table may learn, (M,): tails turn with the motor, and the robot yaws up to TURNS as fast.

    Two tails or more must yaw to the side to which the tails drive the robot: β jumps where a couple reverses the
    yaw. The network of one tail does not see β.
    """
    _, _, yaw, _, spin = rows.motion.T
    to_its_side = (yaw > 0) | (rows.tails.number == 1)
    return (spin > 0) & to_its_side & (np.abs(yaw) < TURNS * spin)


def fit_wrench(
    rows: WrenchSamples, settings: Settings, work: TrainingContext, *, single_settings: Settings | None = None
) -> WrenchTable:
    """Fit the networks of all CLASSES, and that of the gap, to samples that are `learnable`.

    Args:
        rows: the samples.
        settings: of the networks.
        work: device, progress bars, and where states are kept.
        single_settings: of the network of robots with one tail; by default `settings`.
    """
    own = {1: single_settings or settings}
    networks = tuple(fit_class(rows, count, own.get(count, settings), work) for count in CLASSES)
    several_tails = rows.at(rows.tails.number > 1)
    return WrenchTable(networks, _learn_gap(several_tails, _GAP, work.part("gap")))


def fit_class(rows: WrenchSamples, count: int, settings: Settings, work: TrainingContext) -> Ensemble | None:
    """Fit the network of one of CLASSES to its samples among `rows`; None if there are none."""
    samples = rows.at(network_index(rows.tails.number) == CLASSES.index(count))
    context = work.part(f"tails of N = {count}{' and more' if count == CLASSES[-1] else ''}")
    return _learn_wrench(samples, settings, context, count) if len(samples.motion) else None


def _learn_wrench(rows: WrenchSamples, settings: Settings, work: TrainingContext, count: int) -> Ensemble:
    """Fit the network of one of CLASSES."""
    inputs = network_inputs(rows.tails, rows.motion, INPUT_COUNTS[CLASSES.index(count)])
    weight = motion_sensitivity(rows.heads, rows.tails, rows.motion)
    matrix = weight @ wrench_slopes(rows.tails, rows.motion)
    wrench = (rows.heads.resistance @ rows.motion[..., None])[..., 0]
    wanted = (weight @ (wrench - straight_wrench(rows.tails, rows.motion))[..., None])[..., 0]
    mean, spread = np.array(TYPICAL)
    size = np.linalg.norm(matrix * spread, axis=(1, 2))
    share = np.minimum(_OUTLIER * np.quantile(size, 0.5, method="lower") / size, 1.0)
    network = _new(settings, inputs, outputs=len(mean))
    _prepare(network, mean, spread, count)

    def residual(y: Tensor, matrix: Tensor, wanted: Tensor) -> Tensor:
        return (matrix @ y[..., None])[..., 0] - wanted

    x, weights, *data = (torch.from_numpy(part) for part in (inputs, share, matrix, wanted))
    fit(network, x, data, residual, settings, work, weights=weights, unit="% of their motion")
    return network.trained()


def _prepare(network: TrainableEnsemble, mean: Floats, spread: Floats, count: int) -> None:
    network.mean.copy_(torch.from_numpy(mean))
    network.spread.copy_(torch.from_numpy(spread))
    smoothness = SINGLE_SMOOTHNESS if count == 1 else SMOOTHNESS
    network.scale.mul_(torch.tensor(smoothness, dtype=torch.float64) / 1.5)
    if count == CLASSES[-1]:
        network.scale[-1] = 1e9  # the head's spin drag plays no part


def _new(settings: Settings, inputs: Floats, outputs: int) -> TrainableEnsemble:
    network = TrainableEnsemble(
        inputs.shape[1], outputs, width=settings.width, depth=settings.depth, members=settings.members,
        seed=settings.seed,
    )  # fmt: skip
    network.shift.copy_(torch.from_numpy(inputs.mean(0)))
    network.scale.copy_(torch.from_numpy(np.maximum(inputs.std(0, ddof=1), 1e-6)))
    return network


def _learn_gap(rows: WrenchSamples, settings: Settings, work: TrainingContext) -> Ensemble:
    inputs = np.column_stack([tail_inputs(rows.tails, rows.motion), np.log(rows.tails.number)])
    share = rows.gap * rows.tails.radius / (rows.tails.offset * np.sin(np.pi / rows.tails.number))
    network = _new(settings, inputs, outputs=1)
    network.mean.fill_(0.5)
    network.spread.fill_(0.3)

    def residual(y: Tensor, share: Tensor) -> Tensor:
        return y - share[:, None]

    x, wanted = torch.from_numpy(inputs), torch.from_numpy(share)
    fit(network, x, (wanted,), residual, settings, work, unit="% of the distance between the clamps")
    return network.trained()
