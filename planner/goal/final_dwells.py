"""Adjust the last dwells of a schedule so that the motion ends at a given pose.

The dwells minimise a sum of squares: time, distances of the pivot from its track beyond those of the schedule, and
the distance from the goal. A pose has three coordinates, so a few dwells are enough, and some may be dropped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from planner.paths.distance import distance_to
from planner.planning.camera import POSE
from planner.planning.declare import Declared
from planner.planning.solve import Setting
from planner.vehicle.rollout import Switches, poses_at_flips
from planner.vehicle.vehicle import Vehicle
from sim.arrays import Floats
from sim.mechanics import planar

_LAST = 30  # dwells that are changed
_DROPPED = 4  # at most this many are left out
_REACHED = 1e-4  # l and rad
_STEP = 1e-4  # time units, for derivatives
_CONVERGED = 1e-3  # relative gain of the cost in a step, below which the search ends
_MOST_EVALUATIONS = 200  # about thirty are needed
_GOAL = 1e7  # time units that a squared distance [l² or rad²] from the goal costs
_FAR = 3e4  # the same for a distance [l] from the track, beyond the largest one of the schedule


@dataclass(frozen=True)
class Ending:
    """Changes the last dwells of a plan's schedule so that it ends at a pose."""

    goal: POSE  # of the head's centre
    least: float  # dwell that the motor allows
    shorter: float = 1.0  # share of the plan's shortest dwell that these dwells must keep

    def __call__(self, switches: Switches, declared: Declared, setting: Setting) -> Switches:
        dwell = min(setting.dwell, max(self.least, self.shorter * setting.dwell))
        return end_at_goal(switches, self.goal, setting.tracked.vehicle, dwell, declared.reference.q)


def end_at_goal(switches: Switches, goal: POSE, vehicle: Vehicle, dwell: float, track: Floats) -> Switches:
    """Change the last dwells of a schedule so that it ends at a pose.

    Args:
        switches: the schedule.
        goal: x, y [l] and heading [rad] of the head's centre.
        vehicle: who carries it out.
        dwell: the shortest dwell.
        track: (m, 2), that of the pivot.
    """
    best, lowest = switches, math.inf
    for dropped in range(min(_DROPPED, len(switches.dwells) - 1) + 1):
        count = len(switches.dwells) - dropped
        shorter = Switches(switches.first_direction, switches.dwells[:count], switches.poses[: count + 1])
        candidate, cost = _Ending(shorter, goal, vehicle, dwell, track).solved()
        if cost < lowest:
            best, lowest = candidate, cost
    return best


class _Ending:
    """The least-squares problem of the last dwells of a schedule."""

    def __init__(self, switches: Switches, goal: POSE, vehicle: Vehicle, dwell: float,
                 track: Floats):  # fmt: skip
        self._switches, self._vehicle, self._least, self._track = switches, vehicle, dwell, track
        self._kept = max(len(switches.dwells) - _LAST, 0)
        turns = round((switches.poses[-1, 2] - goal[2]) / (2 * math.pi))
        self._goal = np.array([goal[0], goal[1], goal[2] + 2 * math.pi * turns])
        self._near = float(self._distances(switches.poses[None, self._kept + 1 :]).max())
        self._known: dict[bytes, tuple[Floats, Floats]] = {}

    def solved(self) -> tuple[Switches, float]:
        """Return the changed schedule and its cost."""
        from scipy.optimize import least_squares  # here, for it takes longer to load than most plans to make

        first = self._switches.first_direction
        kept, last = self._switches.dwells[: self._kept], self._switches.dwells[self._kept :]
        solution = least_squares(
            self._residuals,
            np.maximum(last, self._least * (1 + 1e-6)),
            self._slopes,
            bounds=(self._least, np.inf),
            x_scale=self._least,
            max_nfev=_MOST_EVALUATIONS,
            ftol=_CONVERGED,
        ).x
        residuals = self._at(solution)[0]
        missed = float(np.abs(residuals[:3]).max()) / math.sqrt(_GOAL)
        cost = float((residuals**2).sum() + kept.sum()) + 1e6 * max(missed - _REACHED, 0.0)
        dwells = np.concatenate([kept, solution])
        poses = poses_at_flips(self._vehicle, Switches(first, dwells, self._switches.poses))
        return Switches(first, dwells, poses), cost

    def _residuals(self, last: Floats) -> Floats:
        return self._at(last)[0]

    def _slopes(self, last: Floats) -> Floats:
        return self._at(last)[1]

    def _at(self, last: Floats) -> tuple[Floats, Floats]:
        """Compute the residuals (3 + 2 K,), whose squares are times, and their derivatives."""
        key = last.tobytes()
        if key not in self._known:
            steps = np.concatenate([last[None], last + _STEP * np.eye(len(last))])
            poses = flips_after(self._vehicle, self._switches, self._kept, steps)
            beyond = np.maximum(self._distances(poses) - self._near, 0.0)
            parts = (math.sqrt(_GOAL) * (poses[:, -1] - self._goal), np.sqrt(steps), math.sqrt(_FAR) * beyond)
            values = np.concatenate(parts, 1)
            self._known = {key: (values[0], (values[1:] - values[0]).T / _STEP)}
        return self._known[key]

    def _distances(self, poses: Floats) -> Floats:
        """Compute distances (B, K) of the pivot from its track, at poses (B, K, 3) of the head's centre."""
        pivot = planar.compose(poses, np.array([-self._vehicle.pivot_distance, 0.0, 0.0]))[..., :2]
        return distance_to(self._track, pivot.reshape(-1, 2)).reshape(pivot.shape[:-1])


def flips_after(vehicle: Vehicle, switches: Switches, kept: int, last: Floats) -> Floats:
    """Predict the poses (B, K, 3) at the flips where dwells (B, K) follow the first `kept` ones of a schedule."""
    sense, changes = switches.first_direction * (-1) ** kept, np.empty((*last.shape, 3))
    before = np.concatenate([np.full((len(last), 1), switches.dwells[kept - 1]), last[:, :-1]], 1)
    for first, direction in enumerate((sense, -sense)):
        changes[:, first::2] = vehicle.motion(direction, before[:, first::2], last[:, first::2])
    if kept == 0:
        changes[:, 0] = vehicle.motion(sense, None, last[:, 0])
    heading = switches.poses[kept, 2] + np.cumsum(changes[..., 2], 1)
    moved = planar.turn(changes[..., :2], heading - changes[..., 2]) + vehicle.current * last[..., None]
    return np.concatenate([switches.poses[kept, :2] + np.cumsum(moved, 1), heading[..., None]], -1)
