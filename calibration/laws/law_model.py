"""The swimming robot with a law at one place: its exponents and size are fitted like effects.

The factor m of a run depends on its inputs alone. So the derivatives along the size and the exponents follow from
the one along the term, or along the logarithm of the coefficient:

    term F = ε m v:    ∂f/∂ε = m ∂f/∂F,   ∂f/∂p_i = ε m x_i ∂f/∂F,
    factor C m:        ∂f/∂p_i = x_i ∂f/∂ln C,

with x = (ln ω/ω_m, ln l/l_m, ln N/N_m).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from calibration.laws.places import Place, place_named
from calibration.laws.readings import INPUTS
from calibration.statistics.statistical_model import Parameter, Parameters, by_differences
from calibration.swimmer.measured_table import Measurements
from calibration.swimmer.swimmer import SwimmerModel, _Run
from sim.arrays import Floats
from sim.effects import effect_named
from sim.inputs import group_columns
from sim.io.errors import InputError
from sim.model.effect import Effect
from sim.model.groups import Groups
from sim.model.power_law import STEEPEST, Powers

SIZE = "law_size"
EXPONENTS = ("law_speed", "law_length", "law_tails")
_LARGEST = 200.0  # size of a term


def logarithms(runs: Measurements) -> Floats:
    """Compute ln ω, ln l, ln N of every run, (n, 3), in rad/s and m."""
    return np.asarray(np.log(np.stack([np.abs(runs.omega), runs.length, runs.tails], 1)))


@dataclass(frozen=True)
class LawModel(SwimmerModel):
    """`SwimmerModel` with a law; the exponents of inputs that differ between the runs are its effects."""

    place: Place = field(kw_only=True)
    typical: float = field(default=1.0, kw_only=True)  # a size of its term
    centre: tuple[float, ...] = field(kw_only=True)  # ln ω_m, ln l_m, ln N_m

    @classmethod
    def of(
        cls, model: SwimmerModel, place: Place, typical: float, centre: Sequence[float] | None = None
    ) -> LawModel:
        """Add a law to a model.

        Args:
            typical: a size of its term.
            centre: ln ω_m, ln l_m, ln N_m; default: the means of the model's runs.
        """
        middle = logarithms(model.runs).mean(0).tolist() if centre is None else centre
        plain = (model.robot, model.runs, model.jobs, model.solver, model.own)
        return cls(*plain, place=place, typical=abs(typical) or 1.0, centre=tuple(middle))

    @property
    def record(self) -> dict[str, Any]:
        """What makes this model of one without the law, see `with_law`."""
        return {"place": self.place.name, "typical": self.typical, "centre": list(self.centre)}

    @cached_property
    def effects(self) -> tuple[Parameter, ...]:
        size = Parameter(SIZE, "size of the law", 0.0, (-_LARGEST, _LARGEST), self.typical)
        exponents = (
            Parameter(name, f"exponent of {symbol}", 0.0, (-STEEPEST, STEEPEST), 1.0)
            for name, symbol in zip(EXPONENTS, INPUTS, strict=True)
        )
        varied = np.ptp(self._logarithms, axis=0) > 0
        chosen = tuple(p for p, differs in zip(exponents, varied, strict=True) if differs)
        return (size, *chosen) if self.place.is_term else chosen

    @cached_property
    def _logarithms(self) -> Floats:
        return logarithms(self.runs) - np.array(self.centre)

    def factor(self, parameters: Parameters) -> Floats:
        """Compute m of every run, (n,)."""
        return np.exp(self._logarithms @ [parameters.get(name, 0.0) for name in EXPONENTS])

    def effect(self, parameters: Parameters) -> tuple[Effect, float, float]:
        """Return the law as an effect.

        Args:
            parameters: a size and exponents, which are rounded to thousandths.

        Returns:
            The effect; its size; and the factor, at the control example over that at the mean of the runs, of the
            parameters that a law multiplies. The factor is 1 for a term: its size contains it.
        """
        powers = Powers(*(parameters.get(name, 0.0) for name in EXPONENTS))
        robots, place = self.robots({**parameters, **dict.fromkeys(EXPONENTS, 0.0)})
        logarithms = np.array([powers.logarithm(Groups.from_columns(group_columns([run])))[0] for run in robots])
        to_control = math.exp(-float(logarithms[place].mean()))
        effect = self.place.effect(powers)
        return (effect, parameters[SIZE] * to_control, 1.0) if self.place.is_term else (effect, 1.0, to_control)

    def derivatives(
        self, parameters: Parameters, names: Sequence[str], *, title: str = "", quick: bool = False
    ) -> tuple[Floats, Floats]:
        """Compute the prediction (n, k) and derivatives (n, k, p), see `SwimmerModel.derivatives`."""
        of_law = {SIZE, *EXPONENTS}
        others = [name for name in names if name not in of_law]
        moved = [name for name, _ in self.place.moves]
        known = {name: 1.0 for name in moved if self.place.is_term} | dict(parameters)
        wanted = list(dict.fromkeys([*others, *moved]))
        seen, table = super().derivatives(known, wanted, title=title, quick=True)
        if not quick and not (np.isfinite(table).all() and np.isfinite(seen).all()):
            return by_differences(self, parameters, names, title=title)
        m = self.factor(parameters)
        slopes = {name: table[..., j] for j, name in enumerate(wanted)}
        along = np.zeros(seen.shape)
        for name, power in self.place.moves:
            # The derivative along the logarithm of a coefficient is scaled by its value without m.
            if name in {p.name for p in self.coefficients}:
                slopes[name] = slopes[name] * (m**power)[:, None]
            along += power * slopes[name]
        if self.place.is_term:
            slopes[SIZE] = along * m[:, None]
            along = slopes[SIZE] * parameters[SIZE]
        for i, name in enumerate(EXPONENTS):
            slopes[name] = along * self._logarithms[:, [i]]
        return seen, np.stack([slopes[name] for name in names], -1)

    def _run(self, parameters: Parameters, row: int, omega: float) -> _Run:
        run = super()._run(parameters, row, omega)
        m = math.exp(float(self._logarithms[row] @ [parameters.get(name, 0.0) for name in EXPONENTS]))
        robot = run.robot
        for name, power in self.place.moves:
            if self.place.is_term:
                low, high = effect_named(name).bounds
                size = min(max(parameters.get(SIZE, 0.0) * m, low), high)
                robot = replace(robot, effects={**robot.effects, name: size})
            else:
                robot = replace(robot, **{name: getattr(robot, name) * m**power})
        return run._replace(robot=robot)


def with_law(model: SwimmerModel, record: Mapping[str, Any]) -> LawModel:
    """Add the law of a record to a model.

    Raises:
        InputError: the record is none of a law.
    """
    try:
        place, typical = place_named(str(record["place"])), float(record["typical"])
        centre = [float(value) for value in record["centre"]]
        if len(centre) != len(INPUTS) or not np.isfinite([typical, *centre]).all():
            raise ValueError
    except (KeyError, TypeError, ValueError, OverflowError):
        raise InputError("the record of a law cannot be read: calibrate the table again") from None
    return LawModel.of(model, place, typical, centre)
