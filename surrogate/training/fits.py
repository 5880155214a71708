"""Fit the networks of a look-up table to simulated robots: the tails' mean wrench, their gap, flips.

Samples are steady motions of robots with any heads. The wrench needs no simulation of its own: the head's balance
gives it from the robot's motion, W = R (v_x, v_z, ω_yr, ω_h, ω_t). So heads may be drawn far wider than
robots are. The residual of a sample is the change of the robot's motion that a wrong wrench makes,

    r = K⁻¹ (W_table − W),   relative to v, v_z, ω_yr, ω_h,

where K is the resistance of head and straight tails. So the networks learn what a query asks for.

The response is learned as components of curves, see `surrogate.response`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from common.arrays import Flags, Floats, Integers
from surrogate.motions import CLASSES, INPUT_COUNTS, WrenchTable, network_index
from surrogate.network import Ensemble
from surrogate.response import PARTS, SHAPES, Basis, ResponseTable, along_axes, encoded_spread, flip_inputs
from surrogate.tails import (
    INPUTS,
    PAIR_SMOOTHNESS,
    SINGLE_SMOOTHNESS,
    SMOOTHNESS,
    TYPICAL,
    RobotColumns,
    motion_sensitivity,
    network_inputs,
    pack_robots,
    robots_of,
    straight_resistance,
    wrench_slopes,
)
from surrogate.training.networks import Settings, TrainableEnsemble, TrainingContext, fit

TURNS = 1.3  # largest |ω_yr/ω_t| that is learned
_MANY = 1024  # rows from which all inputs are worth having
_SMOOTHNESS = {len(some): some for some in (SINGLE_SMOOTHNESS, PAIR_SMOOTHNESS, SMOOTHNESS)}
_FURTHER = 3  # part of the iterations with which a trained network goes on
_OUTLIER = 10.0  # rows that weigh more than this many times the median weigh only so much
_GAP = Settings(width=24, depth=2, members=1, epochs=60, iterations=200)
_COMPONENTS = {"lag": 32, "memory": 32, "rest": 32, "spread": 8}
CURVES = Settings(width=48, depth=2, members=2, epochs=200, iterations=150)
_SMOOTH = 2.0  # standard deviations over which the components change


class WrenchSamples(NamedTuple):
    """Simulated steady motions of M robots: what is learned."""

    robots: RobotColumns
    motion: Floats  # (M, 5): (v_x of J, v_z, ω_yr, ω_h, ω_t), positive motor
    gap: Floats  # (M,)

    def at(self, rows: Integers | Flags) -> WrenchSamples:
        """Return the rows at indices or flags (M',)."""
        return WrenchSamples(self.robots.at(rows), self.motion[rows], self.gap[rows])


def wrench_samples(columns: Mapping[str, Floats], motion: Mapping[str, Floats]) -> WrenchSamples:
    """Return samples from columns of robots, effects included, and of their steady motion, each (M,)."""
    robots = robots_of(columns)
    spin, head_spin, yaw, v_x, v_z, gap = (
        np.asarray(motion[name], dtype=float)
        for name in ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "tail_gap")
    )
    at_disc, sense = v_x - yaw * robots.head_length / 2, robots.sense
    parts = [sense * at_disc, v_z, sense * yaw, sense * head_spin, sense * spin]
    return WrenchSamples(robots, np.stack(parts, -1), gap)


def learnable(rows: WrenchSamples) -> Flags:
    """Return rows that a table may learn, (M,): tails turn with the motor, and the robot yaws up to TURNS as fast.

    Two tails or more must yaw to the side to which the tails drive the robot: β jumps where a couple reverses the
    yaw. The network of one tail does not see β.
    """
    _, _, yaw, _, spin = rows.motion.T
    to_its_side = (yaw > 0) | (rows.robots.number == 1)
    return (spin > 0) & to_its_side & (np.abs(yaw) < TURNS * spin)


def fit_wrench(
    rows: WrenchSamples,
    settings: Settings,
    context: TrainingContext,
    *,
    few_settings: Settings | None = None,
    start: WrenchTable | None = None,
) -> WrenchTable:
    """Fit the networks of all CLASSES, and that of the gap, to samples that are `learnable`.

    Args:
        rows: the samples.
        settings: of the networks.
        context: device, progress bars, and where states are kept.
        few_settings: of the networks of robots with one and two tails, which are harder; by default `settings`.
        start: networks from which those of the same shape go on; they have been through Adam.
    """
    networks: list[Ensemble | None] = []
    trained = start.wrench if start else (None,) * len(CLASSES)
    for k, count in enumerate(CLASSES):
        samples = rows.at(network_index(rows.robots.number) == k)
        part = context.part(f"tails of N = {count}{' and more' if count == CLASSES[-1] else ''}")
        own = few_settings if few_settings and count <= 2 else settings
        networks.append(_fit_class(samples, own, part, k, trained[k]) if len(samples.motion) else None)
    gap = _fit_gap(rows.at(rows.robots.number > 1), _GAP, context.part("gap"))
    return WrenchTable(tuple(networks), gap)


def _fit_class(
    rows: WrenchSamples, settings: Settings, context: TrainingContext, k: int, start: Ensemble | None
) -> Ensemble:
    """Fit the network of CLASSES[k] to its samples, from its start or from random numbers."""
    robots, motion = rows.robots, rows.motion
    weight = motion_sensitivity(robots, motion)
    matrix = weight @ wrench_slopes(robots, motion)
    wrench = (robots.resistance @ motion[..., None])[..., 0]
    wrench[:, :3] += (straight_resistance(robots) @ motion[:, :3, None])[..., 0]
    wanted = (weight @ wrench[..., None])[..., 0]
    mean, spread = np.array(TYPICAL)
    size = np.linalg.norm(matrix * spread, axis=(1, 2))
    share = np.minimum(_OUTLIER * np.quantile(size, 0.5, method="lower") / size, 1.0)
    count = INPUT_COUNTS[k][-1 if len(motion) < _MANY else 0]
    smoothness = np.array(_SMOOTHNESS[count]) / 1.5

    def residual(y: Tensor, matrix: Tensor, wanted: Tensor) -> Tensor:
        return (matrix @ y[..., None])[..., 0] - wanted

    inputs = network_inputs(robots, motion, count)
    scale = smoothness * _deviation(inputs)
    if CLASSES[k] == CLASSES[-1]:
        scale[-1] = 1e9  # the head's spin drag plays no part
    data = (matrix, wanted)
    unit = "% of their motion"
    return _fitted(inputs, scale, mean, spread, data, residual, settings, context, unit, share, start)


def _fit_gap(rows: WrenchSamples, settings: Settings, context: TrainingContext) -> Ensemble:
    robots = rows.robots
    inputs = np.column_stack([network_inputs(robots, rows.motion, len(INPUTS)), np.log(robots.number)])
    share = rows.gap * robots.radius / (robots.offset * np.sin(np.pi / robots.number))

    def residual(y: Tensor, share: Tensor) -> Tensor:
        return y - share[:, None]

    mean, spread, unit = np.array([0.5]), np.array([0.3]), "% of the distance between the clamps"
    return _fitted(inputs, _deviation(inputs), mean, spread, (share,), residual, settings, context, unit)


def fit_response(
    rows: WrenchSamples, curves: Mapping[str, Floats], settings: Settings, context: TrainingContext
) -> ResponseTable:
    """Fit a table to curves of robots, by name as in SHAPES, each (M, …, 3); NaN where one was not simulated."""
    rough = replace(settings, width=settings.width // 2)  # enough for a spread
    parts = [fit_part(names, rows, curves, rough if "spread" in names else settings, context) for names in PARTS]
    bases = {name: basis for _, of_part in parts for name, basis in of_part.items()}
    return ResponseTable(tuple(network for network, _ in parts), bases)


def fit_part(
    names: Sequence[str],
    rows: WrenchSamples,
    curves: Mapping[str, Floats],
    settings: Settings,
    context: TrainingContext,
) -> tuple[Ensemble, dict[str, Basis]]:
    """Fit the network of some curves, one of PARTS, and return it with their bases; see `fit_response`."""
    robots, tails = rows.robots, network_inputs(rows.robots, rows.motion, len(INPUTS))
    inputs, speeds = flip_inputs(pack_robots(robots), rows.motion, tails)
    known = np.all([np.isfinite(curves[n]).reshape(len(inputs), -1).all(1) for n in names], axis=0)
    if "spread" in names and (known & (robots.number == 2)).any():
        known &= robots.number == 2
    bases, targets, weights = {}, [], []
    for name in names:
        scaled = (curves[name][known] / along_axes(speeds[known], SHAPES[name])).reshape(known.sum(), -1)
        if name == "spread":
            scaled = encoded_spread(scaled.reshape(-1, *SHAPES[name]))
        bases[name] = _basis(scaled, _COMPONENTS[name])
        targets.append((scaled - bases[name].mean) @ bases[name].vectors.T)
        weights += [(3 / np.prod(SHAPES[name])) ** 0.5] * len(bases[name].vectors)
    wanted, inputs = np.concatenate(targets, -1), inputs[known]
    low, high = np.quantile(wanted, [0.16, 0.84], axis=0)
    spread, scale = np.maximum((high - low) / 2, 1e-8), _deviation(inputs) * _SMOOTH

    def residual(y: Tensor, wanted: Tensor, weights: Tensor) -> Tensor:
        return (y - wanted) * weights

    data = (wanted, np.broadcast_to(weights, wanted.shape).copy())
    unit = "% of the spread" if "spread" in names else "% of the way in one unit of time"
    part, mean = context.part(" and ".join(names)), np.zeros(wanted.shape[1])
    return _fitted(inputs, scale, mean, spread, data, residual, settings, part, unit), bases


def _basis(flat: Floats, count: int) -> Basis:
    """Return the median and the first components of curves (M, D); outliers do not choose the components."""
    mean = np.quantile(flat, 0.5, axis=0, method="lower")
    size = np.linalg.norm(flat - mean, axis=1, keepdims=True)
    typical = np.quantile(size, 0.5, method="lower")
    limited = (flat - mean) * np.minimum(5 * typical / np.maximum(size, 1e-12), 1.0)
    return Basis(mean, np.linalg.svd(limited, full_matrices=False)[2][:count].copy())


def _deviation(inputs: Floats) -> Floats:
    """Return the standard deviation of each input, (F,)."""
    return np.maximum(inputs.std(0, ddof=1), 1e-6)


def _fitted(
    inputs: Floats, scale: Floats, mean: Floats, spread: Floats, data: Sequence[Floats],
    residual: Callable[..., Tensor], settings: Settings, context: TrainingContext, unit: str,
    weights: Floats | None = None, start: Ensemble | None = None,
) -> Ensemble:  # fmt: skip
    """Fit a network with this scale of its inputs (M, F), and mean and spread of its outputs (O,).

    From a start of the same shape it goes on for a part of the iterations, without Adam, which would lose it.
    """
    sizes = {name: getattr(settings, name) for name in ("width", "depth", "members", "seed")}
    network = TrainableEnsemble(inputs.shape[1], len(mean), **sizes)
    numbers = {"shift": inputs.mean(0), "scale": scale, "mean": mean, "spread": spread}
    for name, values in numbers.items():
        getattr(network, name).copy_(torch.from_numpy(values))
    if start is not None and start.shape == network.shape:
        network.load_state_dict({name: torch.from_numpy(part) for name, part in start.state.items()})
        settings = replace(settings, epochs=0, iterations=settings.iterations // _FURTHER)
    x, *parts = map(torch.from_numpy, (inputs, *data))
    of_rows = None if weights is None else torch.from_numpy(weights)
    fit(network, x, parts, residual, settings, context, weights=of_rows, unit=unit)
    return network.trained()
