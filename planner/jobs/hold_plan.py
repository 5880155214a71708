"""A plan that holds a place, and how it shows itself: text, picture, content of hold.json."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.paths.units import in_lab, place_in_lab
from planner.planning.lap import Lap
from planner.planning.planned import Plan
from sim.io.notebook import as_html
from sim.io.units import format_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT = 1


@dataclass(frozen=True, repr=False)
class HoldPlan:
    """An orbit about a place. Lengths in l, times in μ0 l⁴/EI.

    Example:
        >>> import softflagella as sf
        >>> held = sf.hold((2, 1), "paper-control", seconds=1800)
        >>> held.smallest < held.radius < 1.1 * held.smallest, held.laps
        (True, 6)
    """

    plan: Plan  # one lap of the orbit, which repeats
    place: tuple[float, float]  # that is held
    radius: float  # of the orbit of the tracked point
    reach: float  # largest distance of any part of the body from the place, on the orbit
    laps: int | None  # whole laps that take the time that was asked for, or more; None: until told otherwise

    @property
    def lap(self) -> Lap:
        """How well a lap closes."""
        assert self.plan.lap is not None
        return self.plan.lap

    @property
    def within(self) -> float:
        """Distance from the place within which the tracked point stays with feedback."""
        return self.radius + self.plan.feedback_error

    def within_open_loop(self, laps: int) -> float:
        """Return the distance within which the tracked point stays for some laps without feedback."""
        return self.radius + self.plan.stated_error + (laps - 1) * self.lap.drift

    @property
    def still_direction(self) -> int:
        """Direction of the motor in which the tracked point's circle is smaller."""
        left, right = self._radii()
        return 1 if left <= right else -1

    @property
    def smallest(self) -> float:
        """Radius of that circle: no schedule stays nearer."""
        return min(self._radii())

    @property
    def still_start(self) -> tuple[float, float, float]:
        """Pose at rest from which the robot circles about the place with its motor in `still_direction`."""
        forward, left, rate = self.plan.tracked.vehicle.twist[0 if self.still_direction > 0 else 1].tolist()
        x, y = self.place
        return x + left / rate, y - forward / rate, 0.0

    def _radii(self) -> list[float]:
        """Compute the radii of the tracked point's circles to the left and to the right."""
        offset = self.plan.tracked.offset
        twists = self.plan.tracked.vehicle.twist.tolist()
        return [math.hypot(forward, left + rate * offset) / abs(rate) for forward, left, rate in twists]

    def lines(self) -> list[str]:
        """Say how near the robot stays."""
        robot = self.plan.robot
        radius, smallest, within, reach = (
            in_lab(value, robot) for value in (self.radius, self.smallest, self.within, self.reach)
        )
        x, y, heading = self.still_start
        lap = format_time(self.plan.duration * robot.time_scale)
        lines = [
            f"orbit of radius {radius} about {place_in_lab(*self.place, robot)}, a lap in {lap}; with feedback "
            f"within {within}, the body within {reach}; no schedule stays nearer than {smallest}"
        ]
        if self.laps is not None:
            without = in_lab(self.within_open_loop(self.laps), robot)
            lines.append(f"{self.laps} laps; without feedback within {without} for so long")
        lines.append(
            f"without a camera, from {place_in_lab(x, y, robot)} with heading {math.degrees(heading):.0f} degrees "
            f"and the motor always at {self.still_direction:+d}: a circle of radius {smallest} about the place, "
            "which only a current moves"
        )
        return lines

    def __repr__(self) -> str:
        return "\n".join(["Hold a place", *(f"  {line}" for line in self.lines()), repr(self.plan)])

    def _repr_html_(self) -> str:
        return as_html(repr(self), self.plot)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the plan, the place, and what the body reaches, on axes in cm.

        Args:
            ax: default: axes of a new figure.
        """
        ax = self.plan.plot(ax)
        cm = 100 * self.plan.robot.tail_length
        x, y = cm * np.array(self.place)
        angle = np.linspace(0, 2 * math.pi, 200)
        reach = cm * self.reach
        ax.plot(x, y, "+", color="#c8452f", ms=8, label="place")
        ax.plot(x + reach * np.cos(angle), y + reach * np.sin(angle), ":", color="0.5", lw=1, label="body")
        return ax

    def to_dict(self) -> dict[str, Any]:
        """Return the content of hold.json. Lengths in l, times in seconds, angles in rad."""
        return {
            "format": FORMAT,
            "place": list(self.place),
            "radius_over_l": self.radius,
            "smallest_over_l": self.smallest,
            "within_over_l": self.within,
            "reach_over_l": self.reach,
            "lap_s": self.plan.duration * self.plan.robot.time_scale,
            "laps": self.laps,
            "within_open_loop_over_l": None if self.laps is None else self.within_open_loop(self.laps),
            "still_start": list(self.still_start),
            "still_direction": self.still_direction,
        }
