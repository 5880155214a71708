"""The swimming robot with a law at one place: its exponents, size and lever are fitted like effects.

The factor m = exp(p · x) of a run depends on its inputs alone: x = (ln ω/ω_m, ln l/l_m, ln N/N_m) and the noted
inputs of the law less their means (`calibration.laws.readings`). With it

    a term is F = ε m v,   a coefficient C m,   a side force F_x = F with M_y = λ z F_x, z = l or L.

The disc is at J.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, cast

import numpy as np

from calibration.attribution.hypothesis import Hypothesis
from calibration.laws.places import Place, place_named
from calibration.laws.readings import EXPONENTS, INPUTS, NOTED, logarithms, noted_values, parameter_of
from calibration.statistics.statistical_model import Parameter, Parameters
from calibration.swimmer.influences import influence_of_law
from calibration.swimmer.measured_table import Measurements
from calibration.swimmer.swimmer import Inputs, SwimmerModel
from common.arrays import Floats
from common.errors import InputError
from sim.inputs import group_columns
from sim.model.groups import Groups
from sim.model.laws import STEEPEST, PowerLawEffect, Powers
from sim.model.robot import Robot

SIZE, LEVER = "law_size", "law_lever"
_LARGEST = 2000.0  # size of a term


def lever_arms(robot: Robot, runs: Measurements, unit: str) -> Floats:
    """Compute how far ahead of the disc a lever of 1 is in every run, in R, (n,): l/R or L/R."""
    return np.where(unit == "l", runs.length, robot.head_length) / robot.head_radius


def moved_parameter(robot: Robot, name: str) -> Parameter:
    """Return what a place moves as a parameter: a law's term, or a number of the robot, which may be exact."""
    if law := influence_of_law(name):
        return law.parameter
    return Parameter(name, name, robot.number(name), (0.0, math.inf), 1.0, logarithmic=True)


@dataclass(frozen=True)
class LawModel(SwimmerModel):
    """`SwimmerModel` with a law; what differs between the runs has an exponent, which is one of its effects."""

    place: Place = field(kw_only=True)
    typical: float = field(default=1.0, kw_only=True)  # a size of its term
    centre: tuple[float, ...] = field(kw_only=True)  # ln ω_m, ln l_m, ln N_m, and the means of `noted`
    noted: tuple[str, ...] = field(default=(), kw_only=True)  # inputs of NOTED on which the factor depends, too

    @classmethod
    def of(
        cls,
        model: SwimmerModel,
        place: Place,
        typical: float,
        centre: Sequence[float] | None = None,
        noted: Sequence[str] = (),
    ) -> LawModel:
        """Add a law to a model; its centre is by default that of the model's runs."""
        if centre is None:
            centre = [*logarithms(model.runs).mean(0), *noted_values(model.runs, noted).mean(0)]
        plain = (model.robot, model.runs, model.jobs, model.solver, model.own)
        middle = tuple(float(value) for value in centre)
        return cls(*plain, place=place, typical=abs(typical) or 1.0, centre=middle, noted=tuple(noted))

    @property
    def record(self) -> dict[str, Any]:
        """What makes this model of one without the law, see `with_law`."""
        noted = {"noted": list(self.noted)} if self.noted else {}
        return {"place": self.place.name, "typical": self.typical, "centre": list(self.centre), **noted}

    @property
    def exponents(self) -> tuple[str, ...]:
        """Names of the exponents, and of the coefficients of noted inputs."""
        return (*EXPONENTS, *map(parameter_of, self.noted))

    @cached_property
    def effects(self) -> tuple[Parameter, ...]:
        size = Parameter(SIZE, "size of the law", 0.0, (-_LARGEST, _LARGEST), self.typical)
        titles = (*(f"exponent of {symbol}" for symbol in INPUTS), *(NOTED[name].words for name in self.noted))
        # With a lever in tail lengths the couple has one power of l more than the force.
        steepest = {"law_length": STEEPEST - 1} if self.place.lever_unit == "l" else {}
        exponents = (
            Parameter(name, title, 0.0, (-STEEPEST, steepest.get(name, STEEPEST)), 1.0)
            for name, title in zip(self.exponents, titles, strict=True)
        )
        varied = np.ptp(self._inputs, axis=0) > 0
        chosen = [p for p, differs in zip(exponents, varied, strict=True) if differs]
        if self.place.lever_unit:
            middle = self.place.levers[len(self.place.levers) // 2]
            chosen.insert(0, Parameter(LEVER, "lever of the law", middle, self.place.lever_bounds, 0.5))
        return (size, *chosen) if self.place.is_term else tuple(chosen)

    @cached_property
    def _inputs(self) -> Floats:
        """Inputs (n, q) less their means; 0 for what these runs do not note."""
        values = np.concatenate([logarithms(self.runs), noted_values(self.runs, self.noted)], 1)
        return np.nan_to_num(values - np.array(self.centre), nan=0.0)

    def factor(self, parameters: Parameters) -> Floats:
        """Compute m of every run, (n,)."""
        return np.exp(self._inputs @ [parameters.get(name, 0.0) for name in self.exponents])

    def law(self, parameters: Parameters) -> tuple[PowerLawEffect, float, float]:
        """Return the law, at the means of noted inputs.

        Args:
            parameters: a size, exponents and a lever; the last two are rounded to thousandths.

        Returns:
            The law; its size; and the factor, at the control example over that at the mean of the runs, of the
            parameters that a law multiplies. The factor is 1 for a term: its size contains it.
        """
        powers = self.powers(parameters)
        law = self.place.law(powers, parameters.get(LEVER, 0.0))
        to_control = self.to_control(powers, parameters)
        return (law, parameters[SIZE] * to_control, 1.0) if self.place.is_term else (law, 1.0, to_control)

    def powers(self, parameters: Parameters) -> Powers:
        """Collect the exponents of ω, l and N."""
        return Powers(*(parameters.get(name, 0.0) for name in EXPONENTS))

    def to_control(self, powers: Powers, parameters: Parameters) -> float:
        """Compute the factor m, at the control example over that at the mean of the runs."""
        robots = self.robots({**parameters, **dict.fromkeys(self.exponents, 0.0)})
        logs = [powers.logarithm(Groups.from_columns(group_columns([run])))[0] for run in robots]
        return math.exp(-float(np.mean(logs)))

    def of_runs(self, parameters: Parameters) -> dict[str, Any]:
        """Return the parameters of the model without the law, with what it moves for every run, (n,)."""
        inner = {name: value for name, value in parameters.items() if name not in (SIZE, LEVER, *self.exponents)}
        m = self.factor(parameters)
        if self.place.is_term:
            loads = [parameters.get(SIZE, 0.0) * m]
            if self.place.lever_unit:
                arms = lever_arms(self.robot, self.runs, self.place.lever_unit)
                loads.append(loads[0] * parameters.get(LEVER, 0.0) * arms)
            for (name, _), load in zip(self.place.moves, loads, strict=True):
                inner[name] = load
        else:
            for name, power in self.place.moves:
                inner[name] = inner.get(name, self.robot.number(name)) * m**power
        return inner

    def inputs_of_runs(self, sets: Sequence[Parameters]) -> Inputs:
        """Compute what is simulated, see `SwimmerModel.inputs_of_runs`."""
        return super().inputs_of_runs([self.of_runs(p) for p in sets])


def with_law(model: SwimmerModel, record: Mapping[str, Any]) -> LawModel:
    """Add the law of a record to a model.

    Raises:
        InputError: the record is none of a law.
    """
    try:
        place, typical = place_named(str(record["place"])), float(record["typical"])
        centre = [float(value) for value in record["centre"]]
        noted = [str(name) for name in record.get("noted", ())]
        if (
            len(centre) != len(INPUTS) + len(noted)
            or not set(noted) <= set(NOTED)
            or not np.isfinite([typical, *centre]).all()
        ):
            raise ValueError
    except (KeyError, TypeError, ValueError, OverflowError):
        raise InputError("the record of a law cannot be read: calibrate the table again") from None
    return LawModel.of(model, place, typical, centre, noted)


def law_model(law: Hypothesis) -> LawModel:
    """Return the model of a law."""
    return cast(LawModel, law.model)
