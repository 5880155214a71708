"""One input of a robot that is swept through a range, while all other dimensionless groups keep their values.

`speed` is the motor's in rpm. All others are dimensionless: the groups of `sim.model.sweepable.SLOPE_INPUTS` and
the sizes of effects.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.effects import catalogue
from sim.inputs import check_columns
from sim.io.errors import InputError
from sim.model.body import Body
from sim.model.groups import Groups
from sim.model.robot import Robot
from sim.model.sweepable import SLOPE_INPUTS
from sim.motion.lab_units import RPM
from sim.solve.assembly import bodies

SPEED = "speed"


@dataclass(frozen=True)
class SweptInput:
    """A robot and the range of one of its inputs.

    Raises:
        InputError: an unknown input, or a range in which there are robots that cannot be simulated.
    """

    robot: Robot
    name: str  # SPEED, one of SLOPE_INPUTS, or an effect
    low: float
    high: float

    def __post_init__(self) -> None:
        if self.name != SPEED and self.name not in SLOPE_INPUTS and self.name not in catalogue():
            allowed = ", ".join((SPEED, *SLOPE_INPUTS, *catalogue()))
            raise InputError(f"no input {self.name!r} to sweep; there are {allowed}")
        ends = f"{self.low:g}:{self.high:g}"
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise InputError(f"the range {ends} of {self.name}; give two numbers, the lower one first")
        if self.name in (SPEED, "omega_bar") and self.low <= 0:
            raise InputError(f"the range {ends} of {self.name}; it must be above 0, for the motor must turn")
        columns = [self._columns(value) for value in (self.low, self.high)]
        check_columns({name: np.array([end[name] for end in columns]) for name in columns[0]})

    @property
    def column(self) -> str:
        """Name of the input in a table, with its unit."""
        return "speed_rpm" if self.name == SPEED else self.name

    @property
    def label(self) -> str:
        """Name of the input on an axis."""
        return "motor speed [rpm]" if self.name == SPEED else self.name

    def value(self, s: float) -> float:
        """Return the input at a place s of the range, from 0 to 1."""
        return self.low + s * (self.high - self.low)

    def groups_at(self, s: float) -> Groups:
        """Return the robot at s, as a batch of one."""
        columns = self._columns(self.value(s))
        return Groups.from_columns({name: np.array([value]) for name, value in columns.items()})

    def body_at(self, s: float) -> Body:
        """Return the robot's numbers at s."""
        return bodies(self.groups_at(s))[0]

    def _columns(self, value: float) -> dict[str, float]:
        columns = self.robot.group_values()
        if self.name == SPEED:
            return {**columns, "omega_bar": value * RPM * self.robot.time_scale}
        return {**columns, self.name: value}
