"""The error of a plan: predicted, stated with its uncertainty, and guaranteed for paths of any length.

*Stated error*: 95 % of vehicles drawn at random within the uncertainty stay within this distance of the declared
path when they carry out the schedule open-loop. Uncertain are the modes of the vehicle (held-out errors of the
look-up table, covariance of a calibration, current) and the phase of the disc at each flip, which adds independent
noise with every dwell. Deviations are of first order in all of them.

*With feedback*: the same, if every k flips the pose is measured and the remaining path is planned again.

*Guaranteed error*: a bound for a vehicle without errors on a path of any length. With the swing β of the
heading (Ω T without lags) and the look-ahead Δ ≥ R′/(1 − κ̄ R′), R′ = R cos θ, and κ̄ the largest curvature of
the reference,

    |e| ≤ β (Δ + 2 a),

where a is the distance from the pivot to the tracked point. A flip adds its lag: at most |lag_x, lag_z| + 2 a
|lag_ψ| + Δ |lag_ψ|. Lengths are in l, times in μ0 l⁴/EI. Source: ours; the tests check it on random paths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.paths.distance import nearest
from planner.vehicle.rollout import Switches, pose_changes, poses_at_flips
from planner.vehicle.vehicle import SHORTEST, STEP, Vehicle, interpolated
from planner.vehicle.zigzag import Zigzag
from sim.arrays import Floats, Integers
from sim.mechanics import planar

LEVEL = 0.95
_DRAWS = 400
_BLOCKS = 300  # places along the schedule where deviations are drawn
_TIGHTEST = 0.97
_PAIRS_AHEAD = 4.0  # pairs of dwells


def look_ahead(vehicle: Vehicle, curvature: float, straight: Zigzag | None = None) -> float:
    """Compute Δ = R′/(1 − κ̄ R′), at least the way that the robot makes in some pairs of dwells."""
    least = vehicle.pivot_radius / (1 - min(curvature * vehicle.pivot_radius, _TIGHTEST))
    return least if straight is None else max(least, _PAIRS_AHEAD * straight.net_speed * sum(straight.dwells))


def guaranteed(vehicle: Vehicle, pivot_distance: float, swing: float, ahead: float) -> float:
    """Bound the distance from the reference [l] for a vehicle without errors; see the module."""
    lag = np.abs(vehicle.lag[:, :, round(SHORTEST / STEP) :]).max((0, 1, 2))
    flip = float(np.hypot(lag[0], lag[1]) + (ahead + 2 * pivot_distance) * lag[2])
    return swing * (ahead + 2 * pivot_distance) + flip


@dataclass(frozen=True)
class Predicted:
    """The predicted track against the declared path."""

    distance: Floats  # (K,), of every point of the track
    signed: Floats  # (K,), left positive
    normal: Floats  # (K, 2), to the left of the path
    closed: bool

    @property
    def largest(self) -> float:
        return float(self.distance.max())


def rms_in_time(distance: Floats, dwells: Floats) -> float:
    """Compute the rms over time of distances (M s + 1,), sampled s times in each dwell (M,), as `trace` does."""
    each = (distance[1:].reshape(len(dwells), -1) ** 2).mean(1)
    return float(np.sqrt((each * dwells).sum() / dwells.sum()))


def predicted_error(declared: Floats, track: Floats, *, closed: bool) -> Predicted:
    """Compute the distances of a track (K, 2) from the declared path (m, 2)."""
    distance, segment, share = nearest(declared, track)
    edge = np.diff(declared, axis=0)[segment]
    tangent = edge / np.maximum(np.hypot(*edge.T), 1e-300)[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], 1)
    foot = declared[segment] + share[:, None] * edge
    signed = ((track - foot) * normal).sum(1)
    return Predicted(distance, signed, normal, closed)


def stated_error(
    vehicle: Vehicle, switches: Switches, track: Floats, predicted: Predicted, *, every: int = 0, seed: int = 0
) -> float:
    """Compute the quantile LEVEL of the largest distance from the declared path [l], over random vehicles.

    Args:
        vehicle: with its modes and its spread.
        switches: the schedule.
        track: predicted track (M s + 1, 2), s samples a dwell.
        predicted: its distances from the path.
        every: number of flips between measured poses; 0: none is measured.
        seed: of the random draws.
    """
    count = len(switches.dwells)
    edges = np.unique(np.linspace(0, count, min(count, _BLOCKS) + 1).astype(int))
    if every:
        edges = np.unique(np.append(np.arange(0, count, max(every, count // _BLOCKS)), count))
    position, deviation, turned, noise = _deviations(vehicle, switches, edges)
    samples = (len(track) - 1) // count
    low, high, normal = _extremes(predicted, edges, samples)
    rng = np.random.default_rng(seed)
    z = rng.standard_normal((_DRAWS, len(vehicle.modes)))
    if every:  # each window starts from a known pose
        relative = (
            deviation[1:] - deviation[:-1] - turned[:-1, :, None] * _left(np.diff(position, axis=0))[:, None]
        )
        share = np.maximum(every / np.diff(edges), 0.0).clip(max=1.0)
        moved = np.einsum("dp,kpi->dki", z, relative) * share[:, None]
        moved += rng.standard_normal((_DRAWS, len(noise), 2)) * noise[:, :2] * np.sqrt(share)[:, None]
    else:
        moved = np.einsum("dp,kpi->dki", z, deviation[1:])
        steps = rng.standard_normal((_DRAWS, len(noise), 3)) * noise
        swung = np.cumsum(steps[..., 2], 1)
        middle = (position[1:] + position[:-1]) / 2
        lever = swung[..., None] * position[1:] - np.cumsum(steps[..., 2:] * middle, 1)
        moved += np.cumsum(steps[..., :2], 1) + _left(lever)
    across = np.einsum("dki,ki->dk", moved, normal)
    worst = np.maximum(np.abs(high + across), np.abs(low + across))
    if not predicted.closed:  # past the end of an open path
        tangent = np.array([normal[-1, 1], -normal[-1, 0]])
        beyond = np.maximum(moved[:, -1] @ tangent, 0.0)
        worst[:, -1] = np.hypot(worst[:, -1], beyond)
    return float(np.quantile(worst.max(1), LEVEL))


def _deviations(vehicle: Vehicle, switches: Switches, edges: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Propagate the modes to the flips `edges` (E,): position (E, 2), deviation (E, P, 2) and turn (E, P).

    The last array is the noise (E − 1, 3) of the blocks between: x and y in the lab, and heading.
    """
    poses = poses_at_flips(vehicle, switches)
    dwells, first = switches.dwells, switches.first_direction
    moves_predicted = pose_changes(vehicle, first, dwells, dwells[:, None])[:, 0]
    count, modes = len(dwells), vehicle.modes
    side = (np.arange(count) + (first < 0)) % 2
    lag = planar.compose(moves_predicted, planar.inverse(planar.arc(vehicle.twist[side], dwells)))
    deviation, turned = np.zeros((len(edges), len(modes), 2)), np.zeros((len(edges), len(modes)))
    lags = _mode_lags(vehicle, side, dwells)
    for p, mode in enumerate(modes):
        arc = planar.arc((vehicle.twist + mode.twist)[side], dwells)
        change = planar.compose(lag + lags[p], arc) - moves_predicted
        heading = np.concatenate([[0.0], np.cumsum(change[:, 2])])
        moves = planar.turn(change[:, :2], poses[:-1, 2]) + mode.current * dwells[:, None]
        moves += heading[:-1, None] * _left(np.diff(poses[:, :2], axis=0))
        position = np.concatenate([np.zeros((1, 2)), np.cumsum(moves, 0)])
        deviation[:, p], turned[:, p] = position[edges], heading[edges]
    spread = np.empty((count, 3))
    for index in (0, 1):
        spread[side == index] = vehicle.lag_noise(1 - 2 * index, dwells[side == index])
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(spread**2, 0)])[edges]
    variance = np.diff(total, axis=0)
    across = variance[:, :2].mean(1)  # x and y of the body are mixed in the lab
    noise = np.sqrt(np.stack([across, across, variance[:, 2]], 1))
    return poses[edges, :2], deviation, turned, noise


def _mode_lags(vehicle: Vehicle, side: Integers, dwells: Floats) -> list[Floats | float]:
    """Return what each mode adds to the lags (M, 3) of the dwells (M,) in directions `side` (M,)."""
    before = np.concatenate([dwells[:1], dwells[:-1]])
    with_lag = [p for p, mode in enumerate(vehicle.modes) if mode.lag is not None]
    added: list[Floats | float] = [0.0] * len(vehicle.modes)
    if not with_lag:
        return added
    lags = np.empty((len(dwells), len(with_lag), 3))
    for index in (0, 1):
        tables = np.stack([vehicle.modes[p].lag[index] for p in with_lag], 2)  # type: ignore[index]
        lags[side == index] = interpolated(tables, before[side == index], dwells[side == index])
    for place, p in enumerate(with_lag):
        added[p] = lags[:, place]
    return added


def _extremes(predicted: Predicted, edges: Floats, samples: int) -> tuple[Floats, Floats, Floats]:
    """Find lowest and highest signed distance in each block, (E − 1,), and the normal at its end, (E − 1, 2)."""
    signed = np.copysign(predicted.distance, predicted.signed)
    starts = (edges[:-1] * samples).astype(int)
    low, high = np.minimum.reduceat(signed, starts), np.maximum.reduceat(signed, starts)
    return low, high, predicted.normal[(edges[1:] * samples).astype(int)]


def _left(vector: Floats) -> Floats:
    """Turn vectors (..., 2) by a right angle to the left."""
    return np.stack([-vector[..., 1], vector[..., 0]], -1)
