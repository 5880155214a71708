"""A table of one robot: its response to a switch at some dwell times, simulated, for the planner.

The look-up table that comes with the package covers a domain of robots without effects. A corrected robot may lie
outside this domain. For the planner, a few dozen simulated switches of that robot are enough
(`surrogate.tabulate`, seconds). Between their dwell times lags are interpolated (monotone cubic in ln T̄).
Planning simulates nothing.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.files import write_text
from sim.mechanics import planar
from sim.model.groups import DWELL

LAGS = ("lag_z", "lag_x", "lag_psi_rad")


@dataclass(frozen=True)
class SingleRobot:
    """Steady motion and lags of one robot, with the interface of `surrogate.table.LookupTable`."""

    robot: dict[str, float]  # dimensionless groups, effects among them
    steady: dict[str, float]  # columns of `sim steady`, positive motor
    dwells: list[float]
    lags: list[list[float]]  # (K, 3): Δz, Δx, Δψ
    errors: dict[str, dict[str, float]]  # output -> {"rms"}, from dwells between those of the table
    provenance: dict[str, Any]

    @property
    def domain(self) -> dict[str, tuple[float, float]]:
        """Range of every input: a single value, except for the dwell."""
        own = {name: (value, value) for name, value in self.robot.items()}
        return {**own, DWELL: (self.dwells[0], self.dwells[-1])}

    @property
    def identity(self) -> str:
        """Hash of the numbers."""
        return hashlib.sha256(json.dumps([self.robot, self.steady, self.lags]).encode()).hexdigest()[:16]

    def query(self, columns: Mapping[str, Floats]) -> dict[str, Floats]:
        """Outputs (M,) of this robot; with a column `dwell_bar` also its response to a switch.

        Raises:
            InputError: the columns are another robot's, or a dwell is outside the table.
        """
        count = len(next(iter(columns.values())))
        for name, values in columns.items():
            low, high = self.domain.get(name, (0.0, 0.0))
            slack = 1e-9 * max(abs(low), abs(high), 1.0)
            for value in values[(values < low - slack) | (values > high + slack)][:1]:
                allowed = f"{low:g} to {high:g}" if high > low else f"{low:g} only"
                raise InputError(
                    f"{name} = {value:g} is outside this robot's table ({allowed}); make its own table"
                )
        found = {name: np.full(count, value) for name, value in self.steady.items()}
        if DWELL in columns:
            lag = PchipInterpolator(np.log(self.dwells), np.array(self.lags))(np.log(columns[DWELL]))
            found |= dict(zip(LAGS, lag.T, strict=True))
            twist = np.stack([found["v_z"], found["v_x"], found["omega_yr_bar"]], -1)
            found["net_speed_bar"] = planar.net_speed(twist, lag, np.asarray(columns[DWELL], dtype=float))
        return found


def save_single(table: SingleRobot, path: str | Path) -> None:
    """Write a table of one robot as JSON."""
    write_text(path, json.dumps(asdict(table), indent=1) + "\n")


def load_single(path: str | Path) -> SingleRobot:
    """Read a table of one robot.

    Raises:
        InputError: the file is not such a table.
    """
    try:
        return SingleRobot(**json.loads(Path(path).read_text()))
    except (json.JSONDecodeError, TypeError) as broken:
        raise InputError(
            f"{path} is no table of a robot: {broken}; make one with python -m surrogate robot"
        ) from None
