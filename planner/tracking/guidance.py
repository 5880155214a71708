"""The tracker's guidance: line of sight about a reference that changes with the drift that the tracker learns.

The reference of a plan holds the drift that the plan knows (`planner.paths.tractrix`). A robot that drifts
otherwise has another heading where its tracked point is on the path. The difference ε of the headings obeys, in
first order along the pivot's way σ,

    dε/dσ = −(ε + r)/a,   r = slip of the learned drift − slip of the plan's drift,

with a the distance from the pivot to the tracked point: on a straight line ε goes to −r, on a curve it lags
behind. The reference is turned by ε about the tracked point. `planner/c/guidance.h` does the same in C.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from planner.planning.line_of_sight import LineOfSight
from planner.planning.planned import Plan

SHORTEST_ROD = 1e-9  # l


class LearnedDrift(NamedTuple):
    """What moves the pivot besides its net speed along the heading, as shares of that speed."""

    sideways: float  # to the left of the heading
    x: float  # current in the lab
    y: float

    def slip(self, heading: float) -> float:
        """Compute the angle from a heading to the direction of motion."""
        c, s = math.cos(heading), math.sin(heading)
        return math.atan2(self.sideways - self.x * s + self.y * c, 1 + self.x * c + self.y * s)


class TrackerGuidance(LineOfSight):
    """Line of sight about the plan's reference, turned by the learned drift."""

    def __init__(self, plan: Plan):
        tracked, straight = plan.tracked, plan.straight
        super().__init__(plan.declared.reference, tracked.vehicle, plan.guidance, tracked.offset)
        x, y = (tracked.vehicle.current / straight.speed).tolist()
        self._planned = self._drift = LearnedDrift(straight.drift / straight.speed, x, y)

    def update_drift(self, drift: LearnedDrift) -> None:
        """Update the drift with what was learned."""
        self._drift = drift

    def integrate(self, pose: tuple[float, float, float], sense: int) -> None:
        """Add to the integral, and turn the reference as the drift asks after the way since the last flip."""
        before = self._reached
        super().integrate(pose, sense)
        way = max(self._reached - before, 0.0) / max(self._rod, SHORTEST_ROD)
        heading = self._heading[self.place]
        slip = self._drift.slip(heading + self._lean) - self._planned.slip(heading)
        self._lean = (self._lean + slip) / (1 + way + way * way / 2) - slip
