"""All that a user asks of a plan, besides path and robot.

Lengths in l, times in μ0 l⁴/EI, angles in rad.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from common.errors import InputError
from planner.paths.obstacles import FreeSpace
from planner.paths.units import Scales
from planner.vehicle.tracked_point import Point
from planner.vehicle.zigzag import QUICK, Objective
from sim.mechanics import planar
from sim.mechanics.planar import POSE

Corner = Literal["nearest", "minimax", "fillet", "error"]
_ANYWHERE = (5.0, 5.0, 2.0)  # standard deviations of wrong poses


@dataclass(frozen=True)
class Camera:
    """A camera that measures the pose of a robot's marker at equal times.

    Raises:
        InputError: a number is not possible.

    Example:
        >>> from softflagella import Camera
        >>> Camera(every_s=0.5, lost=0).noise
        (0.01, 0.01)
    """

    noise: tuple[float, float] = (0.01, 0.01)  # standard deviations: of x and y [l], of the heading [rad]
    every_s: float = 1.0  # time between two poses [s]
    delay_s: float = 2.0  # age of a pose when it comes in [s]
    lost: float = 0.2  # share of the poses that never come in
    wrong: float = 0.0  # share of the others that lie anywhere
    marker: POSE = (0.0, 0.0, 0.0)  # on the robot: forward and left of the head's centre [l], its angle [rad]
    seed: int | np.random.Generator = 0  # of the random numbers, or their generator

    def __post_init__(self) -> None:
        for name, shape, low, high, allowed in (
            ("noise", (2,), 0.0, math.inf, "two numbers above 0"),
            ("every_s", (), 0.0, math.inf, "a number above 0"),
            ("delay_s", (), -1e-300, math.inf, "0 or more"),
            ("lost", (), -1e-300, 1 + 1e-12, "0 to 1"),
            ("wrong", (), -1e-300, 1 + 1e-12, "0 to 1"),
        ):
            values = np.array(getattr(self, name), dtype=object)
            if values.shape != shape or not all(
                isinstance(v, int | float | np.number) and low < v < high for v in values.flat
            ):
                raise InputError(f"camera: {name} is {getattr(self, name)!r}; give {allowed}")

    def to_dict(self) -> dict[str, Any]:
        """Return what the stated error depends on, for plan.json."""
        return {"noise": list(self.noise), "every_s": self.every_s, "delay_s": self.delay_s, "lost": self.lost}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Camera:
        """Read what `to_dict` has written."""
        place, heading = (float(value) for value in content["noise"])
        every_s, delay_s, lost = (float(content[name]) for name in ("every_s", "delay_s", "lost"))
        return cls((place, heading), every_s, delay_s, lost)

    def sees(self, pose: POSE, time: float, rng: np.random.Generator) -> POSE | None:
        """Return what is measured of a robot at `pose` at a time; None where the pose gets lost."""
        if rng.random() < self.lost:
            return None
        if rng.random() < self.wrong:
            x, y, heading = (rng.normal(size=3) * _ANYWHERE).tolist()
        else:
            noise = rng.normal(size=3) * [self.noise[0], self.noise[0], self.noise[1]]
            x, y, heading = (planar.compose(np.array(pose), np.array(self.marker)) + noise).tolist()
        return x, y, math.remainder(heading, 2 * math.pi)


DOCUMENTED = Camera()  # the camera of the stated error with feedback, unless another one is given


@dataclass(frozen=True)
class PlanRequest:
    """Point, corners, dwells, tolerance and obstacles, as `softflagella.plan` explains them."""

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
    loop: bool = False  # the schedule repeats

    def __post_init__(self) -> None:
        if self.tolerance is not None and not (math.isfinite(self.tolerance) and self.tolerance > 0):
            raise InputError(f"tolerance {self.tolerance:g} l; give a number above 0")

    def least_dwell(self, robot: Scales) -> float | None:
        """Return the shortest dwell that the motor allows, in time units; None: the user gave none."""
        seconds, dwell = self.minimum_seconds, self.minimum_dwell
        if seconds is None:
            return dwell
        if not (math.isfinite(seconds) and seconds > 0):
            raise InputError(f"minimum dwell {seconds:g} s; give a number above 0")
        return max(seconds / robot.time_scale, QUICK if dwell is None else dwell)
