"""The last dwells of a schedule are changed a little, so that the motion ends at a given pose.

A few of them are enough: three numbers must be met. The change is the smallest one, in least squares, with all
dwells at least as long as the shortest one. Some dwells may be left out. Of what ends at the goal, the quickest is
taken.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from planner.schedule import Switches, poses_at_flips
from planner.vehicle import Vehicle
from sim.arrays import Floats
from sim.mechanics import planar

_LAST = 16  # dwells that are changed
_DROPPED = 4  # at most so many are left out
_REACHED = 1e-5  # l and rad
_STEP = 1e-4  # time units, for derivatives
_CHANGE = 0.03  # weight of changes, beside _GOAL
_GOAL = 1e3


def ending_at(goal: tuple[float, float, float], vehicle: Vehicle, dwell: float) -> Callable[[Switches], Switches]:
    """A function that makes a schedule end at a pose.

    Args:
        goal: x, y [l] and heading [rad] of the head's centre.
        vehicle: who carries it out.
        dwell: the shortest dwell.
    """

    def ended(switches: Switches) -> Switches:
        best, least = switches, math.inf
        for dropped in range(min(_DROPPED, len(switches.dwells) - 1) + 1):
            count = len(switches.dwells) - dropped
            tried = Switches(switches.first_direction, switches.dwells[:count], switches.poses[: count + 1])
            found, error = _bent(tried, goal, vehicle, dwell)
            cost = float(found.dwells.sum()) + 1e6 * max(error - _REACHED, 0.0)
            if cost < least:
                best, least = found, cost
        return best

    return ended


def _bent(
    switches: Switches, goal: tuple[float, float, float], vehicle: Vehicle, dwell: float
) -> tuple[Switches, float]:
    """The schedule with other last dwells, and how far it ends from the goal [l and rad]."""
    kept = max(len(switches.dwells) - _LAST, 0)
    own = switches.dwells[kept:]
    turns = round((switches.poses[-1, 2] - goal[2]) / (2 * math.pi))
    target = np.array([goal[0], goal[1], goal[2] + 2 * math.pi * turns])

    def end(last: Floats) -> Floats:
        return end_poses(vehicle, switches, kept, last)

    def residual(last: Floats) -> Floats:
        return np.concatenate([_GOAL * (end(last[None])[0] - target), _CHANGE * (last - own) / dwell])

    def slopes(last: Floats) -> Floats:
        moved = end(np.concatenate([last[None], last + _STEP * np.eye(len(last))]))
        return np.concatenate([_GOAL * (moved[1:] - moved[0]).T / _STEP, _CHANGE / dwell * np.eye(len(last))])

    start = np.maximum(own, dwell * (1 + 1e-6))
    found = least_squares(residual, start, slopes, bounds=(dwell, np.inf), x_scale=dwell, max_nfev=40).x
    changed = Switches(switches.first_direction, np.concatenate([switches.dwells[:kept], found]), switches.poses)
    poses = poses_at_flips(vehicle, changed)
    changed = Switches(switches.first_direction, changed.dwells, poses)
    return changed, float(np.abs(poses[-1] - target).max())


def end_poses(vehicle: Vehicle, switches: Switches, kept: int, last: Floats) -> Floats:
    """Poses (B, 3) at the end, where other dwells (B, K) follow the first `kept` ones of a schedule."""
    pose = np.repeat(switches.poses[None, kept], len(last), 0)
    before = None if kept == 0 else np.full(len(last), switches.dwells[kept - 1])
    sense = switches.first_direction * (-1) ** kept
    for dwell in last.T:
        pose = planar.compose(pose, vehicle.motion(sense, before, dwell))
        pose[:, :2] += vehicle.current * dwell[:, None]
        sense, before = -sense, dwell
    return pose
