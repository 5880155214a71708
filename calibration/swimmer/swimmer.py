"""The swimming robot as a model for the calibration: the simulator, for any coefficients and influences.

Runs under equal conditions share one simulation. A reversed motor mirrors the motion, unless an odd influence is
present. A parameter may differ from run to run: then it is an array (n,). Motions are solved directly and
extrapolated in the mesh (`sim.motion.sensitivity`); their errors of a few hundredths of a percent are far below
those of measurements. Outputs are compared as ln |output|, θ in radians.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from calibration.linear.gls import Noise, repeat_covariance
from calibration.statistics.budget import count_predictions
from calibration.statistics.forward import either_side, secants, stacked
from calibration.statistics.lab_settings import LabSettings
from calibration.statistics.statistical_model import Parameter, Parameters, Predict
from calibration.swimmer.influences import (
    CAMERA,
    COURSE,
    CURRENT,
    FIELDS,
    HEADING,
    LENGTH,
    SLIP,
    TACHOMETER,
    TRACKED_POINT,
    Influence,
    influence_of_law,
    influences,
    nuisance_parameters,
    reason_untestable,
)
from calibration.swimmer.measured_table import Measurements
from calibration.swimmer.observation import Observation
from calibration.swimmer.possible_runs import check_inputs, check_lab_settings, check_outputs, possible_settings
from common.arrays import Flags, Floats, Integers
from common.errors import InputError
from sim.effects import effect_named, is_effect
from sim.model.robot import Robot, groups_of, time_scale
from sim.motion.batches import sensitivity_columns, steady_columns
from sim.motion.sensitivity import Sensitivities
from sim.solve.refinement import PHASES, PHASES_FOR_SLOPES
from surrogate.domain import COEFFICIENTS
from surrogate.table import NeuralTable
from surrogate.table_file import load

SANE = (0.1, 20.0)  # range of the coefficients; at its ends the model lacks something

_SLOPES = 2  # predictions that cost as much as the derivatives of a run: of local effects one, of others three
_STEP = 0.05  # finite-difference step in ln C, with the look-up table
_MOST_GUESSES = 12
_STARTS = (1.0, 0.6, 1.6)  # factors on the coefficients as given, for several starts
_FEWEST_COVERED = 24  # runs


class Inputs(NamedTuple):
    """What is simulated and how it is observed, in P parameter sets of n runs; numbers are (P, n) or broadcast."""

    numbers: dict[str, Floats]  # by field of `Robot`
    effects: dict[str, Floats]  # sizes
    view: Observation

    @property
    def columns(self) -> dict[str, Floats]:
        """Columns of the simulator, (P, n), the motor turning forward."""
        columns = {**groups_of(self.numbers), **self.effects}
        return dict(zip(columns, np.broadcast_arrays(*columns.values()), strict=True))


class Simulated(NamedTuple):
    """Runs of P parameter sets, and the distinct robots that are simulated for them."""

    inputs: Inputs
    columns: dict[str, Floats]  # of the distinct robots, for the simulator
    same: Integers  # (P, n) the robot of each run


class Solver(NamedTuple):
    """Functions for motions and derivatives, like `steady_columns` and `sensitivity_columns`."""

    steady: Callable[..., Mapping[str, Floats]]
    slopes: Callable[..., Sensitivities]


DIRECT = Solver(partial(steady_columns, stability=False), sensitivity_columns)


@dataclass(frozen=True)
class SwimmerModel:
    """Predicts the outputs of a table for a robot with given parameters."""

    robot: Robot
    runs: Measurements
    jobs: int | None = None
    solver: Solver = DIRECT
    own: LabSettings = field(default_factory=dict)  # settings that the lab has for its next runs
    both: bool = False  # whether both directions of the motor were seen elsewhere

    def __post_init__(self) -> None:
        """Refuse lengths and speeds that are not possible, before anything is simulated."""
        check_inputs(self.robot, self.runs)
        check_lab_settings(self.own)

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(n, n, float(getattr(self.robot, n)), SANE, 1.0, True) for n in COEFFICIENTS)

    @cached_property
    def nuisances(self) -> tuple[Parameter, ...]:
        return nuisance_parameters(self.robot, self.runs.sigmas, self.runs.outputs, self.runs.noted_names)

    @cached_property
    def effects(self) -> tuple[Parameter, ...]:
        sizes = self.robot.effects
        return tuple(
            replace(i.parameter, start=sizes.get(name, i.parameter.start)) if i.effect == name else i.parameter
            for name, i in self._influences.items()
        )

    @cached_property
    def untestable(self) -> dict[str, str]:
        return {influence.parameter.title: why for influence, why in self._reasons if why}

    @cached_property
    def _seconds(self) -> dict[str, Influence]:
        """Second numbers of effects, by name."""
        return {
            second.name: Influence(second, second.name, None, influence.odd)
            for influence in self._influences.values() if (second := influence.parameter.second)
        }  # fmt: skip

    @cached_property
    def _influences(self) -> dict[str, Influence]:
        return {influence.parameter.name: influence for influence, why in self._reasons if not why}

    @cached_property
    def _reasons(self) -> list[tuple[Influence, str]]:
        """All influences, and why these runs cannot test them; empty where they can."""
        both = self.both or len(np.unique(np.sign(self.runs.omega))) == 2
        return [(i, reason_untestable(i, self._drivers, both, self.runs.outputs)) for i in influences().values()]

    def predict(self, sets: Sequence[Parameters], *, title: str = "", lookup: NeuralTable | None = None) -> Floats:
        """Predict (P, n, k) for P parameter sets, all simulated together.

        With `lookup` the look-up table is used, not the simulator. That is good for a first guess only, because
        the errors of the table would look like physics.
        """
        inputs, distinct, same = self.simulated(sets)
        if lookup is not None:
            found: Mapping[str, Floats] = lookup.query(distinct)
        else:
            count_predictions(len(distinct["N"]))
            found = self.solver.steady(distinct, jobs=self.jobs, title=title)
        table = inputs.view.see({name: column[same] for name, column in found.items()})
        if not np.isfinite(table).all():
            raise InputError("the simulation of a run broke down; check the robot and the run's motor speed")
        return self.runs.compared(table)

    def simulated(self, sets: Sequence[Parameters]) -> Simulated:
        """Choose the robots that are simulated for P parameter sets."""
        inputs = self.inputs_of_runs(sets)
        columns = inputs.columns
        columns["omega_bar"] = columns["omega_bar"] * self._direction(columns)
        return Simulated(inputs, *self._simulated(columns))

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return the linear model, by the simulator's own sensitivities, see `ForwardModel`.

        If a run has no direct solution: by differences of motions that are stepped in time, or NaN if `quick`.
        """
        near = self.inputs_of_runs([at, *either_side(at, along)]).columns
        columns = {name: column[:1] for name, column in near.items()}
        moved = tuple(name for name, column in near.items() if (column != columns[name]).any())
        direction = self._direction(columns, moved)
        columns["omega_bar"] = columns["omega_bar"] * direction
        distinct, same = self._simulated(columns, moved)
        at_work = any(is_effect(k) and not effect_named(k).beside and _works(k, v) for k, v in distinct.items())
        # Non-local effects at their null may need more phases than the motion; with effects at work it has them.
        reaching = any(is_effect(name) and effect_named(name).reach == "nonlocal" for name in moved)
        phases = PHASES_FOR_SLOPES if reaching and not at_work else PHASES
        count_predictions(len(distinct["N"]) * (1 + _SLOPES * bool(moved)))
        found = self.solver.slopes(distinct, moved, phases=phases, jobs=self.jobs, title=title)
        motions, slopes = (
            {k: table[same[0]] for k, table in of.items()} for of in (found.values, found.derivatives)
        )
        if not (quick or all(np.isfinite(table).all() for table in (*motions.values(), *slopes.values()))):
            return secants(self, at, along, title=title)

        def predict(sets: Sequence[Parameters]) -> Floats:
            inputs = self.inputs_of_runs(sets)
            near = inputs.columns
            near["omega_bar"] = near["omega_bar"] * direction
            seen = {name: values + 0 * near["N"] for name, values in motions.items()}
            for j, name in enumerate(moved):
                change = near[name] - columns[name]
                differs = change.any(1)  # a slope that is not known does not reach the others
                for output, of in slopes.items():
                    seen[output][differs] += of[:, j] * change[differs]
            return self.runs.compared(inputs.view.see(seen))

        return predict

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """Fit coefficients with the look-up table to the runs that it covers; `start` if those are too few.

        Of several starts, the one that ends nearest to the runs is taken.
        """
        lookup = load()
        covered = used & self._inside(lookup, start)
        if covered.sum() < _FEWEST_COVERED:
            return dict(start)
        part = replace(self, runs=self.runs.subset(covered))
        fits = [
            part._fit_lookup(lookup, {**start, **{n: factor * start[n] for n in COEFFICIENTS}})
            for factor in _STARTS
        ]
        return min(fits, key=lambda pair: pair[1])[0]

    def _fit_lookup(self, lookup: NeuralTable, start: dict[str, float]) -> tuple[dict[str, float], float]:
        """Fit coefficients from one start; with the sum of squares that they leave, infinite off the table."""
        data, parameters, remainder = self.runs, dict(start), math.inf
        whiten = Noise(repeat_covariance(data.y, data.repeats()), 0.0).whitener(data.session)
        for _ in range(_MOST_GUESSES):
            moved = [{**parameters, name: parameters[name] * math.exp(_STEP)} for name in COEFFICIENTS]
            try:
                predictions = self.predict([parameters, *moved], lookup=lookup)
            except InputError:  # a coefficient left the table's domain on the way
                return start, math.inf
            J = whiten(np.moveaxis(predictions[1:] - predictions[0], 0, -1) / _STEP)
            residual = whiten(data.y - predictions[0])
            remainder = float(residual @ residual)
            step: Floats = np.asarray(np.linalg.lstsq(J, residual, rcond=None)[0])
            if np.abs(step).max() < 1e-3:
                break
            for name, change in zip(COEFFICIENTS, np.clip(step, -0.7, 0.7).tolist(), strict=True):
                parameters[name] = min(max(parameters[name] * math.exp(change), SANE[0]), SANE[1])
        return parameters, remainder

    def check(self, prediction: Floats) -> None:
        """Refuse a table whose units cannot be those that its columns name."""
        check_outputs(self.runs, prediction)

    def possible(self) -> tuple[SwimmerModel, list[dict[str, Any]]]:
        """Return runs that can be made next (`calibration.swimmer.possible_runs`)."""
        runs, grid = self.runs, possible_settings(self.runs, self.own)
        count = len(grid)
        noted = np.tile(runs.noted.mean(0), (count, 1))
        settings = [{"N": int(n), "l_cm": length, "omega_rpm": speed} for n, length, speed in grid.tolist()]
        possible_runs = replace(
            runs, y=np.zeros((count, len(runs.outputs))), weight=None, completion=None, specimen=None,
            notes={}, differing=None,
            condition=np.arange(count), session=np.zeros(count, int),
            session_names=("next",), inputs=np.zeros((count, runs.inputs.shape[1])), excluded=(),
            rows=np.arange(count), caveats=(), tails=grid[:, 0], length=grid[:, 1] / 100,
            omega=grid[:, 2] * math.pi / 30, noted=noted,
        )  # fmt: skip
        return replace(self, runs=possible_runs), settings

    def robots(self, parameters: Parameters) -> list[Robot]:
        """Return the robot of every run at `parameters`."""
        numbers, effects, _ = self.inputs_of_runs([parameters])
        shape = 1, len(self.runs)
        whole = {name: np.broadcast_to(sizes, shape)[0] for name, sizes in {**numbers, **effects}.items()}
        robots = []
        for i, tails in enumerate(self.runs.tails.tolist()):
            of_run: dict[str, Any] = {name: float(sizes[i]) for name, sizes in whole.items()}
            present = {name: of_run.pop(name) for name in effects}
            robots.append(replace(self.robot, **{**of_run, "tails": int(tails)}, effects=present))
        return robots

    def _inside(self, lookup: NeuralTable, parameters: Parameters) -> Flags:
        """Tell which runs (n,) the look-up table covers at `parameters`."""
        distinct, same = self._simulated(self.inputs_of_runs([parameters]).columns)
        good = np.ones(same.shape, dtype=bool)
        for name, column in distinct.items():
            low, high = lookup.domain.get(name, (0.0, 0.0))
            good &= ((low * (1 - 1e-9) <= np.abs(column)) & (np.abs(column) <= high * (1 + 1e-9)))[same]
        return good[0]

    @cached_property
    def _drivers(self) -> dict[str, Floats]:
        """What drives influences, of every run (n,)."""
        drivers = dict(zip(self.runs.noted_names, self.runs.noted.T, strict=True))
        if "tank_diameter" in drivers:
            drivers["head_over_tank"] = 2 * self.robot.head_radius / drivers["tank_diameter"]
        return drivers

    def _driver(self, name: str, zero: Floats) -> Floats:
        """Return what drives an influence, (P, n), where the zero of the course is off by `zero`."""
        if name not in ("course_x", "course_y"):
            return self._drivers[name]
        x, y = self._drivers["course_x"], self._drivers["course_y"]
        turned = x * np.cos(zero) + y * np.sin(zero) if name == "course_x" else y * np.cos(zero) - x * np.sin(zero)
        return np.asarray(turned)

    def inputs_of_runs(self, sets: Sequence[Parameters]) -> Inputs:
        """Compute the robots of all runs in P parameter sets, and how they are observed."""
        runs, robot, of = self.runs, self.robot, partial(stacked, sets)
        numbers = {name: of(name, robot.number(name)) for name in (*COEFFICIENTS, *FIELDS)}
        numbers |= {"tails": runs.tails[None], "tail_length": runs.length + of(LENGTH, 0.0)}
        numbers["motor_speed"] = np.abs(runs.omega) * of(TACHOMETER, 1.0) * (1 - of(SLIP, 0.0))
        effects = {name: np.full((1, 1), size) for name, size in robot.effects.items()}
        current: dict[str, Floats] = {}
        for name in dict.fromkeys(name for parameters in sets for name in parameters):
            known = self._seconds.get(name) or self._influences.get(name)
            if (influence := known or influence_of_law(name)) is None:
                continue
            start, effect = influence.parameter.start, influence.effect
            value = of(name, robot.effects.get(name, start))
            by = (value - start) * (self._driver(influence.needs, of(COURSE, 0.0)) if influence.needs else 1.0)
            if effect is not None:
                effects[effect] = effects.get(effect, effect_named(effect).null) + by if influence.needs else value
            elif name in CURRENT:
                current[name] = value
            for number, power in influence.one_tail.items():
                numbers[number] = numbers[number] * (1 - value / runs.tails) ** power
        length, side = numbers["tail_length"], np.sign(runs.omega)
        along, across = self._current(current, of(COURSE, 0.0)) if current else (np.zeros((1, 1)),) * 2
        view = Observation(
            runs.outputs, time_scale(numbers), length, numbers["head_length"] / length, of(TRACKED_POINT, 0.0),
            along, across * side, of(CAMERA, 1.0), of(HEADING, 0.0) * side,
        )  # fmt: skip
        return Inputs(numbers, effects, view)

    def _current(self, current: Mapping[str, Floats], zero: Floats) -> tuple[Floats, Floats]:
        """Return a current along the paths and to their left, (P, n)."""
        x, y = (self._driver(name, zero) for name in ("course_x", "course_y"))
        u, v = (current.get(name, np.zeros((1, 1))) for name in CURRENT)
        return u * x + v * y, v * x - u * y

    def _direction(self, columns: Mapping[str, Floats], moved: Sequence[str] = ()) -> Floats:
        """Return the sign of the motor's direction, (P, n): 1 unless something odd is at work or `moved`."""
        odd = np.zeros((len(columns["N"]), 1), dtype=bool)
        for name, column in columns.items():
            if is_effect(name) and effect_named(name).symmetry == "odd":
                odd |= (name in moved) | (column != effect_named(name).null).any(1, keepdims=True)
        return np.where(odd, np.sign(self.runs.omega), 1.0)

    def _simulated(
        self, columns: Mapping[str, Floats], moved: Sequence[str] = ()
    ) -> tuple[dict[str, Floats], Integers]:
        """Leave out effects at their null, and runs (P, n) that equal others; with the place of each there."""
        kept = {}
        for name, column in columns.items():
            if is_effect(name):
                effect = effect_named(name)
                shown_by = effect.beside or name
                at_work = shown_by in columns and _works(shown_by, columns[shown_by])
                if not (at_work or name in self.robot.effects or effect.beside in moved):
                    continue
                if influence_of_law(name):  # which may be steep
                    column = np.clip(column, *effect.bounds)
            kept[name] = column.ravel()
        table = np.stack(list(kept.values()), 1)
        alike = (table / np.maximum(np.abs(table).max(0), 1e-300)).round(12)
        _, first, place = np.unique(alike, axis=0, return_index=True, return_inverse=True)
        distinct = {name: column[first] for name, column in kept.items()}
        if self.robot.learnt_from is not None:
            for row in range(len(first)):
                self.robot.learnt_from.check({name: float(column[row]) for name, column in distinct.items()})
        return distinct, place.reshape(columns["N"].shape)


def _works(name: str, column: Floats) -> bool:
    """Tell whether an effect is at work in any run."""
    return bool((column != effect_named(name).null).any())


def robot_numbers(robot: Robot, parameters: Parameters) -> dict[str, Any]:
    """Collect fitted coefficients and numbers of the robot, by field; a is kept where R changes."""
    numbers: dict[str, Any] = {name: float(parameters[name]) for name in COEFFICIENTS}
    for name in FIELDS:
        numbers[name] = float(parameters.get(name, robot.number(name)))
    return numbers
