"""Straight motion, and the shortest dwell that suits the user's objective: time, error or number of flips.

The motor flips so that each pair of dwells turns the robot as far to the left as to the right; the shorter of the
two lasts T. The robot moves along a line, and its heading swings about a mean. Robots whose two directions differ
move at an angle to that mean: they drift sideways.

A longer dwell loses less speed to the turn-over of the tails, and swings further. So one number decides between
speed and error. All figures here are of straight motion; the plan's own errors are checked against the tolerance
afterwards, and for "time" the path itself is followed with several dwells (`planner.planning.solve`). Lengths in
l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from planner.paths.path import axis_at
from planner.vehicle.vehicle import SHORTEST, Switches, Vehicle, roll_out
from sim.mechanics import planar

_PAIRS = 8  # simulated with the vehicle; the last one is taken
_TRIES = 6
Objective = Literal["error", "time", "flips"]
QUICK = 0.3  # below this, the last two dwells matter, not only the last one
LONGEST = 4.0
KEPT = {"error": 0.90, "flips": 0.95}  # share of the best net speed that is kept
_NEARLY = 0.97  # share of the best net speed with which a path may be followed in less time
_COMPARED = 10  # such dwells
_WIDEST = 0.6  # rad that the heading swings to a side
_COUNT = 100
_LONGER = 1.3  # from one longer dwell to the next
_SAVED = ("speed_bar", "swing_rad", "sway_over_l", "drift_bar", "rms_over_l", "largest_over_l")  # in plan.json


@dataclass(frozen=True)
class Zigzag:
    """Straight motion with a shortest dwell T."""

    dwells: tuple[float, float]  # in the positive and in the negative direction
    speed: float  # net, along the heading's middle
    swing: float  # of the heading, to and fro
    sway: float  # of the pivot: from its mean line to where it is when the motor stops turning left
    drift: float  # net, to the left of the heading's middle
    rms: float  # distance of the tracked point from its mean line
    largest: float  # largest distance from the line

    def hysteresis(self, ahead: float) -> float:
        """Compute 2 h, the swing of the heading past the line of sight, with look-ahead `ahead`."""
        return max(self.swing + 2 * math.atan(self.sway / ahead), 0.2 * self.swing)

    @property
    def net_speed(self) -> float:
        return math.hypot(self.speed, self.drift)

    def to_dict(self) -> dict[str, Any]:
        """Return the content for plan.json."""
        dwells, *numbers = vars(self).values()
        return {"dwells_bar": list(dwells), **dict(zip(_SAVED, numbers, strict=True))}

    @staticmethod
    def from_dict(content: Mapping[str, Any]) -> Zigzag:
        """Read the content that `to_dict` returns."""
        left, right = content["dwells_bar"]
        return Zigzag((float(left), float(right)), *(float(content[name]) for name in _SAVED))


def zigzag(vehicle: Vehicle, dwell: float, offset: float = 0.0) -> Zigzag:
    """Compute the zigzag of a vehicle with shortest dwell `dwell`, without the current."""
    still = replace(vehicle, current=np.zeros(2))
    fast = 0 if abs(vehicle.twist[0, 2]) >= abs(vehicle.twist[1, 2]) else 1
    ratio = abs(vehicle.twist[fast, 2] / vehicle.twist[1 - fast, 2])
    for _ in range(_TRIES):
        pair = [0.0, 0.0]
        pair[fast], pair[1 - fast] = dwell, dwell * ratio
        rollout = roll_out(still, Switches(1, np.tile(pair, _PAIRS), np.zeros((1, 3))), offset)
        poses = rollout.flips
        turn = float(poses[-1, 2] - poses[-3, 2])
        if abs(turn) < 1e-10:
            break
        sign = 1 if fast == 1 else -1  # the slower direction turns to this side
        ratio = max(ratio - sign * turn / (abs(vehicle.twist[1 - fast, 2]) * dwell), 1e-3)
    middle = float(poses[-1, 2] + poses[-2, 2]) / 2
    move = poses[-1, :2] - poses[-3, :2]
    duration = sum(pair)
    c, s = math.cos(middle), math.sin(middle)
    track = rollout.track[-17:-1]
    length = max(float(np.hypot(*move)), 1e-300)
    across = (track - track.mean(0)) @ (np.array([-move[1], move[0]]) / length)
    return Zigzag(
        dwells=(float(pair[0]), float(pair[1])),
        speed=float(c * move[0] + s * move[1]) / duration,
        swing=abs(float(poses[-1, 2] - poses[-2, 2])),
        sway=_sway(vehicle, poses, move / length),
        drift=float(c * move[1] - s * move[0]) / duration,
        rms=float(across.std()),
        largest=float(np.abs(across).max()),
    )


def _sway(vehicle: Vehicle, poses: Floats, direction: Floats) -> float:
    """Compute half of the distance between the pivot at flips to the right and at flips to the left."""
    axis = axis_at(poses[-3:, 2])
    pivot = poses[-3:, :2] - vehicle.pivot_distance * axis
    across = pivot @ np.array([-direction[1], direction[0]])
    return float(across[1] - (across[0] + across[2]) / 2) / 2


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
