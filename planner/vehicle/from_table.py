"""The vehicle that a look-up table gives for a robot: both directions, what is uncertain, and the current."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.coefficient_modes import STEADY, Motion, both_directions, coefficient_modes, mirrored
from planner.vehicle.vehicle import Mode, Vehicle, lag_table, resampled
from sim.arrays import Floats
from sim.effects.tail_contact import EFFECT as CONTACT
from sim.effects.tail_contact import least_gap
from sim.io.errors import InputError
from sim.mechanics import planar
from sim.model.robot import Robot
from surrogate.answers import refusing_robots
from surrogate.interface import ErrorModes, LookupTable

_TIME_STEPS = 2.5e-4  # of the yaw rate, one standard deviation: error of time steps (`sim.motion.resolution`)
_ODD = 0.2  # share of a table's error that has opposite signs in the two directions


def default_table() -> LookupTable:
    """Load the table that comes with the package."""
    from surrogate.table_file import load  # loads PyTorch, which the import of a plan does not need

    return load()


def table_vehicle(robot: Robot, lookup: LookupTable, knowledge: CalibrationKnowledge | None = None) -> Vehicle:
    """Ask a look-up table for the vehicle of a robot.

    Args:
        robot: the robot.
        lookup: a trained table, or the table of this robot.
        knowledge: what a calibration found besides the robot: covariance of its coefficients, a current.

    Raises:
        InputError: the robot is outside the table's domain, or moves backwards on average.
    """
    knowledge = knowledge or CalibrationKnowledge()
    columns = both_directions(robot.group_values())
    with refusing_robots([robot, robot], lookup):
        motion = lookup.query(columns)
    twist = _twists(motion)
    curves = lookup.response(columns)
    if curves.failed.any():
        raise InputError("the response of this robot to a flip could not be found; turn its motor slower")
    speed = twist[:, 0].mean()
    if speed <= 0:
        raise InputError(f"robot {robot.name!r} does not move forward (v_z = {speed:.3g}); turn its motor slower")
    if (twist[:, 2] * [1.0, -1.0] <= 0).any():
        raise InputError(f"robot {robot.name!r} turns to the same side in both directions of its motor; it cannot "
                         "follow a path")  # fmt: skip
    lag = mirrored(np.stack([lag_table(curves.lag[i], curves.memory[i], curves.before) for i in (0, 1)]))
    unit = robot.time_scale / robot.tail_length  # from m/s
    return Vehicle(
        twist=twist,
        lag=lag,
        rest=mirrored(resampled(curves.rest)),
        spread=resampled(curves.spread),
        phase_rate=robot.tails * motion["omega_t_bar"],
        modes=(
            *_table_modes(twist, lookup.error_modes(columns)),
            *coefficient_modes(robot, lookup, Motion(twist, lag), knowledge),
        ),
        current=np.asarray(knowledge.current) * unit,
        tail_gap=float(np.min(motion["tail_gap"])),
        least_gap=float(least_gap(robot.effects.get(CONTACT.name, 0.0))),
    )


def check_known(robot: Robot, lookup: LookupTable, knowledge: CalibrationKnowledge) -> None:
    """Ask a look-up table everything that a vehicle needs.

    Raises:
        InputError: the robot is outside the table's domain, or the table lacks what the calibration is unsure of.
    """
    columns = both_directions(robot.group_values())
    with refusing_robots([robot, robot], lookup):
        twist = _twists(lookup.query(columns))
        curves = lookup.response(columns)
    lag = mirrored(np.stack([lag_table(curves.lag[i], curves.memory[i], curves.before) for i in (0, 1)]))
    coefficient_modes(robot, lookup, Motion(twist, lag), knowledge)


def _twists(motion: Mapping[str, Floats]) -> Floats:
    """Return the twists (2, 3) of both directions from a table's answer."""
    return np.stack([motion[name] for name in STEADY], -1)


def _table_modes(twist: Floats, errors: ErrorModes) -> list[Mode]:
    """Turn the errors of the table into modes.

    The two directions of a mirror-symmetric robot have the same errors. Those of other robots also have a part of
    opposite signs. The simulator, whose motion the table has learned, turns a little less in time steps.
    """
    symmetric = np.allclose(twist[1], twist[0] * planar.MIRROR, rtol=1e-9, atol=0)
    mirror = np.stack([np.ones(3), planar.MIRROR])
    signs = [np.ones(2)] if symmetric else [np.ones(2), _ODD * np.array([1.0, -1.0])]
    lags = lag_table(errors.lag, errors.memory)
    modes = [Mode("table: time steps", twist * [0.0, 0.0, _TIME_STEPS])]
    for sign in signs:
        sides = sign[:, None] * mirror
        for i, move in enumerate(errors.twist):
            lag = sides[:, None, None] * lags[i] if lags[i].any() else None
            modes.append(Mode(f"table: {i + 1}", sides * move, lag))
    return modes
