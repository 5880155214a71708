"""Forward model of the measurements: the simulator, for any coefficients and effects.

Runs of equal N, l and |ω| share one simulation (a reversed motor mirrors the motion; only even effects are
candidates here). Simulations are solved directly and extrapolated in the mesh (`sim.direct`): a few hundredths of
a percent, far below any measurement.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.measurements import Measurements
from sim.batches import steady_columns
from sim.errors import InputError
from sim.robot import Robot
from surrogate.lookup import Lookup

Floats = NDArray[np.float64]
Parameters = Mapping[str, float]

COEFFICIENTS = ("C_t", "C_r", "C_yr")


@dataclass(frozen=True)
class Swimmer:
    """Predicts the outputs of a table for a robot with given parameters."""

    robot: Robot
    data: Measurements
    jobs: int | None = None

    def predict(
        self,
        sets: Sequence[Parameters],
        *,
        title: str = "",
        lookup: Lookup | None = None,
    ) -> Floats:
        """Predictions (P, n, k) for P parameter sets, all simulated in one go.

        With `lookup` the look-up table answers instead of the simulator: good for a first guess, and no
        more, since its error would pass for physics.
        """
        conditions, place = self.data.unique_conditions()
        robots = self._robots(sets, conditions)
        if lookup is not None:
            found = lookup.query(robots)
        else:
            found = steady_columns(robots, jobs=self.jobs, title=title)
        scale = [self._scales(length) for _ in sets for length in conditions[:, 1]]
        tables = [self._outputs(found, i, *scale[i]) for i in range(len(scale))]
        table = np.array(tables).reshape(len(sets), len(conditions), -1)
        if not np.isfinite(table).all():
            raise InputError("the simulation of a run broke down; check the robot and the run's motor speed")
        return np.asarray(table[:, place])

    def inside(self, lookup: Lookup, parameters: Parameters) -> NDArray[np.bool_]:
        """Which runs (n,) the look-up table covers at `parameters`."""
        conditions, place = self.data.unique_conditions()
        robots = self._robots([parameters], conditions)
        good = np.ones(len(conditions), dtype=bool)
        for name, values in robots.items():
            low, high = lookup.domain.get(name, (0.0, 0.0))
            good &= (np.abs(values) >= low * (1 - 1e-9)) & (np.abs(values) <= high * (1 + 1e-9))
        return np.asarray(good[place])

    def _robots(self, sets: Sequence[Parameters], conditions: Floats) -> dict[str, Floats]:
        """Columns of every parameter set under every condition (N, l, |ω|)."""
        columns: dict[str, list[float]] = {}
        for parameters in sets:
            own: dict[str, Any] = {k: v for k, v in parameters.items() if k in COEFFICIENTS}
            effects = {k: v for k, v in parameters.items() if k not in COEFFICIENTS}
            for tails, length, omega in conditions:
                run = replace(
                    self.robot,
                    **own,
                    tails=int(tails),
                    tail_length=float(length),
                    motor_speed=float(omega),
                    effects={**self.robot.effects, **effects},
                )
                for name, value in run.group_values().items():
                    columns.setdefault(name, []).append(value)
        if len({len(v) for v in columns.values()}) != 1:
            raise InputError("parameter sets differ in their effects; give each set all of them")
        return {name: np.array(values) for name, values in columns.items()}

    def _scales(self, length: float) -> tuple[float, float]:
        robot = self.robot
        return length, robot.viscosity * length**4 / robot.bending_stiffness

    def _outputs(self, found: Mapping[str, Floats], row: int, length: float, time: float) -> list[float]:
        values = {
            "omega_h": math.log(abs(found["omega_h_bar"][row]) / time),
            "omega_t": math.log(abs(found["omega_t_bar"][row]) / time),
            "omega_yr": math.log(abs(found["omega_yr_bar"][row]) / time),
            "R_yr": math.log(found["R_yr_over_l"][row] * length),
            "theta": math.radians(found["theta_deg"][row]),
        }
        return [values[name] for name in self.data.outputs]
