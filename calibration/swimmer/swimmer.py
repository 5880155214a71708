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

from calibration.statistics.gls import Noise, repeat_covariance
from calibration.statistics.statistical_model import Parameter, Parameters, Value, by_differences
from calibration.swimmer.influences import (
    CAMERA,
    COURSE,
    CURRENT,
    GROUPS,
    HEADING,
    LENGTH,
    POWERS,
    SLIP,
    TACHOMETER,
    TRACKED_POINT,
    Influence,
    influence_of_law,
    influences,
    is_odd,
    nuisance_parameters,
    reason_untestable,
    robot_number,
)
from calibration.swimmer.measured_table import Measurements
from calibration.swimmer.observation import Observation
from calibration.swimmer.possible_runs import Owned, check_inputs, check_outputs, check_owned, possible_settings
from common.arrays import Flags, Floats, Integers
from common.errors import InputError
from sim.effects import effect_named, is_effect
from sim.inputs import group_columns
from sim.model.robot import Robot
from sim.motion.batches import sensitivity_columns, steady_columns
from sim.motion.sensitivity import Sensitivities
from sim.solve.refinement import PHASES, PHASES_FOR_SLOPES
from surrogate.domain import COEFFICIENTS
from surrogate.table import NeuralTable
from surrogate.table_file import load

SANE = (0.1, 20.0)  # range of the coefficients; at its ends the model lacks something

_STEP = 0.05  # finite-difference step in ln C, with the look-up table
_MOST_GUESSES = 12
_STARTS = (1.0, 0.6, 1.6)  # factors on the coefficients as given, for several starts
_FEWEST_COVERED = 24  # runs


class _Run(NamedTuple):
    """One run: the simulated robot, and how it is observed."""

    robot: Robot
    sign: float  # direction of the motor
    point: float  # tracked, head lengths ahead of the head's centre
    current: float  # of the fluid along the path [m/s]
    camera: float  # factor of its scale


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
    own: Owned = field(default_factory=dict)  # settings that the lab has for its next runs

    def __post_init__(self) -> None:
        """Refuse lengths and speeds that are not possible, before anything is simulated."""
        check_inputs(self.robot, self.runs)
        check_owned(self.own)

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
        both = len(np.unique(np.sign(self.runs.omega))) == 2
        return [(i, reason_untestable(i, self._drivers, both, self.runs.outputs)) for i in influences().values()]

    def predict(self, sets: Sequence[Parameters], *, title: str = "", lookup: NeuralTable | None = None) -> Floats:
        """Predict (P, n, k) for P parameter sets, all simulated together.

        With `lookup` the look-up table is used, not the simulator. That is good for a first guess only, because
        the errors of the table would look like physics.
        """
        parts = [self._conditions(parameters) for parameters in sets]
        runs = [run for conditions, _ in parts for run in conditions]
        columns, same = _distinct(self._columns(runs, sets))
        if lookup is not None:
            found: Mapping[str, Floats] = lookup.query(columns)
        else:
            found = self.solver.steady(columns, jobs=self.jobs, title=title)
        motion = {name: column[same] for name, column in found.items()}
        table = self._observation(runs).see(motion)
        if not np.isfinite(table).all():
            raise InputError("the simulation of a run broke down; check the robot and the run's motor speed")
        ends = np.cumsum([len(conditions) for conditions, _ in parts])
        predictions = np.array(
            [table[end - len(conditions) + place] for end, (conditions, place) in zip(ends, parts, strict=True)]
        )
        turned = np.array([self._turned(parameters.get(HEADING, 0.0)) for parameters in sets])
        return self.runs.compared(predictions + turned)

    def derivatives(
        self, parameters: Parameters, names: Sequence[str], *, title: str = "", quick: bool = False
    ) -> tuple[Floats, Floats]:
        """Compute the prediction (n, k) and derivatives (n, k, p), by the simulator's own sensitivities.

        If a run has no direct solution: by differences of motions that are stepped in time, or NaN if `quick`.
        """
        influences = {name: self._seconds.get(name) or self._influence(name) for name in names}
        odd = any(is_odd(name, influence) for name, influence in influences.items())
        runs, place = self._conditions(parameters, signed=odd)
        columns = self._columns(runs, [parameters])
        for second in (i.parameter.second for i in influences.values() if i and i.parameter.second):
            value = parameters.get(second.name, second.start)
            columns.setdefault(second.name, np.full(len(runs), float(np.ravel(value)[0])))
        moves = {name: _moves(name, influence) for name, influence in influences.items()}
        wanted = tuple(dict.fromkeys(move for group in moves.values() for move in group))
        # Non-local effects at their null may need more phases than the motion; with effects at work it has them.
        at_null = any(is_effect(name) and effect_named(name).reach == "nonlocal" for name in wanted)
        phases = PHASES_FOR_SLOPES if at_null and self._is_at_null(parameters) else PHASES
        distinct, same = _distinct(columns)
        found = self.solver.slopes(distinct, wanted, phases=phases, jobs=self.jobs, title=title)
        values, slopes = (
            {name: table[same] for name, table in of.items()} for of in (found.values, found.derivatives)
        )
        sensitivities = replace(found, values=values, derivatives=slopes)
        view = self._observation(runs)
        J = np.empty((*self.runs.y.shape, len(names)))
        for j, (name, influence) in enumerate(influences.items()):
            powers = _powers(name, influence)
            if name == COURSE:
                slope = view.slopes(sensitivities.values, {}, current=1.0)
                J[..., j] = slope[place] * self._across(parameters)[:, None]
                continue
            if powers is not None:
                by = np.array([1 / run.robot.tail_length if name == LENGTH else 1.0 for run in runs])
                camera = float(name == CAMERA)
                J[..., j] = self._slope_of_number(powers, by, columns, sensitivities, view, camera)[place]
                if name not in POWERS:
                    J[..., j] /= np.reshape(parameters[name] - self.runs.tails, (-1, 1))
                if name == HEADING:
                    J[..., j] += self._turned(1.0)
                continue
            at = wanted.index(moves[name][0]) if moves[name] else None
            motion = {} if at is None else {key: table[:, at] for key, table in sensitivities.derivatives.items()}
            slope = view.slopes(
                sensitivities.values, motion, point=float(name == TRACKED_POINT), current=float(name in CURRENT)
            )
            needs = influence.needs if influence else None
            scale = self._driver(needs, parameters) if needs else np.ones(len(place))
            if name == SLIP:
                scale = scale * -columns["omega_bar"][place] / (1 - parameters[SLIP])
            J[..., j] = slope[place] * (scale if influence else parameters[name] * scale)[:, None]
        seen = view.see(sensitivities.values)[place] + self._turned(parameters.get(HEADING, 0.0))
        if not quick and not (np.isfinite(J).all() and np.isfinite(seen).all()):
            return by_differences(self, parameters, names, title=title)
        return self.runs.compared(seen), np.moveaxis(self.runs.completed(np.moveaxis(J, -1, 0)), 0, -1)

    def _slope_of_number(
        self,
        powers: Mapping[str, float],
        by: Floats,
        columns: dict[str, Floats],
        sensitivities: Sensitivities,
        view: Observation,
        camera: float,
    ) -> Floats:
        """Compute the derivatives (m, k) along a number by its groups' powers; `by` (m,): of its ln."""
        motion = {key: np.zeros(len(by)) for key in sensitivities.derivatives}
        for group in (group for group in powers if group in GROUPS):
            at = sensitivities.parameters.index(group)
            for key, table in sensitivities.derivatives.items():
                motion[key] += powers[group] * by * columns[group] * table[:, at]
        scales: dict[str, Floats] = {k: powers[k] * by for k in ("time", "length", "ahead") if k in powers}
        return view.slopes(sensitivities.values, motion, camera=camera, scales=scales)

    def _turned(self, zero: Value) -> Floats:
        """Change (n, k) of the outputs if the zero of the heading is off: θ grows in one direction of the
        motor.
        """
        change = np.zeros(self.runs.y.shape)
        if "theta" in self.runs.outputs:
            change[:, self.runs.outputs.index("theta")] = zero * np.sign(self.runs.omega)
        return change

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
            condition=np.arange(count), session=np.zeros(count, int),
            session_names=("next",), inputs=np.zeros((count, runs.inputs.shape[1])), excluded=(),
            rows=np.arange(count), caveats=(), tails=grid[:, 0], length=grid[:, 1] / 100,
            omega=grid[:, 2] * math.pi / 30, noted=noted,
        )  # fmt: skip
        return replace(self, runs=possible_runs), settings

    def robots(self, parameters: Parameters) -> tuple[list[Robot], Integers]:
        """Return the robots that are simulated for the runs at `parameters`, and each run's place among them."""
        runs, place = self._conditions(parameters)
        return [run.robot for run in runs], place

    def _inside(self, lookup: NeuralTable, parameters: Parameters) -> Flags:
        """Tell which runs (n,) the look-up table covers at `parameters`."""
        runs, place = self._conditions(parameters)
        good = np.ones(len(runs), dtype=bool)
        for i, run in enumerate(runs):
            for name, value in run.robot.group_values().items():
                low, high = lookup.domain.get(name, (0.0, 0.0))
                good[i] &= low * (1 - 1e-9) <= abs(value) <= high * (1 + 1e-9)
        return np.asarray(good[place])

    def _at_work(self, parameters: Parameters) -> list[Influence]:
        """List influences that are not at their null."""
        known = ((value, self._influence(name)) for name, value in parameters.items())
        return [
            influence for value, influence in known if influence and np.any(value != influence.parameter.start)
        ]

    def _influence(self, name: str) -> Influence | None:
        return self._influences.get(name) or influence_of_law(name)

    @cached_property
    def _drivers(self) -> dict[str, Floats]:
        """What drives influences, of every run (n,)."""
        drivers = dict(zip(self.runs.noted_names, self.runs.noted.T, strict=True))
        if "tank_diameter" in drivers:
            drivers["head_over_tank"] = 2 * self.robot.head_radius / drivers["tank_diameter"]
        return drivers

    def _driver(self, name: str, parameters: Parameters) -> Floats:
        """Return what drives an influence, (n,), with the zero of the course where it is at `parameters`."""
        if name not in ("course_x", "course_y"):
            return self._drivers[name]
        x, y, zero = self._drivers["course_x"], self._drivers["course_y"], parameters.get(COURSE, 0.0)
        turned = x * np.cos(zero) + y * np.sin(zero), y * np.cos(zero) - x * np.sin(zero)
        return np.asarray(turned[0] if name == "course_x" else turned[1])

    def _across(self, parameters: Parameters) -> Floats:
        """Compute the derivative of the current along each path by the zero of the course, (n,)."""
        x, y = (parameters.get(name, 0.0) for name in CURRENT)
        return np.asarray(x * self._driver("course_y", parameters) - y * self._driver("course_x", parameters))

    def _conditions(self, parameters: Parameters, *, signed: bool = False) -> tuple[list[_Run], Integers]:
        """List runs to simulate at `parameters`, without duplicates, and the place of each run among them.

        The motor's direction matters if something odd is present, or if `signed`.
        """
        runs, work = self.runs, self._at_work(parameters)
        drivers = {i.needs: self._driver(i.needs, parameters) for i in work if i.needs}
        signed |= any(i.odd for i in work) or any(effect_named(e).symmetry == "odd" for e in self.robot.effects)
        omega = runs.omega if signed else np.abs(runs.omega)
        by_run = {name: value for name, value in parameters.items() if np.ndim(value)}
        table = np.column_stack([runs.tails, runs.length, omega, *by_run.values(), *drivers.values()]).round(9)
        _, first, place = np.unique(table, axis=0, return_index=True, return_inverse=True)
        listed = []
        for row in first.tolist():
            here = {**parameters, **{name: float(value[row]) for name, value in by_run.items()}}
            driven = {name: float(driver[row]) for name, driver in drivers.items()}
            at_work = self._at_work(here) if by_run else work
            listed.append(self._run(here, at_work, driven, row, float(omega[row])))
        return listed, place.reshape(-1)

    def _is_at_null(self, parameters: Parameters) -> bool:
        """Tell whether no effect is at work."""
        return not any(influence.effect for influence in self._at_work(parameters))

    def _run(
        self, parameters: Parameters, work: list[Influence], driven: Mapping[str, float], row: int, omega: float
    ) -> _Run:
        """Make the run of a row, from the influences at work in it and what drives them."""
        effects, current = dict(self.robot.effects), 0.0
        for influence in work:
            by = parameters[influence.parameter.name] - influence.parameter.start
            before = influence.parameter.start
            if influence.needs is not None:
                by *= driven[influence.needs]
                before = self.robot.effects.get(influence.effect or "", before)
            if influence.effect is not None:
                effects[influence.effect] = before + by
                if second := influence.parameter.second:
                    effects[second.name] = parameters.get(second.name, second.start)
            elif influence.parameter.name in CURRENT:
                current += by
        numbers = robot_numbers(self.robot, parameters)
        numbers["tail_length"] = float(self.runs.length[row]) + parameters.get(LENGTH, 0.0)
        tails = int(self.runs.tails[row])
        for influence in work:
            for name, power in influence.one_tail.items():
                numbers[name] *= (1 - parameters[influence.parameter.name] / tails) ** power
        robot = replace(
            self.robot, **numbers, tails=tails,
            motor_speed=abs(omega) * parameters.get(TACHOMETER, 1.0) * (1 - parameters.get(SLIP, 0.0)),
            effects=effects,
        )  # fmt: skip
        camera = parameters.get(CAMERA, 1.0)
        return _Run(robot, math.copysign(1.0, omega), parameters.get(TRACKED_POINT, 0.0), current, camera)

    def _columns(self, runs: list[_Run], sets: Sequence[Parameters]) -> dict[str, Floats]:
        """Write runs as columns for the simulator, with every effect that is present in any of the sets."""
        work = [i for parameters in sets for i in self._at_work(parameters)]
        names = {i.effect for i in work if i.effect} | {
            i.parameter.second.name for i in work if i.parameter.second
        }
        nulls = {name: np.full(len(runs), effect_named(name).null) for name in sorted(names)}
        columns = {**nulls, **group_columns([run.robot for run in runs])}
        columns["omega_bar"] = columns["omega_bar"] * np.array([run.sign for run in runs])
        return columns

    def _observation(self, runs: list[_Run]) -> Observation:
        return Observation(
            self.runs.outputs,
            time=np.array([run.robot.time_scale for run in runs]),
            length=np.array([run.robot.tail_length for run in runs]),
            ahead=np.array([run.robot.head_length / run.robot.tail_length for run in runs]),
            point=np.array([run.point for run in runs]),
            current=np.array([run.current for run in runs]),
            camera=np.array([run.camera for run in runs]),
        )


def _distinct(columns: dict[str, Floats]) -> tuple[dict[str, Floats], Integers]:
    """Leave out rows of columns (m,) that are equal to others, and return the place of each among the rest."""
    table = np.stack(list(columns.values()), 1)
    _, first, place = np.unique(table, axis=0, return_index=True, return_inverse=True)
    return {name: column[first] for name, column in columns.items()}, place.reshape(-1)


def _powers(name: str, influence: Influence | None) -> Mapping[str, float] | None:
    """Return the powers of the groups in a nuisance parameter, or in 1 − x/N for a fault of one tail."""
    if influence is None or not influence.one_tail:
        return POWERS.get(name)
    return {
        group: power * exponent
        for number, power in influence.one_tail.items()
        for group, exponent in POWERS.get(LENGTH if number == "tail_length" else number, {number: 1}).items()
    }


def _moves(name: str, influence: Influence | None) -> tuple[str, ...]:
    """Name the simulator's parameters that a parameter changes; none if it acts on what is seen."""
    powers = _powers(name, influence)
    if powers is not None:
        return tuple(group for group in powers if group in GROUPS)
    if influence is None:
        return (name,)
    if name == SLIP:
        return ("omega_bar",)
    return (influence.effect,) if influence.effect else ()


def robot_numbers(robot: Robot, parameters: Parameters) -> dict[str, Any]:
    """Collect fitted coefficients and numbers of the robot, by field; a is kept where R changes."""
    numbers: dict[str, Any] = {name: float(parameters[name]) for name in COEFFICIENTS}
    for name in POWERS:
        if hasattr(robot, name):
            numbers[name] = float(parameters.get(name, robot_number(robot, name)))
    return numbers
