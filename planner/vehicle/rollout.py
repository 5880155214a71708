"""What a vehicle does when its motor flips at given times: pose changes of the dwells, composed one after another.

Poses are x, y and heading of the head's centre. Lengths in l, times in μ0 l⁴/EI. A current adds to the position in
the lab in proportion to time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planner.vehicle.vehicle import Vehicle
from sim.arrays import Floats
from sim.mechanics import planar

_SAMPLES = 8  # of a dwell
_SMOOTH = np.radians(5)  # turn between two samples of a track that looks smooth


@dataclass(frozen=True)
class Switches:
    """First direction and dwell times; poses of the head's centre at the flips and the end."""

    first_direction: int  # of the motor, +1 or −1
    dwells: Floats  # (M,)
    poses: Floats  # (M + 1, 3)


class Rollout(NamedTuple):
    """What a vehicle does on a schedule of M dwells."""

    changes: Floats  # (M, 3), of the pose in each dwell
    flips: Floats  # (M + 1, 3), poses of the head's centre at the flips and the end
    poses: Floats  # (M samples + 1, 3), of the head's centre at equal times within each dwell
    track: Floats  # (M samples + 1, 2), of the tracked point


def roll_out(vehicle: Vehicle, switches: Switches, offset: float = 0.0, *, samples: int = _SAMPLES) -> Rollout:
    """Predict poses on a schedule, and the track of the point that is `offset` ahead of the head's centre."""
    times = switches.dwells[:, None] * np.arange(1, samples + 1) / samples
    changes = _pose_changes(vehicle, switches.first_direction, None, switches.dwells, times)
    flips = _chained(vehicle, switches.poses[0], changes[:, -1], switches.dwells)
    within = planar.compose(flips[:-1, None], changes)
    within[..., :2] += vehicle.current * times[..., None]
    poses = np.concatenate([flips[:1], within.reshape(-1, 3)])
    track = planar.compose(poses, np.array([offset, 0.0, 0.0]))[:, :2]
    return Rollout(changes[:, -1], flips, poses, track)


def smooth_track(vehicle: Vehicle, switches: Switches, offset: float) -> Floats:
    """Predict the track of the tracked point (S, 2) for pictures: a sample every 5°, at least 8 a dwell."""
    times = np.maximum(np.ceil(np.abs(np.diff(switches.poses[:, 2])) / (_SAMPLES * _SMOOTH)), 1).astype(int)
    most = int(times.max())
    fine = roll_out(vehicle, switches, offset, samples=_SAMPLES * most).track
    wanted = np.arange(_SAMPLES * most) % (most // times)[:, None] == 0  # of each dwell, without its end
    return np.concatenate([fine[:-1][wanted.ravel()], fine[-1:]])


def flips_after(vehicle: Vehicle, switches: Switches, kept: int, last: Floats) -> Floats:
    """Predict the poses (B, K, 3) at the flips where dwells (B, K) follow the first `kept` ones of a schedule."""
    sense, before = switches.first_direction * (-1) ** kept, switches.dwells[kept - 1] if kept else None
    changes = _pose_changes(vehicle, sense, before, last, last[..., None])[..., 0, :]
    return _chained(vehicle, switches.poses[kept], changes, last)[:, 1:]


def _pose_changes(vehicle: Vehicle, sense: int, before: float | None, dwells: Floats, times: Floats) -> Floats:
    """Predict the pose changes (..., M, K, 3) of dwells (..., M), the first one in direction `sense`.

    Args:
        vehicle: who carries them out.
        sense: direction of the first dwell.
        before: length of the dwell before the first one; None: from rest.
        dwells: their lengths.
        times: (..., M, K), since the flip before each.
    """
    first = np.full_like(dwells[..., :1], dwells.flat[0] if before is None else before)
    earlier = np.concatenate([first, dwells[..., :-1]], -1)[..., None] + np.zeros_like(times)
    changes = np.empty((*times.shape, 3))
    for k, direction in enumerate((sense, -sense)):
        changes[..., k::2, :, :] = vehicle.motion(direction, earlier[..., k::2, :], times[..., k::2, :])
    if before is None:
        changes[..., 0, :, :] = vehicle.motion(sense, None, times[..., 0, :])
    return changes


def _chained(vehicle: Vehicle, start: Floats, changes: Floats, dwells: Floats) -> Floats:
    """Compose poses (..., M + 1, 3) from a start and the pose changes (..., M, 3) of dwells (..., M)."""
    heading = start[2] + np.cumsum(changes[..., 2], -1)
    moves = planar.turn(changes[..., :2], heading - changes[..., 2]) + vehicle.current * dwells[..., None]
    poses = np.concatenate([start[:2] + np.cumsum(moves, -2), heading[..., None]], -1)
    return np.concatenate([np.broadcast_to(start, (*poses.shape[:-2], 1, 3)), poses], -2)
