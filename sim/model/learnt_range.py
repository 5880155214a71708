"""The range of the runs that a law was learnt from.

A law (`sim.model.laws`) describes the runs that it was learnt from, and says nothing of others. So a robot outside
the runs, by more than a small margin, is refused. The inputs are dimensionless. In a robot.toml their range is

    [learnt_from]
    low = [2.0, 1.9, -6.1]     # N, ln l/R, ln ω̄ (R/l)⁴
    high = [5.0, 3.2, -4.7]
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from common.errors import InputError

INPUTS = ("N", "ln l/R", "ln ω̄ (R/l)⁴")
_MARGIN = (0.5, 0.1, 0.1)  # of the inputs, beyond the runs
_LARGEST = 1e9  # of any number


@dataclass(frozen=True)
class LearntRange:
    """Smallest and largest inputs of the runs, in the order of INPUTS."""

    low: tuple[float, ...]  # three numbers
    high: tuple[float, ...]  # three numbers

    def __post_init__(self) -> None:
        """Refuse numbers that are no range."""
        if {len(self.low), len(self.high)} != {len(INPUTS)}:
            raise InputError(f"the range of the runs needs three numbers each: {', '.join(INPUTS)}")
        if not (np.abs([*self.low, *self.high]) < _LARGEST).all():
            raise InputError(f"the range of the runs: its numbers must be finite, below {_LARGEST:g}")
        if any(low > high for low, high in zip(self.low, self.high, strict=True)):
            raise InputError("the range of the runs: low must not be above high")

    def check(self, values: Mapping[str, float]) -> None:
        """Refuse a robot outside the runs.

        Args:
            values: groups of the robot, by column name.

        Raises:
            InputError: the robot is outside.
        """
        inputs = inputs_of(values)
        for name, value, low, high, margin in zip(INPUTS, inputs, self.low, self.high, _MARGIN, strict=True):
            if not low - margin <= value <= high + margin:
                raise InputError(
                    f"{name} = {value:.3g} is outside the runs that the robot's law was learnt from "
                    f"({low:.3g} to {high:.3g}): make runs there, or leave the law out of its file"
                )


def inputs_of(values: Mapping[str, float]) -> tuple[float, float, float]:
    """Compute INPUTS of a robot from its groups."""
    slender = math.log(values["l_over_R"])
    return float(values["N"]), slender, math.log(abs(values["omega_bar"])) - 4 * slender


def learnt_range(robots: Iterable[Mapping[str, float]]) -> LearntRange:
    """Compute the range of robots from their groups, each by column name."""
    inputs = np.array([inputs_of(values) for values in robots])
    return LearntRange(tuple(inputs.min(0).round(6).tolist()), tuple(inputs.max(0).round(6).tolist()))


def read_learnt_range(table: Any) -> LearntRange:
    """Read the table [learnt_from] of a robot.toml.

    Raises:
        InputError: the table is no range.
    """
    try:
        if set(table) != {"low", "high"}:
            raise ValueError("it needs the lines low and high, and no others")
        low, high = (tuple(float(value) for value in table[name]) for name in ("low", "high"))
        return LearntRange(low, high)
    except (TypeError, ValueError, OverflowError) as broken:
        raise InputError(f"[learnt_from] cannot be read: {broken}") from None
