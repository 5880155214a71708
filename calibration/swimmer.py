"""The swimming robot as a model for the engine: the simulator, for any coefficients and influences.

Runs under equal conditions share one simulation; a reversed motor mirrors the motion unless an odd influence is at
work. Simulations are solved directly and extrapolated in the mesh (`sim.direct`): a few hundredths of a percent,
far below any measurement. Outputs are compared as ln |output|, θ in radians.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.influences import SLIP, TRACKED_POINT, Influence, influences, reason_untestable
from calibration.measurements import Measurements
from calibration.model import Floats, Parameter, Parameters
from calibration.noise import Noise, repeat_covariance
from sim.batches import steady_columns
from sim.effects import catalogue
from sim.errors import InputError
from sim.robot import Robot
from surrogate.export import load
from surrogate.lookup import Lookup

COEFFICIENTS = ("C_t", "C_r", "C_yr")
SANE = (0.1, 20.0)  # coefficients stay within: beyond, they say that the model lacks something

_STEP = 0.05  # finite difference in ln C
_MOST_GUESSES = 12
_FEWEST_COVERED = 24  # runs


@dataclass(frozen=True)
class Swimmer:
    """Predicts the outputs of a table for a robot with given parameters."""

    robot: Robot
    runs: Measurements
    jobs: int | None = None

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(n, n, float(getattr(self.robot, n)), SANE, 1.0, True) for n in COEFFICIENTS)

    @cached_property
    def effects(self) -> tuple[Parameter, ...]:
        own = self.robot.effects
        return tuple(
            replace(i.parameter, start=own.get(name, i.parameter.start)) if i.effect == name else i.parameter
            for name, i in self._influences.items()
        )

    @cached_property
    def untestable(self) -> dict[str, str]:
        return {i.parameter.title: why for i in influences().values() if (why := self._reason(i))}

    @cached_property
    def _influences(self) -> dict[str, Influence]:
        return {name: i for name, i in influences().items() if not self._reason(i)}

    def _reason(self, influence: Influence) -> str:
        both = len(np.unique(np.sign(self.runs.omega))) == 2
        columns = {name.replace("tank_diameter", "head_over_tank"): True for name in self.runs.noted_names}
        return reason_untestable(influence, columns, both)

    def predict(self, sets: Sequence[Parameters], *, title: str = "", lookup: Lookup | None = None) -> Floats:
        """Predictions (P, n, k) for P parameter sets, all simulated in one go.

        With `lookup` the look-up table answers instead of the simulator: good for a first guess, and no
        more, since its error would pass for physics.
        """
        columns: dict[str, list[float]] = {}
        robots: list[tuple[Robot, float]] = []
        places = []
        for parameters in sets:
            conditions, place = self._conditions(parameters)
            places.append(place + len(robots))
            for condition in conditions:
                robot, sign = self._robot(parameters, condition)
                values = {**self._nulls(sets), **robot.group_values()}
                values["omega_bar"] *= sign
                robots.append((robot, parameters.get(TRACKED_POINT, 0.0)))
                for name, value in values.items():
                    columns.setdefault(name, []).append(value)
        arrays = {name: np.array(values) for name, values in columns.items()}
        if lookup is not None:
            found = lookup.query(arrays)
        else:
            found = steady_columns(arrays, jobs=self.jobs, title=title)
        table = np.array([self._outputs(found, i, robot, point) for i, (robot, point) in enumerate(robots)])
        if not np.isfinite(table).all():
            raise InputError("the simulation of a run broke down; check the robot and the run's motor speed")
        return np.array([table[place] for place in places])

    def guess(self, start: dict[str, float], used: NDArray[np.bool_]) -> dict[str, float]:
        """Coefficients fitted with the look-up table to the runs that it covers; `start` if those are too few."""
        lookup = load()
        covered = used & self._inside(lookup, start)
        parameters = dict(start)
        if covered.sum() < _FEWEST_COVERED:
            return parameters
        data = self.runs.subset(covered)
        part = Swimmer(self.robot, data, self.jobs)
        whiten = Noise(repeat_covariance(data.y, data.condition), np.zeros(data.y.shape[1])).whitener(data.session)
        for _ in range(_MOST_GUESSES):
            moved = [{**parameters, name: parameters[name] * math.exp(_STEP)} for name in COEFFICIENTS]
            try:
                found = part.predict([parameters, *moved], lookup=lookup)
            except InputError:  # a coefficient left the table's domain on the way
                return dict(start)
            J = whiten(np.moveaxis(found[1:] - found[0], 0, -1) / _STEP)
            step: Floats = np.asarray(np.linalg.lstsq(J, whiten(data.y - found[0]), rcond=None)[0])
            for name, change in zip(COEFFICIENTS, np.clip(step, -0.7, 0.7).tolist(), strict=True):
                parameters[name] = min(max(parameters[name] * math.exp(change), SANE[0]), SANE[1])
            if np.abs(step).max() < 1e-3:
                break
        return parameters

    def possible(self) -> tuple[Swimmer, list[dict[str, Any]]]:
        """Tail counts (one more), tail lengths and motor speeds of the table's range, and slower ones."""
        runs = self.runs
        lengths = np.linspace(runs.length.min(), runs.length.max(), 6)
        speeds = np.abs(runs.omega).max() * np.array([0.4, 0.7, 1.0])
        tails = np.arange(runs.tails.min(), runs.tails.max() + 2)
        grid = np.array([(n, a, w) for n in tails for a in lengths for w in (*speeds, *-speeds)])
        count = len(grid)
        noted = np.tile(runs.noted.mean(0), (count, 1))
        settings = [
            {"N": int(n), "l_cm": round(100 * length, 1), "omega_rpm": round(omega * 30 / math.pi, 1)}
            for n, length, omega in grid.tolist()
        ]
        own = replace(
            runs, y=np.zeros((count, len(runs.outputs))),
            condition=np.arange(count), session=np.zeros(count, int),
            session_names=("next",), inputs=np.zeros((count, runs.inputs.shape[1])), set_aside=(),
            tails=grid[:, 0], length=grid[:, 1], omega=grid[:, 2], noted=noted,
        )  # fmt: skip
        return Swimmer(self.robot, own, self.jobs), settings

    def _inside(self, lookup: Lookup, parameters: Parameters) -> NDArray[np.bool_]:
        """Which runs (n,) the look-up table covers at `parameters`."""
        conditions, place = self._conditions(parameters)
        good = np.ones(len(conditions), dtype=bool)
        for i, condition in enumerate(conditions):
            for name, value in self._robot(parameters, condition)[0].group_values().items():
                low, high = lookup.domain.get(name, (0.0, 0.0))
                good[i] &= low * (1 - 1e-9) <= abs(value) <= high * (1 + 1e-9)
        return np.asarray(good[place])

    def _at_work(self, parameters: Parameters) -> list[Influence]:
        """Influences that are not at their null."""
        found = [i for name, i in self._influences.items() if name in parameters]
        return [i for i in found if parameters[i.name] != i.parameter.start]

    def _conditions(self, parameters: Parameters) -> tuple[Floats, NDArray[np.intp]]:
        """Distinct (N, l, ω, noted) as rows, as far as it matters at `parameters`, and each run's place."""
        runs, work = self.runs, self._at_work(parameters)
        omega = runs.omega if any(i.odd for i in work) else np.abs(runs.omega)
        noted = runs.noted if any(i.needs for i in work) else 0 * runs.noted
        table = np.column_stack([runs.tails, runs.length, omega, noted])
        rows, place = np.unique(table.round(9), axis=0, return_inverse=True)
        return rows, place.reshape(-1)

    def _robot(self, parameters: Parameters, condition: Floats) -> tuple[Robot, float]:
        """The robot of a run, and the direction of its motor."""
        tails, length, omega = condition[:3].tolist()
        noted = dict(zip(self.runs.noted_names, condition[3:].tolist(), strict=True))
        if noted.get("tank_diameter"):
            noted["head_over_tank"] = 2 * self.robot.head_radius / noted["tank_diameter"]
        effects = dict(self.robot.effects)
        for influence in self._at_work(parameters):
            if influence.effect is not None:
                null = catalogue()[influence.effect].null
                share = 1.0 if influence.needs is None else noted[influence.needs]
                size, start = parameters[influence.name], influence.parameter.start
                before = effects.get(influence.effect, null) if influence.needs else null
                effects[influence.effect] = before + (size - (start if influence.needs else null)) * share
        own: dict[str, Any] = {name: float(parameters[name]) for name in COEFFICIENTS}
        speed = abs(omega) * (1 - parameters.get(SLIP, 0.0))
        robot = replace(
            self.robot, **own, tails=int(tails), tail_length=length, motor_speed=speed, effects=effects
        )
        return robot, math.copysign(1.0, omega)

    def _nulls(self, sets: Sequence[Parameters]) -> dict[str, float]:
        """Every effect that any of the sets has at work, at its null."""
        names = {i.effect for parameters in sets for i in self._at_work(parameters) if i.effect}
        return {name: catalogue()[name].null for name in sorted(names)}

    def _outputs(self, found: Mapping[str, Floats], row: int, robot: Robot, point: float) -> list[float]:
        yaw, surge = found["omega_yr_bar"][row], found["v_z"][row]
        ahead = point * robot.head_length / robot.tail_length
        sway = found["v_x"][row] + yaw * ahead
        values = {
            "omega_h": math.log(abs(found["omega_h_bar"][row]) / robot.time_scale),
            "omega_t": math.log(abs(found["omega_t_bar"][row]) / robot.time_scale),
            "omega_yr": math.log(abs(yaw) / robot.time_scale),
            "R_yr": math.log(math.hypot(sway, surge) / abs(yaw) * robot.tail_length),
            "theta": math.atan2(abs(sway), surge),
            "v": math.log(math.hypot(sway, surge) * robot.tail_length / robot.time_scale),
        }
        return [values[name] for name in self.runs.outputs]


def corrected_robot(robot: Robot, parameters: Parameters) -> Robot:
    """`robot` with fitted coefficients and effects; drift between runs and the observation stay out."""
    own: dict[str, Any] = {name: float(parameters[name]) for name in COEFFICIENTS}
    sizes = {
        name: float(value)
        for name, value in parameters.items()
        if name in catalogue() and value != catalogue()[name].null
    }
    return replace(robot, **own, effects={**robot.effects, **sizes})
