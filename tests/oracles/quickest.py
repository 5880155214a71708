"""The quickest motion from rest to a pose by brute force, without obstacles: an oracle for `planner.goal.trip`.

The optimum: the sum of all dwells is minimised with the end pose as a constraint (SLSQP). It starts from every one
of Dubins' words, with short and long dwells on its straight segments, in both directions. The best is taken.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import minimize

from common.arrays import Floats
from planner.paths.dubins import TURNS, segment_lengths
from planner.vehicle.vehicle import Switches, Vehicle, flips_after
from planner.vehicle.zigzag import QUICK

_STEP = 1e-4
_LONGER = 1.6  # words longer than this, beside the shortest, are not tried
_DWELLS = (3.0, 6.0)  # on straight segments, time units


def brute_force(vehicle: Vehicle, goal: tuple[float, float, float]) -> float:
    """Find the least time from rest at the origin to the goal, over all starts of the optimisation."""
    a = vehicle.pivot_distance
    start = np.array([-a, 0.0, 0.0])
    end = np.array([goal[0] - a * np.cos(goal[2]), goal[1] - a * np.sin(goal[2]), goal[2]])
    radius = vehicle.pivot_radius
    pieces = segment_lengths(start, end, radius)
    length = pieces.sum(-1)
    best = np.inf
    for word, dwell in product(range(6), _DWELLS):
        if length[word] > _LONGER * length.min():
            continue
        turned = float((TURNS[word] * pieces[word]).sum() / radius)
        target = np.array([*goal[:2], turned])
        for first, dwells in _schedules(vehicle, TURNS[word], pieces[word], dwell):
            best = min(best, _optimum(vehicle, first, dwells, target))
    return best


def _schedules(vehicle: Vehicle, turns: Floats, pieces: Floats, dwell: float) -> list[tuple[int, Floats]]:
    """List dwells that carry out a word: arcs in one go, straight segments by zigzags of odd or even numbers."""
    schedules: list[tuple[int, list[float]]] = [(1, []), (-1, [])]
    speed = float(vehicle.twist[0, 0])
    for turn, piece in zip(turns.tolist(), pieces.tolist(), strict=True):
        if piece < 1e-9:
            continue
        longer = []
        for first, dwells in schedules:
            sense = first * (-1) ** len(dwells)
            if turn:
                lead = [] if sense == turn else [QUICK]
                longer.append((first, [*dwells, *lead, piece / speed]))
            else:
                count = max(1, round(piece / speed / dwell))
                longer += [(first, [*dwells, *(n * [piece / speed / n])]) for n in (count, count + 1)]
        schedules = longer
    return [(first, np.maximum(dwells, QUICK)) for first, dwells in schedules]


def _optimum(vehicle: Vehicle, first: int, dwells: Floats, target: Floats) -> float:
    """Minimise the sum of dwells whose motion ends at the target; infinite where none was found."""
    none = Switches(first, dwells, np.zeros((1, 3)))

    def end(x: Floats) -> Floats:
        return np.asarray(flips_after(vehicle, none, 0, x[None])[0, -1] - target)

    def slopes(x: Floats) -> Floats:
        moved = flips_after(vehicle, none, 0, np.concatenate([x[None], x + _STEP * np.eye(len(x))]))[:, -1]
        return np.asarray((moved[1:] - moved[0]).T / _STEP)

    scale = 100.0

    def cost(x: Floats) -> float:
        return float(x.sum()) / scale

    def even(x: Floats) -> Floats:
        return np.full(len(x), 1 / scale)

    bounds: Any = [(QUICK, np.inf)] * len(dwells)
    met: Any = {"type": "eq", "fun": end, "jac": slopes}
    options: Any = {"maxiter": 150, "ftol": 1e-6}
    result = minimize(cost, dwells, jac=even, bounds=bounds, constraints=met, method="SLSQP", options=options)
    return float(result.x.sum()) if np.abs(end(result.x)).max() < 1e-4 else np.inf
