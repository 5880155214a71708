"""The interface of a look-up table, which planner and calibration use.

`surrogate.table.NeuralTable` (trained networks, a domain of robots) and
`surrogate.robot_table.RobotTable` (one robot, simulated) are look-up tables.
`surrogate.table_file.load_table` reads either.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, Protocol

from common.arrays import Floats
from common.errors import InputError
from sim.model.response import Responses

NOTE = "note"  # the column that says why a robot of many is outside


class OutsideError(InputError):
    """A robot is outside the domain of a look-up table."""

    def __init__(self, message: str, row: int = 0, reason: str = ""):
        super().__init__(message)
        self.row = row  # of the robot in the query
        self.reason = reason  # in words


class ErrorModes(NamedTuple):
    """P independent errors of one standard deviation, for a positive motor; curves as in `sim.model.response`."""

    twist: Floats  # (P, 3), of v_z, v_x and ω_yr
    lag: Floats  # (P, D, 3)
    memory: Floats  # (P, K, D, 3), after dwells BEFORE


class LookupTable(Protocol):
    """Gives the motion for a robot's dimensionless groups, without simulating.

    Example:
        >>> from softflagella import load_table
        >>> load_table().domain["N"]
        (1.0, 8.0)
    """

    @property
    def domain(self) -> Mapping[str, tuple[float, float]]:
        """Smallest and largest value of every input; `omega_bar` as a magnitude."""
        ...

    @property
    def errors(self) -> Mapping[str, Mapping[str, float]]:
        """Errors by output; each has at least "rms", see `surrogate.held_out`."""
        ...

    @property
    def identity(self) -> str:
        """A hash of the numbers; it tells which table made a plan."""
        ...

    def query(self, columns: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return outputs, each (M,), of robots given by column name, each (M,).

        They are `omega_t_bar`, `omega_h_bar`, `omega_yr_bar`, `v_x`, `v_z`, `R_yr_over_l`, `theta_deg` and
        `tail_gap`.

        Raises:
            InputError: a robot that cannot be, or one outside the domain.
        """
        ...

    def error_modes(self, columns: Mapping[str, Floats]) -> ErrorModes:
        """Return independent errors of the motion and the response of one robot.

        Args:
            columns: the robot by column name; its first row counts.

        Raises:
            InputError: a robot that cannot be, or one outside the domain.
        """
        ...

    def save(self, path: str | Path) -> None:
        """Write the table's file, which `softflagella.load_table` reads.

        Raises:
            InputError: the file cannot be written.
        """
        ...

    def response(self, columns: Mapping[str, Floats]) -> Responses:
        """Return the response to a flip of the motor, as `sim.motion.response.responses` would simulate it.

        Args:
            columns: robots by column name, each (M,); the sign of `omega_bar` is the direction after the flip.

        Raises:
            InputError: a robot that cannot be, or one outside the domain.
        """
        ...
