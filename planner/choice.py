"""The shortest dwell is chosen from what the user asks: time, error, or few flips.

A longer dwell loses less speed to the turn-over of the tails, and swings further. So one number decides between
speed and error. All figures here are of straight motion (`planner.zigzag`); the plan's own errors are checked
against the tolerance afterwards. Times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from typing import Literal, get_args

import numpy as np

from planner.vehicle import SHORTEST, Vehicle
from planner.zigzag import zigzag
from sim.io.errors import InputError

Objective = Literal["error", "time", "flips"]
QUICK = 0.3  # below this, two dwells before matter as well
LONGEST = 4.0
KEPT = {"error": 0.92, "flips": 0.95}  # share of the best net speed that is kept
_WIDEST = 0.6  # rad that the heading swings to a side
_COUNT = 16


def dwells_for(vehicle: Vehicle, objective: Objective, least: float | None, offset: float) -> list[float]:
    """Dwells in the order of preference: the first one for itself, the others where a tolerance asks for less error.

    Args:
        vehicle: both directions.
        objective: "error": the shortest dwell that costs at most 8 % of the speed, then shorter ones; "time": the
            fastest, then shorter ones; "flips": the longest that costs at most 5 % of the speed, then shorter ones.
        least: the shortest dwell that the motor or the user allows; None: QUICK.
        offset: of the tracked point.

    Raises:
        InputError: an unknown objective, or a dwell that the table does not cover.
    """
    if objective not in get_args(Objective):
        raise InputError(f"objective {objective!r}; allowed are {', '.join(get_args(Objective))}")
    least = check_least(least)
    rate = float(np.abs(vehicle.twist[:, 2]).max())
    most = max(least, min(LONGEST, 2 * _WIDEST / rate))
    grid = np.geomspace(least, most, _COUNT) if most > least else np.array([least])
    speed = np.array([zigzag(vehicle, float(T), offset).net_speed for T in grid])
    good = speed >= KEPT.get(objective, 1.0) * speed.max()
    first = int(np.flatnonzero(good)[-1 if objective == "flips" else 0])
    return grid[: first + 1][::-1].tolist()


def check_least(least: float | None) -> float:
    """The shortest dwell that is allowed.

    Raises:
        InputError: below what the curves of the response cover.
    """
    if least is None:
        return QUICK
    if not math.isfinite(least) or least < SHORTEST:
        raise InputError(
            f"minimum dwell {least:g} is below {SHORTEST:g} time units; for shorter dwells the response of the tails "
            f"is not known: give at least {SHORTEST:g}"
        )
    return least
