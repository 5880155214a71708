"""Straight motion: the motor flips so that each pair of dwells turns the robot as far to the left as to the right.

The shorter of the two dwells lasts T. The robot moves along a line, and its heading swings about a mean. Robots
whose two directions differ move at an angle to that mean: they drift sideways. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planner.vehicle.rollout import Switches, poses_at_flips, trace
from planner.vehicle.vehicle import Vehicle
from sim.arrays import Floats

_PAIRS = 8  # simulated with the vehicle; the last one is taken
_TRIES = 6


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
        return {
            "dwells_bar": list(self.dwells),
            "speed_bar": self.speed,
            "swing_rad": self.swing,
            "sway_over_l": self.sway,
            "drift_bar": self.drift,
            "rms_over_l": self.rms,
            "largest_over_l": self.largest,
        }

    @staticmethod
    def from_dict(content: Mapping[str, Any]) -> Zigzag:
        """Read the content that `to_dict` returns."""
        left, right = content["dwells_bar"]
        names = ("speed_bar", "swing_rad", "sway_over_l", "drift_bar", "rms_over_l", "largest_over_l")
        return Zigzag((float(left), float(right)), *(float(content[name]) for name in names))


def zigzag(vehicle: Vehicle, dwell: float, offset: float = 0.0) -> Zigzag:
    """Compute the zigzag of a vehicle with shortest dwell `dwell`, without the current."""
    still = replace(vehicle, current=np.zeros(2))
    fast = 0 if abs(vehicle.twist[0, 2]) >= abs(vehicle.twist[1, 2]) else 1
    ratio = abs(vehicle.twist[fast, 2] / vehicle.twist[1 - fast, 2])
    for _ in range(_TRIES):
        pair = [0.0, 0.0]
        pair[fast], pair[1 - fast] = dwell, dwell * ratio
        switches, poses = _repeated(still, pair)
        turn = float(poses[-1, 2] - poses[-3, 2])
        if abs(turn) < 1e-10:
            break
        sign = 1 if fast == 1 else -1  # the slower direction turns to this side
        ratio = max(ratio - sign * turn / (abs(vehicle.twist[1 - fast, 2]) * dwell), 1e-3)
    middle = float(poses[-1, 2] + poses[-2, 2]) / 2
    move = poses[-1, :2] - poses[-3, :2]
    duration = sum(pair)
    c, s = math.cos(middle), math.sin(middle)
    track = trace(still, switches, offset)[-17:-1]
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
    axis = np.stack([np.cos(poses[-3:, 2]), np.sin(poses[-3:, 2])], 1)
    pivot = poses[-3:, :2] - vehicle.pivot_distance * axis
    across = pivot @ np.array([-direction[1], direction[0]])
    return float(across[1] - (across[0] + across[2]) / 2) / 2


def _repeated(vehicle: Vehicle, pair: list[float]) -> tuple[Switches, Floats]:
    """Repeat a pair of dwells, and predict the poses at the flips."""
    switches = Switches(1, np.tile(pair, _PAIRS), np.zeros((1, 3)))
    return switches, poses_at_flips(vehicle, switches)
