"""What a plan keeps to besides its path: free space and ways around, laps.

A lap has an even number of dwells, so each begins in the same direction of the motor. Lengths in l, angles in rad,
times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from common.errors import InputError
from planner.paths.obstacles import FreeSpace
from planner.paths.units import Scales, in_lab, place_in_lab

_SHOWN = 1e-5  # l and rad; smaller differences are rounding
_DETOUR = ("leaves", "joins", "length_over_l", "replaced_over_l", "farthest_over_l")  # in plan.json
_LAP = ("closes_over_l", "closes_rad", "drift_over_l", "drift_rad")
OVERLAP = 10.0  # radii of the pivot's circle, of the next lap that a tracker sees


class BlockedError(InputError):
    """There is no way around what stands on the path; `hopeless`: not even without a margin."""

    hopeless = False


class Detour(NamedTuple):
    """A way around an obstacle: places and lengths of the tracked point's way."""

    leaves: tuple[float, float]  # x, y where it leaves the path
    joins: tuple[float, float]  # x, y where it joins the path again
    length: float  # between the two
    replaced: float  # of the part of the path that is not followed
    farthest: float  # largest distance of the tracked point from the path

    def line(self, robot: Scales) -> str:
        """Say in one sentence where the way around leaves the path and joins it again."""
        leaves, joins = (place_in_lab(*place, robot) for place in (self.leaves, self.joins))
        return (
            f"the path is blocked: the way around leaves it at {leaves} and joins it at {joins}, "
            f"{in_lab(self.length, robot)} instead of {in_lab(self.replaced, robot)}, up to "
            f"{in_lab(self.farthest, robot)} away from it"
        )


@dataclass(frozen=True)
class KeptClear:
    """How a plan keeps clear of walls and regions."""

    free_space: FreeSpace  # walls and regions
    margin: float  # kept around the body on the declared path; at least the stated error
    clearance: float  # smallest, of the body on the predicted track
    detours: tuple[Detour, ...]  # in the order of the path

    def lines(self, robot: Scales, error: str) -> list[str]:
        """Say how the plan keeps clear, a sentence for each detour and one for the margin.

        Args:
            error: that the margin covers, in words.
        """
        margin, clearance = (in_lab(value, robot) for value in (self.margin, self.clearance))
        last = (
            f"a margin of {margin} around the body covers the {error}, so within that it touches nothing; as "
            f"predicted it passes at a distance of {clearance}"
        )
        return [*(detour.line(robot) for detour in self.detours), last]

    def to_dict(self) -> dict[str, Any]:
        """Return the content for plan.json."""
        return {
            **self.free_space.to_dict(),
            "margin_over_l": self.margin,
            "predicted_clearance_over_l": self.clearance,
            "detours": [dict(zip(_DETOUR, detour, strict=True)) for detour in self.detours],
        }

    @staticmethod
    def from_dict(content: Mapping[str, Any]) -> KeptClear:
        """Read the content of a plan.json."""
        detours = []
        for row in content["detours"]:
            leaves, joins, *lengths = (row[name] for name in _DETOUR)
            (x, y), (join_x, join_y) = leaves, joins
            detours.append(Detour((float(x), float(y)), (float(join_x), float(join_y)), *map(float, lengths)))
        margin, clearance = float(content["margin_over_l"]), float(content["predicted_clearance_over_l"])
        return KeptClear(FreeSpace.from_dict(content), margin, clearance, tuple(detours))


class Lap(NamedTuple):
    """What a lap leaves behind: differences of the pose from that a lap before."""

    closes: float  # distance, as predicted
    closes_turn: float  # angle, as predicted
    drift: float  # distance that 95 % of the robots keep to that the model's uncertainty allows, open loop
    drift_turn: float  # angle of the same robots

    def line(self, robot: Scales) -> str:
        """Say in one sentence how well the laps repeat."""
        closes, drift = in_lab(max(self.closes, _SHOWN), robot), in_lab(self.drift, robot)
        turned, drift_turn = (math.degrees(angle) for angle in (max(self.closes_turn, _SHOWN), self.drift_turn))
        return (
            f"repeat it: a lap ends where it began, to within {closes} and {turned:.1g} degrees as predicted; "
            f"95 % of robots drift by up to {drift} and {drift_turn:.2g} degrees a lap without feedback"
        )

    def to_dict(self) -> dict[str, float]:
        """Return the content for plan.json."""
        return dict(zip(_LAP, self, strict=True))

    @staticmethod
    def from_dict(content: Mapping[str, Any]) -> Lap:
        """Read the content of a plan.json."""
        return Lap(*(float(content[name]) for name in _LAP))
