"""Switching times by hysteresis about the line of sight, and the track that they predict.

The reference of the pivot and its heading (`planner.tractrix.Reference`) give the wanted heading at every place:

    φ_d = φ_ref − atan(e/Δ),

with e the pivot's cross-track error (left positive) and Δ the look-ahead. The motor flips when

    σ (φ − φ_d) ≥ h = Ω T_min,   not before T_min after the last flip,

and the pose after each dwell is predicted with the vehicle. The next dwell starts from the predicted pose, so
errors do not add up along the path. Without this feedback they grow with the length of the path (docs/log.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from planner.tractrix import Reference
from planner.vehicle import FROM_REST, Vehicle
from sim.arrays import Floats, Integers
from sim.io.errors import InputError
from sim.mechanics import planar

_WINDOW = 40  # points of the reference that are searched before and after the last place
_TRIALS = 24  # times tried at once
_MOST_SWITCHES = 200_000


@dataclass(frozen=True)
class Switches:
    """First direction and dwell times; poses of the head's centre at the flips and the end."""

    first_direction: int
    dwells: Floats  # (M,)
    poses: Floats  # (M + 1, 3)


class _Follower:
    """Cross-track error and wanted heading along a reference; it remembers the last place."""

    def __init__(self, reference: Reference, ahead: float):
        self._q, self._heading, self._arc = reference.q, reference.heading, reference.arc
        self._ahead = ahead
        self.place = 0

    @property
    def finished(self) -> bool:
        return self.place >= len(self._q) - 2

    def look(self, q: Floats) -> tuple[Floats, Integers]:
        """Wanted headings (T,) and places (T,) for pivots (T, 2)."""
        low = max(0, self.place - _WINDOW // 4)
        window = self._q[low : self.place + _WINDOW]
        distance = ((q[:, None] - window[None]) ** 2).sum(-1)
        place = low + distance.argmin(1)
        segment = np.clip(place, 0, len(self._q) - 2)
        along = self._q[segment + 1] - self._q[segment]
        length = np.maximum(np.linalg.norm(along, axis=1), 1e-12)
        away = q - self._q[segment]
        share = np.clip((away * along).sum(1) / length**2, -1, 2)
        error = (along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0]) / length
        slope = self._heading[segment + 1] - self._heading[segment]
        wanted = self._heading[segment] + share * slope - np.arctan(error / self._ahead)
        return wanted, place


def follow(
    reference: Reference,
    vehicle: Vehicle,
    *,
    pivot_distance: float,
    ahead: float,
    dwell: float,
    offset: float,
) -> Switches:
    """Dwell times that keep the tracked point on the reference.

    Args:
        reference: declared path and its tractrix.
        vehicle: arcs and lags of the head's centre.
        pivot_distance: from the pivot to the tracked point.
        ahead: look-ahead Δ.
        dwell: minimum dwell T_min.
        offset: distance from the head's centre to the tracked point, forward.
    """
    follower = _Follower(reference, ahead)
    hysteresis = vehicle.yaw_rate * dwell
    tracked = np.array([*reference.p[0], reference.heading[0]])
    pose = planar.compose(tracked, np.array([-offset, 0.0, 0.0]))
    sense = _first_sense(reference)
    first = sense
    behind = np.array([offset - pivot_distance, 0.0, 0.0])  # head's centre -> pivot
    dwells: list[float] = []
    poses = [pose]
    step = dwell / 6
    if follower.finished:
        raise InputError("the path is too short for a single flip; scale it, or check its unit")
    while not follower.finished:
        if len(dwells) >= _MOST_SWITCHES:
            raise InputError(f"the path needs more than {_MOST_SWITCHES} switches; split it")
        share = 1.0 if dwells else FROM_REST
        begin = dwell
        while True:
            times = np.asarray(begin + step * np.arange(_TRIALS), dtype=np.float64)
            moved = planar.compose(pose, vehicle.motion(sense, times, share=share))
            wanted, place = follower.look(planar.compose(moved, behind)[:, :2])
            excess = sense * (moved[:, 2] - wanted) - hysteresis
            hit = np.flatnonzero((excess >= 0) | (place >= len(reference.q) - 2))
            if len(hit):
                break
            follower.place = int(place[-1])
            begin = float(times[-1]) + step
            if begin > 4 * math.pi / vehicle.yaw_rate:
                raise InputError("the robot turns in circles and does not reach the path; check the path's scale")
        i = int(hit[0])
        time = float(times[i])
        if i and excess[i] >= 0:
            time -= step * float(excess[i] / (excess[i] - excess[i - 1]))
        follower.place = int(place[i])
        pose = planar.compose(pose, vehicle.motion(sense, np.array(time), share=share))
        dwells.append(time)
        poses.append(pose)
        sense = -sense
    return Switches(first, np.array(dwells), np.array(poses))


def _first_sense(reference: Reference) -> int:
    """Turn first to the side to which the reference turns first."""
    turn = reference.heading - reference.heading[0]
    far = np.flatnonzero(np.abs(turn) > 1e-6)
    return 1 if not len(far) or turn[far[0]] > 0 else -1


def predict(vehicle: Vehicle, switches: Switches, offset: float) -> Floats:
    """Poses (M + 1, 3) of the tracked point at the flips, if `vehicle` carries out the schedule.

    `offset` is the distance from the head's centre forward to the tracked point.
    """
    changes = _changes(vehicle, switches.first_direction, switches.dwells[:, None])[:, 0]
    return planar.compose(_chain(switches.poses[0], changes), np.array([offset, 0.0, 0.0]))


def trace(vehicle: Vehicle, switches: Switches, offset: float, *, samples: int = 8) -> Floats:
    """Predicted track of the tracked point, (M samples + 1, 2), at equal times within each dwell."""
    share = np.arange(1, samples + 1) / samples
    changes = _changes(vehicle, switches.first_direction, switches.dwells[:, None] * share)
    flips = _chain(switches.poses[0], changes[:, -1])
    within = planar.compose(flips[:-1, None], changes).reshape(-1, 3)
    poses = np.concatenate([flips[:1], within])
    return planar.compose(poses, np.array([offset, 0.0, 0.0]))[:, :2]


def _changes(vehicle: Vehicle, first_direction: int, times: Floats) -> Floats:
    """Pose changes (M, K, 3) of each dwell after times (M, K)."""
    both = [vehicle.motion(s, times) for s in (first_direction, -first_direction)]
    even = (np.arange(len(times)) % 2 == 0)[:, None, None]
    changes = np.where(even, both[0], both[1])
    changes[0] = vehicle.motion(first_direction, times[0], share=FROM_REST)
    return changes


def _chain(start: Floats, changes: Floats) -> Floats:
    """Poses (M + 1, 3) from a start and pose changes (M, 3)."""
    heading = start[2] + np.concatenate([[0.0], np.cumsum(changes[:, 2])])
    moves = planar.turn(changes[:, :2], heading[:-1])
    position = start[:2] + np.concatenate([[[0.0, 0.0]], np.cumsum(moves, 0)])
    return np.concatenate([position, heading[:, None]], 1)
