"""What a calibration hands on: the corrected robot, and how sure it is, as corrected.toml.

The covariance is that of the fit to all runs. It goes into the table [calibration], which the planner reads
(`planner.vehicle.calibration_table`). What belongs to the way of measuring is left out: the camera, the zero of
the heading, the tachometer, the tracked point, slip of the motor and drift between runs. The errors of what is
kept contain the errors of these. A current in the tank is stated on its own.

Where no effect explains the runs, a correction goes into the table [correction] (`sim.model.correction`). Its
uncertainty is that of its weights and of what it leaves beyond noise, at the robot of the file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from calibration.statistics.held_out import FinalRefit
from calibration.statistics.statistical_model import Parameters
from calibration.swimmer.candidate_effects import CURRENT
from calibration.swimmer.head_correction import HeadCorrection
from calibration.swimmer.nuisance_numbers import LENGTH
from calibration.swimmer.swimmer import robot_numbers
from calibration.verdict.experiment import LearntCorrection
from planner.vehicle.calibration_table import NUMBERS, CalibrationKnowledge, knowledge_toml
from sim.arrays import Floats
from sim.effects import catalogue
from sim.io.errors import InputError
from sim.io.seals import sealed
from sim.io.units import from_si, to_si
from sim.model.robot import Robot
from sim.model.robot_toml import ENTRIES, robot_toml
from surrogate.input_ranges import COEFFICIENTS

_CERTAIN = 1e-12  # least variance of a logarithm, and of a correlated combination of them


def check_given(robot: Robot) -> None:
    """Refuse a robot that already has a correction or a law: its table of runs belongs to the robot as given."""
    for table, held in (("correction", robot.correction), ("learnt_from", robot.learnt_from)):
        if held is not None:
            raise InputError(
                f"robot {robot.name!r} has a table [{table}] from an earlier calibration: calibrate the robot as "
                "it was given, with the runs of both"
            )


def corrected_robot(robot: Robot, parameters: Parameters) -> Robot:
    """Return `robot` with fitted coefficients, numbers and effects, without drift between runs."""
    numbers = robot_numbers(robot, parameters)
    numbers["tail_length"] = robot.tail_length + parameters.get(LENGTH, 0.0)
    sizes = {
        name: float(value)
        for name, value in parameters.items()
        if name in catalogue() and value != catalogue()[name].null
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


def corrected_toml(robot: Robot, final: FinalRefit, learnt: LearntCorrection | None = None) -> str:
    """Write corrected.toml, with the correction that was `learnt` where nothing explains the runs."""
    return as_toml(*handed_on(robot, final, learnt))


def as_toml(robot: Robot, known: CalibrationKnowledge) -> str:
    """Write a robot and what a calibration knows about it, with a digest."""
    return sealed(robot_toml(robot) + "\n" + knowledge_toml(known))


def handed_on(
    robot: Robot, final: FinalRefit, learnt: LearntCorrection | None = None
) -> tuple[Robot, CalibrationKnowledge]:
    """Return the corrected robot and what is known about it, see `corrected_toml`."""
    corrected = corrected_robot(robot, final.parameters)
    known = calibration_knowledge(robot, final)
    if isinstance(learnt, HeadCorrection):
        known = _with_correction(known, learnt, corrected)
        corrected = replace(corrected, correction=learnt.correction)
    return significant(corrected, known), known


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


def _with_correction(known: CalibrationKnowledge, learnt: HeadCorrection, robot: Robot) -> CalibrationKnowledge:
    """Add the uncertainty of the correction at this robot; nothing if the robot is outside the runs."""
    values = robot.group_values()
    try:
        learnt.correction.applied(values)
    except InputError:
        return known
    knobs = tuple(learnt.correction.weights)
    names = (*known.names, *(name for name in knobs if name not in known.names))
    covariance = np.zeros((len(names), len(names)))
    covariance[: len(known.names), : len(known.names)] = known.covariance
    places = [names.index(name) for name in knobs]
    covariance[np.ix_(places, places)] += learnt.knob_covariance(values)
    return replace(known, names=names, covariance=covariance)
