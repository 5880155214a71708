"""Which runs are possible: units of a table that cannot be right, and what a lab can set in its next runs.

Columns that are wrong by a factor that is not possible are refused. Inputs are checked before anything is
simulated. Outputs are compared with the model as given.

Without a word from the lab, the next runs have the table's numbers of tails and lengths, because others may have
to be built, and its fastest speed and slower ones. A lab says what it has as "N=2,3,4", "l_cm=5,7,9" and
"omega_rpm=60,120".
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from calibration.statistics.lab_settings import LabSettings
from calibration.swimmer.measured_table import Measurements
from common.arrays import Floats
from common.errors import InputError
from common.run_columns import check_factor
from sim.model.groups import MOST_TAILS
from sim.model.robot import Robot

SHORTEST, LONGEST, FASTEST = 0.5, 50, 1000  # tails in head radii, ω̄
SLIPS = 3.0  # factor of the spins' sum
_SPINS = 4.0  # factor of the yaw rate beyond which all other spins may be in another unit

SETTINGS = ("N", "l_cm", "omega_rpm")
_LENGTHS = 6  # of many, spread evenly
_SPEEDS = (0.4, 0.7, 1.0)  # of the fastest


def check_inputs(robot: Robot, runs: Measurements) -> None:
    """Refuse tail lengths and motor speeds that seem to be in another unit."""
    longest = float(runs.length.max())
    for length in (longest, float(runs.length.min())):
        if not SHORTEST < length / robot.head_radius < LONGEST:
            raise InputError(
                f"l_cm = {100 * length:.3g} is {length / robot.head_radius:.3g} head radii "
                f"({SHORTEST} to {LONGEST} are possible); check its unit and the radius of the head in robot.toml"
            )
    fastest = float(np.abs(runs.omega).max())
    speed = fastest * replace(robot, tail_length=longest, motor_speed=fastest).time_scale
    if not speed < FASTEST:
        raise InputError(
            f"omega_rpm = {fastest * 30 / math.pi:.4g} with l_cm = {100 * longest:.3g} gives ω̄ = {speed:.3g} "
            f"(below {FASTEST} is possible); check the units of both, and robot.toml"
        )


def check_outputs(runs: Measurements, prediction: Floats) -> None:
    """Refuse outputs that seem to be in another unit, by the prediction (n, k) of the model as given."""
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
        check_factor(name, factor, _all_spins(factor) if name == "omega_yr" else "")


def _all_spins(factor: float) -> str:
    """Say that the yaw rate may be right and all other spins be in another unit, which agrees with their sum."""
    if 1 / _SPINS < factor < _SPINS:
        return ""
    meant, stated = ("rad/s", "rpm") if factor > 1 else ("rpm", "rad/s")
    return f"; or the spins of motor, head and tails are all in {meant} where {stated} is stated"


def check_lab_settings(own: LabSettings) -> None:
    """Refuse settings that no run can have."""
    for name, values in own.items():
        if name not in SETTINGS:
            raise InputError(f"settings of the next runs: {name!r} is none of {', '.join(SETTINGS)}")
        for value in values:
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"settings of the next runs: {name} = {value:g}; it must be positive")
            if name == "N" and not (value == int(value) and value <= MOST_TAILS):
                raise InputError(
                    f"settings of the next runs: N = {value:g}; the number of tails is an integer from 1 to "
                    f"{MOST_TAILS}"
                )


def possible_settings(runs: Measurements, own: LabSettings) -> Floats:
    """List N, l_cm and omega_rpm of every run that can be made next, (m, 3); both directions."""
    cm, rpm = 100 * runs.length, np.abs(runs.omega).max() * 30 / math.pi
    default = {
        "N": runs.tails,
        "l_cm": _some(np.unique(cm.round(3))),
        "omega_rpm": (rpm * np.array(_SPEEDS)).round(1),
    }
    tails, lengths, speeds = (np.unique(own.get(name, default[name])).astype(float) for name in SETTINGS)
    return np.array([(n, a, w) for n in tails for a in lengths for w in (*speeds, *-speeds)])


def _some(lengths: Floats) -> Floats:
    """Choose at most `_LENGTHS` of sorted lengths, the shortest and the longest among them."""
    places = np.linspace(0, len(lengths) - 1, min(len(lengths), _LENGTHS)).round().astype(int)
    return np.asarray(lengths[places])
