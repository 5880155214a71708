"""A schedule that repeats: how well a lap closes, and how far robots drift in a lap.

A lap has an even number of dwells, so each begins in the same direction of the motor. Lengths in l, angles in rad.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from planner.draws import normals
from planner.paths.units import Swimmer, in_lab
from planner.planning.error_growth import error_growth
from planner.planning.stated_error import LEVEL, flips_between
from planner.vehicle.rollout import Switches, roll_out
from planner.vehicle.tracked_point import TrackedVehicle

_DRAWS = 1000
_SHOWN = 1e-5  # l and rad; smaller differences are rounding
OVERLAP = 10.0  # radii of the pivot's circle, of the next lap that a tracker sees


class Lap(NamedTuple):
    """What a lap leaves behind: differences of the pose from that a lap before."""

    closes: float  # distance, as predicted
    closes_turn: float  # angle, as predicted
    drift: float  # distance that 95 % of the robots keep to that the model's uncertainty allows, open loop
    drift_turn: float  # angle of the same robots

    def line(self, robot: Swimmer) -> str:
        """Say in one sentence how well the laps repeat."""
        closes, drift = in_lab(max(self.closes, _SHOWN), robot), in_lab(self.drift, robot)
        turned, drift_turn = (math.degrees(angle) for angle in (max(self.closes_turn, _SHOWN), self.drift_turn))
        return (
            f"repeat it: a lap ends where it began, to within {closes} and {turned:.1g} degrees as predicted; "
            f"95 % of robots drift by up to {drift} and {drift_turn:.2g} degrees a lap without feedback"
        )

    def to_dict(self) -> dict[str, float]:
        """Return the content for plan.json."""
        return {
            "closes_over_l": self.closes,
            "closes_rad": self.closes_turn,
            "drift_over_l": self.drift,
            "drift_rad": self.drift_turn,
        }

    @staticmethod
    def from_dict(content: Mapping[str, Any]) -> Lap:
        """Read the content of a plan.json."""
        names = ("closes_over_l", "closes_rad", "drift_over_l", "drift_rad")
        return Lap(*(float(content[name]) for name in names))


def drift_of_a_lap(tracked: TrackedVehicle, switches: Switches, seed: int) -> tuple[float, float]:
    """Compute the quantiles LEVEL of how far robots are from the vehicle after a lap, and of their turn."""
    rollout = roll_out(tracked.vehicle, switches, tracked.offset)
    growth = error_growth(tracked.vehicle, switches, rollout, flips_between(len(switches.dwells)))
    modes = growth.deviation.shape[1]
    drawn = normals(seed, 0, _DRAWS * modes).reshape(_DRAWS, modes)
    moved, turned = drawn @ growth.deviation[-1], drawn @ growth.turned[-1]
    return float(np.quantile(np.hypot(*moved.T), LEVEL)), float(np.quantile(np.abs(turned), LEVEL))
