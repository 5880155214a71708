"""The corrected robot with a law, and how sure it is: what a calibration hands on where a law describes the runs.

The law is an effect by its name (`sim.model.power_law`), whose factor is 1 at the paper's control example; that of
the fit is 1 at the geometric mean of the runs. So the size of a term, or the coefficient that a factor multiplies,
is written for the control example. Exponents are rounded to thousandths.

The uncertainty of the exponents is handed on as that of the load at this robot: with x the logarithm of its inputs
over those of the mean,

    term:    δε/ε = δε_m/ε_m + Σ x_i δp_i,
    factor:  δ ln C = δ ln C_m + Σ x_i δp_i.

A side force with a lever is handed on as what it is at the disc, a force and a couple, so that the uncertainty of
its lever is that of the couple: δM/M = δε/ε + δλ/λ. Noted inputs are at the means of the runs.

The range of the runs goes into the table [learnt_from] (`sim.model.learnt_range`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibration.laws.inputs import EXPONENTS
from calibration.laws.law import Law
from calibration.laws.law_model import LEVER, SIZE
from calibration.report.corrected_robot import calibration_knowledge, corrected_robot, significant
from calibration.statistics.held_out import FinalRefit, refit_to_all
from calibration.statistics.statistical_model import Parameters
from planner.vehicle.calibration_table import CalibrationKnowledge
from sim.arrays import Flags, Floats
from sim.model.learnt_range import learnt_range
from sim.model.power_law import force_law
from sim.model.presets import CONTROL
from sim.model.robot import Robot


def law_handed_on(given: Robot, law: Law, rows: Flags) -> tuple[Robot, CalibrationKnowledge]:
    """Return the corrected robot with a law, fitted once more to the runs in `rows` (n,), and its covariance."""
    final = refit_to_all(law.model, law.fit, rows)
    robot = robot_with_law(given, law, final.parameters)
    known = calibration_knowledge(given, final, _slopes(robot, law, final))
    return significant(robot, known), known


def robot_with_law(given: Robot, law: Law, parameters: Parameters) -> Robot:
    """Return the corrected robot with a law as an effect.

    Args:
        parameters: of the law's model.
    """
    effects, factor = effects_of_law(law, parameters)
    written = dict(parameters)
    for name, power in law.place.moves:
        if not law.place.is_term:
            written[name] *= factor**power
    corrected = corrected_robot(given, written)
    runs = law.model.robots({**written, **dict.fromkeys(law.model.exponents, 0.0)})[0]
    return replace(
        corrected,
        effects={**corrected.effects, **effects},
        learnt_from=learnt_range(run.group_values() for run in runs),
    )


def effects_of_law(law: Law, parameters: Parameters) -> tuple[dict[str, float], float]:
    """Return the sizes of a law's effects, in the order of its moves, and the factor of `LawModel.effect`."""
    model = law.model
    effect, size, factor = model.effect(parameters)
    if not law.place.lever_unit:
        return {effect.name: size}, factor
    powers, motion = model.powers(parameters), law.place.motion
    if law.place.lever_unit == "l":  # l/R is l/l_c times that of the control example
        couple_powers, arm = replace(powers, length=powers.length + 1), CONTROL.l_over_R
    else:
        couple_powers, arm = powers, model.robot.head_length / model.robot.head_radius
    couple = size * parameters[LEVER] * arm
    return {
        force_law("Fx", motion, powers).name: size,
        force_law("My", motion, couple_powers).name: couple,
    }, factor


def _slopes(robot: Robot, law: Law, final: FinalRefit) -> dict[str, Floats]:
    """Compute how the load at this robot depends on the numbers of its law, (p,) each."""
    inputs = np.log([robot.motor_speed, robot.tail_length, robot.tails]) - np.array(
        law.model.centre[: len(EXPONENTS)]
    )
    exponents, size, lever = np.zeros((3, len(final.fitted)))
    for place, parameter in enumerate(final.fitted):
        if parameter.name in EXPONENTS:
            exponents[place] = inputs[EXPONENTS.index(parameter.name)]
        elif parameter.name == SIZE:
            size[place] = 1 / final.parameters[SIZE]
        elif parameter.name == LEVER:
            lever[place] = 1 / final.parameters[LEVER]
    if not law.place.is_term:
        return {name: power * exponents for name, power in law.place.moves}
    names = list(effects_of_law(law, final.parameters)[0])
    slopes = {name: robot.effects[name] * (exponents + size) for name in names}
    if law.place.lever_unit:
        slopes[names[1]] = slopes[names[1]] + robot.effects[names[1]] * lever
    return slopes
