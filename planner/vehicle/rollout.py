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

_SMOOTH = np.radians(5)  # turn between two samples of a track that looks smooth


@dataclass(frozen=True)
class Switches:
    """First direction and dwell times; poses of the head's centre at the flips and the end."""

    first_direction: int  # of the motor, +1 or −1
    dwells: Floats  # (M,)
    poses: Floats  # (M + 1, 3)


def poses_at_flips(vehicle: Vehicle, switches: Switches) -> Floats:
    """Predict the poses (M + 1, 3) of the head's centre at the flips, if `vehicle` carries out the schedule."""
    changes = pose_changes(vehicle, switches.first_direction, switches.dwells, switches.dwells[:, None])[:, 0]
    return _chain(switches.poses[0], changes, vehicle.current * switches.dwells[:, None])


class Rollout(NamedTuple):
    """What a vehicle does on a schedule."""

    changes: Floats  # (M, 3), of the pose in each dwell
    poses: Floats  # (M + 1, 3), of the head's centre at the flips and the end
    track: Floats  # (M samples + 1, 2), of the tracked point


def roll_out(vehicle: Vehicle, switches: Switches, offset: float, *, samples: int = 8) -> Rollout:
    """Predict poses at the flips, and the track of the tracked point at equal times within each dwell."""
    share = np.arange(1, samples + 1) / samples
    times = switches.dwells[:, None] * share
    changes = pose_changes(vehicle, switches.first_direction, switches.dwells, times)
    flips = _chain(switches.poses[0], changes[:, -1], vehicle.current * switches.dwells[:, None])
    within = planar.compose(flips[:-1, None], changes)
    within[..., :2] += vehicle.current * times[..., None]
    poses = np.concatenate([flips[:1], within.reshape(-1, 3)])
    track = planar.compose(poses, np.array([offset, 0.0, 0.0]))[:, :2]
    return Rollout(changes[:, -1], flips, track)


def trace(vehicle: Vehicle, switches: Switches, offset: float, *, samples: int = 8) -> Floats:
    """Predict the track of the tracked point, (M samples + 1, 2), at equal times within each dwell."""
    return roll_out(vehicle, switches, offset, samples=samples).track


def trace_smoothly(vehicle: Vehicle, switches: Switches, offset: float) -> Floats:
    """Predict the track of the tracked point (S, 2) for pictures: a sample every 5°, at least 8 a dwell."""
    times = np.maximum(np.ceil(np.abs(np.diff(switches.poses[:, 2])) / (8 * _SMOOTH)), 1).astype(int)
    most = int(times.max())
    fine = trace(vehicle, switches, offset, samples=8 * most)
    wanted = np.arange(8 * most) % (most // times)[:, None] == 0  # of each dwell, without its end
    return np.concatenate([fine[:-1][wanted.ravel()], fine[-1:]])


def predicted_poses(vehicle: Vehicle, switches: Switches) -> Floats:
    """Predict poses (K, 3) of the head's centre, several a dwell."""
    times = switches.dwells[:, None] * np.arange(0, 9) / 8
    changes = pose_changes(vehicle, switches.first_direction, switches.dwells, times)
    poses = planar.compose(switches.poses[:-1, None], changes)
    poses[..., :2] += vehicle.current * times[..., None]
    return np.asarray(poses.reshape(-1, 3))


def pose_changes(vehicle: Vehicle, first_direction: int, dwells: Floats, times: Floats) -> Floats:
    """Predict the pose changes (M, K, 3) of each dwell after times (M, K), from rest."""
    before = np.concatenate([dwells[:1], dwells[:-1]])[:, None] + np.zeros_like(times)
    changes = np.empty((*times.shape, 3))
    for first, sense in ((0, first_direction), (1, -first_direction)):
        changes[first::2] = vehicle.motion(sense, before[first::2], times[first::2])
    changes[0] = vehicle.motion(first_direction, None, times[0])
    return changes


def _chain(start: Floats, changes: Floats, drift: Floats) -> Floats:
    """Compose poses (M + 1, 3) from a start, pose changes (M, 3) and moves in the lab (M, 2)."""
    heading = start[2] + np.concatenate([[0.0], np.cumsum(changes[:, 2])])
    moves = planar.turn(changes[:, :2], heading[:-1]) + drift
    position = start[:2] + np.concatenate([[[0.0, 0.0]], np.cumsum(moves, 0)])
    return np.concatenate([position, heading[:, None]], 1)
