"""When a plan arrives: the duration that was asked for, and the swing that takes time.

Times in μ0 l⁴/EI, lengths in l.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from planner.paths.units import Swimmer, in_lab, place_in_lab
from sim.io.units import format_time


class Swing(NamedTuple):
    """A detour that takes time: waiting circles end where they begin, a swing ends further along the path."""

    x: float  # where the tracked point leaves the path
    y: float  # of that place
    longer: float  # by how much the pivot's track is longer
    circles: int  # waiting circles in it

    def line(self, robot: Swimmer) -> str:
        """Say in one sentence where the swing is."""
        place = place_in_lab(self.x, self.y, robot)
        what = {0: "a swing", 1: "a waiting circle"}.get(self.circles, f"{self.circles} waiting circles")
        return f"{what} at {place}, {in_lab(self.longer, robot)} more"


class Arrival(NamedTuple):
    """The duration that was asked for, and what it is compared with."""

    wished: float  # as it was asked for
    fastest: float  # duration of the fastest plan

    def line(self, duration: float, robot: Swimmer) -> str:
        """Say in one sentence how near the duration of a plan comes to the wish."""
        wished, missed, fastest = (
            format_time(time * robot.time_scale)
            for time in (self.wished, abs(duration - self.wished), self.fastest)
        )
        return f"arrives after {wished} as asked, to within {missed}; the fastest plan takes {fastest}"

    def to_dict(self, swing: Swing | None, robot: Swimmer) -> dict[str, Any]:
        """Return the content for plan.json."""
        scale = robot.time_scale
        return {
            "wished_s": self.wished * scale,
            "fastest_s": self.fastest * scale,
            "swing": None if swing is None else [swing.x, swing.y, swing.longer, swing.circles],
        }

    @staticmethod
    def from_dict(content: Mapping[str, Any], robot: Swimmer) -> tuple[Arrival, Swing | None]:
        """Read the content of a plan.json."""
        wished, fastest = (float(content[name]) / robot.time_scale for name in ("wished_s", "fastest_s"))
        swing = None
        if content["swing"] is not None:
            x, y, longer, circles = content["swing"]
            swing = Swing(float(x), float(y), float(longer), int(circles))
        return Arrival(wished, fastest), swing
