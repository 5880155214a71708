"""What a calibration hands on: the corrected robot, and how sure it is, as corrected.toml.

The covariance is that of the fit to all runs. It goes into the table [calibration], which the planner reads
(`sim.knowledge`). What belongs to the way of measuring is left out: the camera, the zero of
the heading, the tachometer, the tracked point, slip of the motor and drift between runs. The errors of what is
kept contain the errors of these. A current in the tank is stated on its own.

**A law** is an effect by its name (`sim.model.laws`), whose factor is 1 at the paper's control example; that
of the fit is 1 at the geometric mean of the runs. So the size of a term, or the coefficient that a factor
multiplies, is written for the control example. Exponents are rounded to thousandths.

The uncertainty of the exponents is handed on as that of the load at this robot: with x the logarithm of its inputs
over those of the mean,

    term:    δε/ε = δε_m/ε_m + Σ x_i δp_i,
    factor:  δ ln C = δ ln C_m + Σ x_i δp_i.

A side force with a lever is handed on as what it is at the disc, a force and a couple, so that the uncertainty of
its lever is that of the couple: δM/M = δε/ε + δλ/λ. Noted inputs are at the means of the runs.

The range of the runs goes into the table [learnt_from] (`sim.model.learnt_range`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from calibration.attribution.hypothesis import Hypothesis
from calibration.laws.law_model import LEVER, SIZE, law_model
from calibration.laws.readings import EXPONENTS
from calibration.statistics.statistical_model import Parameters
from calibration.statistics.study import FinalRefit, final_refit
from calibration.swimmer.influences import CURRENT, LENGTH
from calibration.swimmer.swimmer import robot_numbers
from common.arrays import Flags, Floats
from common.errors import InputError
from common.reading import sealed
from common.units import from_si, to_si
from sim.effects import catalogue, effect_named, is_effect
from sim.knowledge import NUMBERS, CalibrationKnowledge, knowledge_toml
from sim.model.entries import ENTRIES
from sim.model.laws import Load, make_law
from sim.model.learnt_range import learnt_range
from sim.model.presets import CONTROL
from sim.model.robot import Robot
from sim.model.robot_toml import robot_toml
from surrogate.domain import COEFFICIENTS

_CERTAIN = 1e-12  # least variance of a logarithm, and of a correlated combination of them


def check_given(robot: Robot) -> None:
    """Refuse a robot that already has a law: its table of runs belongs to the robot as given."""
    if robot.learnt_from is not None:
        raise InputError(
            f"robot {robot.name!r} has a table [learnt_from] from an earlier calibration: calibrate the robot as "
            "it was given, with the runs of both"
        )


def corrected_robot(robot: Robot, parameters: Parameters) -> Robot:
    """Return `robot` with fitted coefficients, numbers and effects, without drift between runs."""
    numbers = robot_numbers(robot, parameters)
    numbers["tail_length"] = robot.tail_length + parameters.get(LENGTH, 0.0)
    sizes = {
        name: float(value)
        for name, value in parameters.items()
        if is_effect(name) and value != effect_named(name).null
    }
    return replace(robot, **numbers, effects={**robot.effects, **sizes})


def calibration_knowledge(
    robot: Robot, final: FinalRefit, further: Mapping[str, Floats] | None = None
) -> CalibrationKnowledge:
    """Collect the covariance of the corrected robot's parameters and effects, and the current in the tank.

    Args:
        robot: as it was given; the error of the tail length is one of ln l of this robot.
        further: how effects, and parameters beyond their own derivative, depend on what was fitted: name -> (p,).
    """
    length = robot.tail_length + final.parameters.get(LENGTH, 0.0)
    slopes: dict[str, Floats] = {}  # name -> (p,)
    for place, parameter in enumerate(final.fitted):
        if parameter.name in (*COEFFICIENTS, *NUMBERS, *catalogue(), LENGTH):
            of_length = parameter.name == LENGTH
            row = np.zeros(len(final.fitted))
            row[place] = 1 / length if of_length else 1.0
            slopes["tail_length" if of_length else parameter.name] = row
    for name, row in (further or {}).items():
        slopes[name] = slopes.get(name, np.zeros(len(final.fitted))) + row
    names = tuple(slopes)
    table = np.array([slopes[name] for name in names]).reshape(len(names), len(final.fitted))
    covariance = table @ final.covariance @ table.T
    places = {parameter.name: i for i, parameter in enumerate(final.fitted)}
    current = [(final.parameters[n], places[n]) if n in places else (0.0, None) for n in CURRENT]
    errors = [0.0 if at is None else math.sqrt(final.covariance[at, at]) for _, at in current]
    return CalibrationKnowledge(
        names=names,
        covariance=(covariance + covariance.T) / 2,  # rounding
        current=(current[0][0], current[1][0]),
        current_error=(errors[0], errors[1]),
    )


def as_toml(robot: Robot, known: CalibrationKnowledge, notes: Sequence[str] = ()) -> str:
    """Write a robot and what a calibration knows about it, notes as comments, with a digest."""
    comments = "".join(f"# {note}\n" for note in notes)
    return sealed(robot_toml(robot) + "\n" + comments + knowledge_toml(known))


def handed_on(robot: Robot, final: FinalRefit) -> tuple[Robot, CalibrationKnowledge]:
    """Return the corrected robot and what is known about it."""
    known = calibration_knowledge(robot, final)
    return significant(corrected_robot(robot, final.parameters), known), known


def significant(robot: Robot, known: CalibrationKnowledge) -> Robot:
    """Round what was fitted to two digits of its standard deviation, all others being known."""
    scale = np.sqrt(np.maximum(np.diag(known.covariance), _CERTAIN))
    correlation = known.covariance / np.outer(scale, scale)
    precision = np.diag(np.linalg.inv(correlation + _CERTAIN * np.eye(len(scale))))
    sigmas = dict(zip(known.names, (scale / np.sqrt(precision)).tolist(), strict=True))
    units = {entry.field: entry.unit for entry in ENTRIES}
    numbers = {name: getattr(robot, name) for name in (*COEFFICIENTS, *NUMBERS) if name in sigmas}
    rounded: dict[str, Any] = {
        name: _rounded(value, value * sigmas[name], units[name]) for name, value in numbers.items() if value
    }
    return replace(
        robot,
        **rounded,
        effects={name: _rounded(size, sigmas.get(name, 0.0)) for name, size in robot.effects.items()},
    )


def _rounded(value: float, sigma: float, unit: str = "") -> float:
    """Round a number in the unit in which it is written."""
    if not sigma:
        return value
    number, error = (from_si(size, unit) if unit else size for size in (value, abs(sigma)))
    rounded = round(number, 1 - math.floor(math.log10(error)))
    return to_si(rounded, unit) if unit else rounded


def law_handed_on(given: Robot, law: Hypothesis, rows: Flags) -> tuple[Robot, CalibrationKnowledge]:
    """Return the corrected robot with a law, fitted once more to the runs in `rows` (n,), and its covariance."""
    final = final_refit(law.fitted.refitted(law.model.runs, rows))
    robot = robot_with_law(given, law, final.parameters)
    known = calibration_knowledge(given, final, _slopes(robot, law, final))
    return significant(robot, known), known


def robot_with_law(given: Robot, law: Hypothesis, parameters: Parameters) -> Robot:
    """Return the corrected robot with a law as an effect, by parameters of the law's model."""
    effects, factor = effects_of_law(law, parameters)
    written, model = dict(parameters), law_model(law)
    for name, power in model.place.moves:
        if not model.place.is_term:
            written[name] *= factor**power
    corrected = corrected_robot(given, written)
    runs = model.robots({**written, **dict.fromkeys(model.exponents, 0.0)})
    return replace(
        corrected,
        effects={**corrected.effects, **effects},
        learnt_from=learnt_range(run.group_values() for run in runs),
    )


def effects_of_law(law: Hypothesis, parameters: Parameters) -> tuple[dict[str, float], float]:
    """Return the sizes of a law's effects, in the order of its moves, and the factor of `LawModel.law`."""
    model = law_model(law)
    at_place, size, factor = model.law(parameters)
    if not model.place.lever_unit:
        return {at_place.name: size}, factor
    powers, motion = model.powers(parameters), model.place.motion
    if model.place.lever_unit == "l":  # l/R is l/l_c times that of the control example
        couple_powers, arm = replace(powers, length=powers.length + 1), CONTROL.l_over_R
    else:
        couple_powers, arm = powers, model.robot.head_length / model.robot.head_radius
    couple = size * parameters[LEVER] * arm
    return {
        make_law(Load("Fx", motion).place, powers).name: size,
        make_law(Load("My", motion).place, couple_powers).name: couple,
    }, factor


def _slopes(robot: Robot, law: Hypothesis, final: FinalRefit) -> dict[str, Floats]:
    """Compute how the load at this robot depends on the numbers of its law, (p,) each."""
    model = law_model(law)
    centre = np.array(model.centre[: len(EXPONENTS)])
    inputs = np.log([robot.motor_speed, robot.tail_length, robot.tails]) - centre
    exponents, size, lever = np.zeros((3, len(final.fitted)))
    for place, parameter in enumerate(final.fitted):
        if parameter.name in EXPONENTS:
            exponents[place] = inputs[EXPONENTS.index(parameter.name)]
        elif parameter.name == SIZE:
            size[place] = 1 / final.parameters[SIZE]
        elif parameter.name == LEVER:
            lever[place] = 1 / final.parameters[LEVER]
    if not model.place.is_term:
        return {name: power * exponents for name, power in model.place.moves}
    names = list(effects_of_law(law, final.parameters)[0])
    slopes = {name: robot.effects[name] * (exponents + size) for name in names}
    if model.place.lever_unit:
        slopes[names[1]] = slopes[names[1]] + robot.effects[names[1]] * lever
    return slopes
