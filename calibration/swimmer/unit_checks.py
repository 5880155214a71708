"""Checks of units: columns that are wrong by a factor that is not possible are refused.

Inputs are checked before anything is simulated. Outputs are compared with the model as given.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from calibration.swimmer.measured_table import OUTPUTS, Measurements
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.model.robot import Robot

SHORTEST, LONGEST, FASTEST = 0.5, 50, 1000  # tails in head radii, ω̄
OFF, SLIPS = 20.0, 3.0  # factors: of an output, of the spins' sum


def check_inputs(robot: Robot, runs: Measurements) -> None:
    """Tail lengths and motor speeds.

    Raises:
        InputError: l_cm or omega_rpm seems to be in another unit.
    """
    longest = float(runs.length.max())
    for length in (longest, float(runs.length.min())):
        if not SHORTEST < length / robot.head_radius < LONGEST:
            raise InputError(
                f"l_cm = {100 * length:.3g} is {length / robot.head_radius:.3g} head radii "
                f"({SHORTEST} to {LONGEST} are possible); check its unit and head_radius in robot.toml"
            )
    fastest = float(np.abs(runs.omega).max())
    speed = fastest * replace(robot, tail_length=longest, motor_speed=fastest).time_scale
    if not speed < FASTEST:
        raise InputError(
            f"omega_rpm = {fastest * 30 / math.pi:.4g} with l_cm = {100 * longest:.3g} gives ω̄ = {speed:.3g} "
            f"(below {FASTEST} is possible); check the units of both, and robot.toml"
        )


def check_outputs(runs: Measurements, prediction: Floats) -> None:
    """Outputs against the prediction (n, k) of the model as given.

    Raises:
        InputError: an output seems to be in another unit.
    """
    y = {name: runs.y[:, i] for i, name in enumerate(runs.outputs)}
    if "omega_h" in y and "omega_t" in y:
        share = float(np.median((np.exp(y["omega_h"]) + np.exp(y["omega_t"])) / np.abs(runs.omega)))
        if not 1 / SLIPS < share < SLIPS:
            raise InputError(
                f"omega_h_rpm and omega_t_rpm add up to {share:.3g} times omega_rpm; the motor turns the head "
                "against the tails, so all three must be in rpm"
            )
    for i, name in enumerate(runs.outputs):
        theirs, ours = np.median(runs.y[:, i]), np.median(prediction[:, i])
        factor = float(theirs / ours if name == "theta" else math.exp(theirs - ours))
        if not 1 / OFF < factor < OFF:
            raise InputError(
                f"{OUTPUTS[name][0]} is {factor:.3g} times what the robot as given does; "
                "check its unit, those of l_cm and omega_rpm, and robot.toml"
            )
