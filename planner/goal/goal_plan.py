"""A plan from a pose to a pose, and how it shows itself: text, picture, table, content of goal.json."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from planner.paths.obstacles import Footprint, FreeSpace
from planner.paths.units import heading_in_degrees, in_lab, place_in_lab
from planner.planning.planned import Plan
from sim.io.notebook import as_html

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

FORMAT = 1
Pose = tuple[float, float, float]


@dataclass(frozen=True, repr=False)
class GoalPlan:
    """A plan from a pose to a pose. Lengths in l, angles in rad.

    Poses are x, y and heading of the head's centre.

    Example:
        >>> from softflagella import load_robot, to_goal
        >>> trip = to_goal((0, 0, 0), (3, 1, 1), load_robot("paper-control"))
        >>> trip.end_error[0] < 0.01
        True
    """

    plan: Plan  # the schedule on the way
    goal: Pose  # as asked for
    end: Pose  # predicted
    via: tuple[tuple[float, float], ...]  # places x, y that the pivot passes
    free_space: FreeSpace  # walls and regions
    length: float  # of the pivot's track
    margin: float  # kept around the body on the declared path; 0 without obstacles
    clearance: float  # smallest, of the body on the predicted track; infinite without obstacles

    @property
    def end_error(self) -> tuple[float, float]:
        """Predicted distance from the goal, and difference of the heading."""
        turn = (self.end[2] - self.goal[2] + math.pi) % (2 * math.pi) - math.pi
        return math.dist(self.end[:2], self.goal[:2]), abs(turn)

    def lines(self) -> list[str]:
        """Say where the way ends, and what it keeps clear of."""
        robot, (off, turned), (x, y, heading) = self.plan.robot, self.end_error, self.end
        lines = [
            f"end: {place_in_lab(x, y, robot)}, heading {heading_in_degrees(heading)}; "
            f"from the goal {in_lab(off, robot)} and {math.degrees(turned):.1g} degrees as predicted"
        ]
        if not self.free_space.empty:
            margin, clearance = (in_lab(value, robot) for value in (self.margin, self.clearance))
            lines.append(f"margin {margin} around the body; predicted clearance {clearance}")
        return lines

    def __repr__(self) -> str:
        robot, (off, turned) = self.plan.robot, self.end_error
        lines = [
            f"Goal plan: way of {in_lab(self.length, robot)}; ends {in_lab(off, robot)} and "
            f"{math.degrees(turned):.2g} degrees from the goal, as predicted"
        ]
        if not self.free_space.empty:
            lines.append(f"  margin {in_lab(self.margin, robot)}, clearance {in_lab(self.clearance, robot)}")
        return "\n".join([*lines, repr(self.plan)])

    def _repr_html_(self) -> str:
        return as_html(repr(self), self.plot)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the plan, start and goal, and what the robot must keep out of, on axes in cm.

        Args:
            ax: default: axes of a new figure.
        """
        from planner.goal.picture import draw_places  # loads matplotlib
        from planner.planning.picture import draw_regions

        ax = self.plan.plot(ax)
        length = self.plan.robot.tail_length
        draw_regions(ax, self.free_space, length)
        draw_places(ax, Footprint.of(self.plan.robot, 0.0), (self.plan.start, self.goal), self.via, length)
        return ax

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the dwells, see `Plan.to_frame`."""
        return self.plan.to_frame()

    def to_dict(self) -> dict[str, Any]:
        """Return the content of goal.json: what was asked for, what is predicted. Lengths in l, angles in rad."""
        finite = self.clearance if self.clearance < float("inf") else None
        return {
            "format": FORMAT,
            "start": self.plan.start,
            "goal": self.goal,
            "via": self.via,
            **self.free_space.to_dict(),
            "predicted_end": self.end,
            "end_error_over_l": self.end_error[0],
            "end_error_rad": self.end_error[1],
            "length_over_l": self.length,
            "margin_over_l": self.margin,
            "predicted_clearance_over_l": finite,
        }
