"""The camera whose poses a tracker gets. Lengths in l, angles in rad."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.io.errors import InputError
from sim.mechanics import planar

POSE = tuple[float, float, float]
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
        for name, values, low, high, allowed in (
            ("noise", self.noise, 0.0, math.inf, "numbers above 0"),
            ("every_s", (self.every_s,), 0.0, math.inf, "a number above 0"),
            ("delay_s", (self.delay_s,), -1e-300, math.inf, "0 or more"),
            ("lost", (self.lost,), -1e-300, 1 + 1e-12, "0 to 1"),
            ("wrong", (self.wrong,), -1e-300, 1 + 1e-12, "0 to 1"),
        ):
            if not all(low < value < high for value in values):
                raise InputError(f"camera: {name} is {getattr(self, name)}; give {allowed}")

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
