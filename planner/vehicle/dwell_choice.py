"""Choose the minimum dwell for the user's objective: time, error or number of flips.

A longer dwell loses less speed to the turn-over of the tails, and swings further. So one number decides between
speed and error. All figures here are of straight motion; the plan's own errors are checked
against the tolerance afterwards, and for "time" the path itself is followed with several dwells
(`planner.planning.solve`). Times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from typing import Literal, get_args

import numpy as np

from planner.vehicle.vehicle import SHORTEST, Vehicle
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.mechanics import planar

Objective = Literal["error", "time", "flips"]
QUICK = 0.3  # below this, the last two dwells matter, not only the last one
LONGEST = 4.0
KEPT = {"error": 0.90, "flips": 0.95}  # share of the best net speed that is kept
_NEARLY = 0.97  # share of the best net speed with which a path may be followed in less time
_COMPARED = 10  # such dwells
_WIDEST = 0.6  # rad that the heading swings to a side
_COUNT = 100
_LONGER = 1.3  # from one longer dwell to the next


def dwells_for(vehicle: Vehicle, objective: Objective, least: float | None) -> list[float]:
    """List dwells in order of preference: the best one, then shorter ones for a tolerance that asks for less.

    Args:
        vehicle: both directions.
        objective: "error": the shortest dwell that costs at most 10 % of the speed, then shorter ones (see
            `longer_dwells`, too); "time": the fastest, then shorter ones; "flips": the longest that costs at most
            5 % of the speed, then shorter ones.
        least: the shortest dwell that the motor or the user allows; None: QUICK.

    Raises:
        InputError: an unknown objective, or a dwell that the table does not cover.
    """
    if objective not in get_args(Objective):
        raise InputError(f"objective {objective!r}; allowed are {', '.join(get_args(Objective))}")
    least = check_least(least)
    most = longest_dwell(vehicle, least)
    if most == least:
        return [least]
    grid = np.geomspace(least, most, _COUNT)
    speed = net_speeds(vehicle, grid)
    good = np.flatnonzero(speed >= KEPT.get(objective, 1.0) * speed.max())
    first = int(good[-1 if objective == "flips" else 0])
    shorter = np.geomspace(least, grid[first], max(2, math.ceil(8 * math.log2(grid[first] / least)) + 1))
    return shorter[::-1].tolist() if first else [least]


def nearly_fastest(vehicle: Vehicle, least: float | None) -> list[float]:
    """List dwells with which straight motion is nearly as fast as with the fastest, longest first.

    On a path another one may be the fastest: corners and the end take whole dwells.
    """
    least = check_least(least)
    grid = np.geomspace(least, longest_dwell(vehicle, least), _COUNT)
    speed = net_speeds(vehicle, grid)
    good = grid[speed >= _NEARLY * speed.max()]
    return np.geomspace(good[-1], good[0], _COMPARED).tolist()


def longer_dwells(vehicle: Vehicle, dwell: float) -> list[float]:
    """List longer dwells, up to the longest that is considered. With fewer flips their errors add up to less."""
    most = longest_dwell(vehicle, dwell)
    count = math.floor(math.log(most / dwell) / math.log(_LONGER))
    return [dwell * _LONGER**k for k in range(1, count + 1)]


def longest_dwell(vehicle: Vehicle, least: float) -> float:
    """Return the longest dwell that is considered; not below `least`."""
    return max(least, min(LONGEST, 2 * _WIDEST / float(np.abs(vehicle.twist[:, 2]).max())))


def net_speeds(vehicle: Vehicle, dwells: Floats) -> Floats:
    """Compute net speeds (T,) of straight motion with shortest dwells (T,), as in `zigzag`; no current."""
    rates = np.abs(vehicle.twist[:, 2])
    positive, negative = dwells * rates.max() / rates[0], dwells * rates.max() / rates[1]
    move = planar.compose(vehicle.motion(1, negative, positive), vehicle.motion(-1, positive, negative))
    return np.asarray(np.hypot(move[:, 0], move[:, 1]) / (positive + negative))


def check_least(least: float | None) -> float:
    """Return the shortest dwell that is allowed.

    Raises:
        InputError: below what the curves of the response cover.
    """
    if least is None:
        return QUICK
    if not math.isfinite(least) or least < SHORTEST:
        raise InputError(
            f"minimum dwell {least:g} is below {SHORTEST:g} time units; for shorter dwells the response of the "
            f"tails is not known: give at least {SHORTEST:g}"
        )
    return least
