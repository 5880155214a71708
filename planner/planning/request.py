"""All that a user asks of a plan, besides path and robot; and what the plan tells while it is made.

Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from planner.paths.obstacles import FreeSpace
from planner.paths.units import Swimmer
from planner.planning.camera import DOCUMENTED, Camera
from planner.vehicle.tracked_point import Point
from planner.vehicle.zigzag import QUICK, Objective
from sim.io.errors import InputError

Corner = Literal["nearest", "minimax", "fillet", "error"]
DECLARING = "finding the nearest path that can be followed"
REMEDY = "too tight: looking for a change that helps"
FOLLOWING = "following the path"
Progress = Callable[[float], object]  # called with a Share


@dataclass(frozen=True)
class PlanRequest:
    """Point, corners, dwells, tolerance, obstacles and time, as `softflagella.plan` explains them."""

    point: Point = "head_centre"
    corner: Corner = "nearest"
    time_weight: float = 0.0
    objective: Objective = "error"
    minimum_dwell: float | None = None
    minimum_seconds: float | None = None
    dwell: float | None = None
    tolerance: float | None = None
    seed: int = 0
    camera: Camera = DOCUMENTED
    space: FreeSpace = field(default_factory=FreeSpace)  # what the robot's body must keep clear of
    feedback: bool = False  # the pose will be measured: the margin around obstacles is the error with feedback
    arrive_seconds: float | None = None  # from start to end, or of a lap
    loop: bool = False  # the schedule repeats

    def __post_init__(self) -> None:
        if self.tolerance is not None and not (math.isfinite(self.tolerance) and self.tolerance > 0):
            raise InputError(f"tolerance {self.tolerance:g} l; give a number above 0")

    def least_dwell(self, robot: Swimmer) -> float | None:
        """Return the shortest dwell that the motor allows, in time units; None: the user gave none."""
        seconds, dwell = self.minimum_seconds, self.minimum_dwell
        if seconds is None:
            return dwell
        if not (math.isfinite(seconds) and seconds > 0):
            raise InputError(f"minimum dwell {seconds:g} s; give a number above 0")
        return max(seconds / robot.time_scale, QUICK if dwell is None else dwell)


class Share(float):
    """The share of the path that has been followed, with the stage of the plan and the share of the stage."""

    stage: str
    done: float


def tell(progress: Progress | None, stage: str, done: float) -> None:
    """Tell how far a stage is."""
    if progress is not None:
        share = Share(done if stage == FOLLOWING else 0.0)
        share.stage, share.done = stage, done
        progress(share)
