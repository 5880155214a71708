"""The vehicle that a look-up table gives for a robot: both directions, what is uncertain, and the current."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from planner.vehicle.calibration_table import NUMBERS, CalibrationKnowledge
from planner.vehicle.vehicle import Mode, Vehicle, lag_table, resampled
from sim.arrays import Floats
from sim.effects import catalogue
from sim.effects.tail_contact import EFFECT as CONTACT
from sim.effects.tail_contact import least_gap
from sim.io.errors import InputError
from sim.mechanics import planar
from sim.model.robot import Robot
from surrogate.interface import ErrorModes, LookupTable

_STEADY = ("v_z", "v_x", "omega_yr_bar")
_ODD = 0.2  # share of a table's error that has opposite signs in the two directions
_STEP = 0.02  # of a coefficient, for derivatives
OWN_TABLE = "softflagella surrogate robot"  # makes the table of one robot


def default_table() -> LookupTable:
    """Load the table that comes with the package."""
    from surrogate.table.model_file import load  # loads PyTorch, which the import of a plan does not need

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
    columns = _both_directions(robot.group_values())
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
    mirror = np.stack([np.ones(3), planar.MIRROR])
    lag = np.stack([lag_table(curves.lag[i], curves.memory[i], curves.before) for i in (0, 1)])
    unit = robot.time_scale / robot.tail_length  # from m/s
    return Vehicle(
        twist=twist,
        lag=lag * mirror[:, None, None],
        rest=resampled(curves.rest) * mirror[:, None],
        spread=resampled(curves.spread),
        modes=(
            *_table_modes(twist, lookup.error_modes(columns)),
            *_coefficient_modes(robot, lookup, twist, knowledge),
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
    columns = _both_directions(robot.group_values())
    twist = _twists(lookup.query(columns))
    lookup.response(columns)
    _coefficient_modes(robot, lookup, twist, knowledge)


def _both_directions(values: dict[str, float]) -> dict[str, Floats]:
    """Return the robot's groups twice: with its motor forward, and reversed."""
    columns: dict[str, Floats] = {name: np.array([value, value]) for name, value in values.items()}
    columns["omega_bar"] = columns["omega_bar"] * [1.0, -1.0]
    return columns


def _twists(motion: Mapping[str, Floats]) -> Floats:
    """Return the twists (2, 3) of both directions from a table's answer."""
    return np.stack([motion[name] for name in _STEADY], -1)


def _table_modes(twist: Floats, errors: ErrorModes) -> list[Mode]:
    """Turn the errors of the table into modes.

    The two directions of a mirror-symmetric robot have the same errors. Those of other robots also have a part of
    opposite signs.
    """
    mirrored = np.allclose(twist[1], twist[0] * planar.MIRROR, rtol=1e-9, atol=0)
    mirror = np.stack([np.ones(3), planar.MIRROR])
    signs = [np.ones(2)] if mirrored else [np.ones(2), _ODD * np.array([1.0, -1.0])]
    lags = lag_table(errors.lag, errors.memory)
    modes = []
    for sign in signs:
        sides = sign[:, None] * mirror
        for i, move in enumerate(errors.twist):
            lag = sides[:, None, None] * lags[i] if lags[i].any() else None
            modes.append(Mode(f"table: {i + 1}", sides * move, lag))
    return modes


def _coefficient_modes(
    robot: Robot, lookup: LookupTable, twist: Floats, knowledge: CalibrationKnowledge
) -> list[Mode]:
    """Turn the covariances of the robot's parameters and of the current into modes."""
    modes: list[Mode] = []
    if knowledge.names:
        slopes = np.array([
            _slope_of_number(robot, lookup, twist, name) if name in NUMBERS else _slope(robot, lookup, twist, name)
            for name in knowledge.names
        ])  # (p, 2, 3)  # fmt: skip
        scale = np.sqrt(np.maximum(np.diag(knowledge.covariance), 1e-300))
        values, vectors = np.linalg.eigh(knowledge.covariance / np.outer(scale, scale))
        root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        for k, column in enumerate(root.T):
            move = np.tensordot(column, slopes, 1)
            modes.append(Mode(f"coefficients: {k + 1}", move))
    unit = robot.time_scale / robot.tail_length
    for i, sigma in enumerate(knowledge.current_error):
        if sigma > 0:
            current = np.zeros(2)
            current[i] = sigma * unit
            modes.append(Mode(f"current {'xy'[i]}", np.zeros((2, 3)), current=current))
    return modes


def _slope_of_number(robot: Robot, lookup: LookupTable, twist: Floats, name: str) -> Floats:
    """Compute the derivative (2, 3) of the twists by the logarithm of a number of the robot.

    It changes groups, and the units of time and length. The schedule keeps its seconds, the path its metres.
    """
    given = robot.head_radius if getattr(robot, name) is None else getattr(robot, name)
    changed: list[dict[str, Any]] = [{name: given * math.exp(sign * _STEP)} for sign in (1.0, -1.0)]
    ends = [replace(robot, **change) for change in changed]
    above, below = (end.group_values() for end in ends)
    changes = {
        group: math.log(above[group] / below[group]) / (2 * _STEP)
        for group in above
        if group not in catalogue() and above[group] != below[group]
    }
    faster = -math.log(ends[0].time_scale / ends[1].time_scale) / (2 * _STEP)
    longer = math.log(ends[0].tail_length / ends[1].tail_length) / (2 * _STEP)
    slope = twist * [faster + longer, faster + longer, faster]
    for group, change in changes.items():
        slope = slope + change * _slope(robot, lookup, twist, group)
    return np.asarray(slope)


def _slope(robot: Robot, lookup: LookupTable, twist: Floats, name: str) -> Floats:
    """Compute the derivative (2, 3) of the twists by the logarithm of a group, or by the size of an effect."""
    values = robot.group_values()
    stored = getattr(lookup, "slopes", {})
    if name in stored:
        return np.asarray(stored[name])
    effect = name in catalogue()
    step = _STEP * catalogue()[name].typical if effect else _STEP
    ends = []
    for sign in (1.0, -1.0):
        value = values.get(name, 0.0) + sign * step if effect else values[name] * np.exp(sign * step)
        try:
            ends.append((_twists(lookup.query(_both_directions({**values, name: value}))), sign * step))
        except InputError:  # at the edge of the table
            ends.append((twist, 0.0))
    (above, step_up), (below, step_down) = ends
    if step_up == step_down:
        raise InputError(
            f"the table does not say what {name} changes; make the robot's own table with {OWN_TABLE}"
        )
    return np.asarray((above - below) / (step_up - step_down))
