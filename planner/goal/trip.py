"""The job to lead from a pose to a pose: words, picture, content of goal.json. Lengths in l, angles in rad."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.paths.obstacles import Footprint, FreeSpace
from planner.paths.units import heading_in_degrees, in_lab, place_in_lab
from planner.planning.camera import POSE
from planner.planning.picture import BODY, REPLAYED
from planner.planning.planned import Job, Plan

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT = 1


@dataclass(frozen=True)
class Trip(Job):
    """The way from a pose to a pose; poses are x, y and heading of the head's centre.

    Example:
        >>> from softflagella import load_robot, to_goal
        >>> plan = to_goal((0, 0, 0), (3, 1, 1), load_robot("paper-control"))
        >>> plan.job.end_error[0] < 0.01
        True
    """

    goal: POSE  # as asked for
    end: POSE  # predicted
    via: tuple[tuple[float, float], ...]  # places x, y that the pivot passes
    length: float  # of the pivot's track

    kind = "goal"

    @property
    def ends_at(self) -> POSE:
        return self.goal

    @property
    def end_error(self) -> tuple[float, float]:
        """Predicted distance from the goal, and difference of the heading."""
        turn = (self.end[2] - self.goal[2] + math.pi) % (2 * math.pi) - math.pi
        return math.dist(self.end[:2], self.goal[:2]), abs(turn)

    def lines(self, plan: Plan) -> list[str]:
        """Say how long the way is, and where it ends."""
        robot, (off, turned), (x, y, heading) = plan.robot, self.end_error, self.end
        return [
            f"predicted end: {place_in_lab(x, y, robot)}, heading {heading_in_degrees(heading)}; "
            f"from the goal {in_lab(off, robot)} and {math.degrees(turned):.1g} degrees; "
            f"way of {in_lab(self.length, robot)}"
        ]

    def title(self, plan: Plan) -> str:
        """Name the length of the way."""
        return f"way {in_lab(self.length, plan.robot)}, {super().title(plan)}"

    def draw(self, axes: Axes, plan: Plan) -> None:
        """Draw the robot's axis at start and goal, and the places on its way."""
        cm, body = 100 * plan.robot.tail_length, Footprint.of(plan.robot, 0.0)
        axis = cm * np.array([body.places.min() - body.radius, body.places.max() + body.radius])
        for x, y, heading in (plan.start, self.goal):
            along = np.array([[math.cos(heading)], [math.sin(heading)]])
            axes.plot(*(np.array([[cm * x], [cm * y]]) + along * axis), color=BODY, lw=4, alpha=0.6)
            axes.plot(cm * x, cm * y, "o", color=BODY, ms=5)
        for x, y in self.via:
            axes.plot(cm * x, cm * y, "+", color=REPLAYED, ms=10)
        axes.autoscale_view()

    def to_dict(self, plan: Plan) -> dict[str, Any]:
        """Return the content of goal.json: what was asked for, what is predicted."""
        kept = plan.kept_clear
        return {
            "format": FORMAT,
            "start": plan.start,
            "goal": self.goal,
            "via": self.via,
            **(FreeSpace() if kept is None else kept.free_space).to_dict(),
            "predicted_end": self.end,
            "end_error_over_l": self.end_error[0],
            "end_error_rad": self.end_error[1],
            "length_over_l": self.length,
            "margin_over_l": 0.0 if kept is None else kept.margin,
            "predicted_clearance_over_l": None if kept is None else kept.clearance,
        }
