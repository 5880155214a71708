"""What a plan keeps clear of: the free space, the margin around the body, and the ways around. Lengths in l."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from planner.paths.obstacles import FreeSpace
from planner.paths.units import Swimmer, in_lab, place_in_lab
from sim.io.errors import InputError


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

    def line(self, robot: Swimmer) -> str:
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

    def lines(self, robot: Swimmer) -> list[str]:
        """Say how the plan keeps clear, a sentence for each detour and one for the margin."""
        margin, clearance = (in_lab(value, robot) for value in (self.margin, self.clearance))
        last = f"margin {margin} around the body; predicted clearance {clearance}"
        return [*(detour.line(robot) for detour in self.detours), last]

    def to_dict(self) -> dict[str, Any]:
        """Return the content for plan.json."""
        return {
            **self.free_space.to_dict(),
            "margin_over_l": self.margin,
            "predicted_clearance_over_l": self.clearance,
            "detours": [
                {
                    "leaves": detour.leaves,
                    "joins": detour.joins,
                    "length_over_l": detour.length,
                    "replaced_over_l": detour.replaced,
                    "farthest_over_l": detour.farthest,
                }
                for detour in self.detours
            ],
        }
