"""The error of a plan: predicted, stated with its uncertainty, and guaranteed for paths of any length.

*Stated error*: 95 % of vehicles drawn at random within the uncertainty stay within this distance of the declared
path when they carry out the schedule open-loop. Uncertain are the modes of the vehicle (held-out errors of the
look-up table, covariance of a calibration, current) and the phase of the disc at the first flip. Deviations are of
first order in all of them (`planner.planning.error_growth`). The motion within a revolution of the disc is added.

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

from planner.draws import normals
from planner.paths.distance import nearest
from planner.planning.error_growth import ErrorGrowth
from planner.vehicle.vehicle import SHORTEST, STEP, Vehicle
from planner.vehicle.zigzag import Zigzag
from sim.arrays import Floats, Integers

LEVEL = 0.95
WOBBLE = 0.002  # l; what the disc's revolutions move the body, which the vehicle averages
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


def flips_between(count: int) -> Integers:
    """Choose the flips of a schedule of `count` dwells between which deviations are drawn, some _BLOCKS."""
    return np.unique(np.linspace(0, count, min(count, _BLOCKS) + 1).astype(int))


def stated_error(growth: ErrorGrowth, predicted: Predicted, *, seed: int = 0) -> float:
    """Compute the quantile LEVEL of the largest distance from the declared path [l], over random vehicles.

    Args:
        growth: of the errors, at the flips of `flips_between`.
        predicted: distances of the predicted track from the path.
        seed: of the random draws, see `planner.draws`.
    """
    edges = growth.flips
    low, high, normal = _extremes(predicted, edges, (len(predicted.distance) - 1) // int(edges[-1]))
    moved, _ = deviations_open_loop(growth, seed)
    across = np.einsum("dki,ki->dk", moved, normal)
    worst = np.maximum(np.abs(high + across), np.abs(low + across))
    if not predicted.closed:  # past the end of an open path
        tangent = np.array([normal[-1, 1], -normal[-1, 0]])
        beyond = np.maximum(moved[:, -1] @ tangent, 0.0)
        worst[:, -1] = np.hypot(worst[:, -1], beyond)
    return float(np.quantile(worst.max(1), LEVEL)) + WOBBLE


def deviations_open_loop(growth: ErrorGrowth, seed: int = 0) -> tuple[Floats, Floats]:
    """Draw deviations at the ends of the blocks: of the place (D, E − 1, 2) and of the heading (D, E − 1)."""
    blocks, modes, _ = growth.deviation[1:].shape
    z = normals(seed, 0, _DRAWS * modes).reshape(_DRAWS, modes)
    flat = np.moveaxis(growth.deviation[1:], 1, 0).reshape(modes, 2 * blocks)
    return (z @ flat).reshape(_DRAWS, blocks, 2), z @ growth.turned[1:].T


def _extremes(predicted: Predicted, edges: Integers, samples: int) -> tuple[Floats, Floats, Floats]:
    """Find lowest and highest signed distance in each block, (E − 1,), and the normal at its end, (E − 1, 2)."""
    signed = np.copysign(predicted.distance, predicted.signed)
    starts = edges[:-1] * samples
    low, high = np.minimum.reduceat(signed, starts), np.maximum.reduceat(signed, starts)
    return low, high, predicted.normal[edges[1:] * samples]
