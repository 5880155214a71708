"""What is uncertain of a robot's parameters and of the current, as modes of the vehicle.

A parameter moves the twists and the lags: by differences of the table's answers, where the table knows other
robots. The table of one robot has derivatives of the twists alone. There the heading part of the lags changes in
proportion to the yaw rate, which the shipped table confirms to a tenth or two, and the other parts are kept.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from planner.vehicle.calibration_table import NUMBERS, CalibrationKnowledge
from planner.vehicle.vehicle import BEFORE_KNOTS, TIMES, Mode, lag_table
from sim.arrays import Floats
from sim.effects import catalogue
from sim.io.errors import InputError
from sim.mechanics import planar
from sim.model.robot import Robot
from surrogate.interface import LookupTable

STEADY = ("v_z", "v_x", "omega_yr_bar")
OWN_TABLE = "softflagella surrogate robot"  # makes the table of one robot
_STEP = 0.02  # of a coefficient, for derivatives


class Motion(NamedTuple):
    """Twists and lags of both directions, or their derivatives by one parameter."""

    twist: Floats  # (2, 3)
    lag: Floats  # (2, K, T, 3), as in `planner.vehicle.vehicle`

    def plus(self, other: Motion, factor: float) -> Motion:
        """Add a multiple of another motion."""
        return Motion(self.twist + factor * other.twist, self.lag + factor * other.lag)


def mirrored(curves: Floats) -> Floats:
    """Turn curves (2, ..., 3) of both directions, as seen for a positive motor, to the robot's frame."""
    mirror = np.stack([np.ones(3), planar.MIRROR])
    return np.asarray(curves * mirror.reshape(2, *(1,) * (curves.ndim - 2), 3))


def both_directions(values: Mapping[str, float]) -> dict[str, Floats]:
    """Return the robot's groups twice: with its motor forward, and reversed."""
    columns: dict[str, Floats] = {name: np.array([value, value]) for name, value in values.items()}
    columns["omega_bar"] = columns["omega_bar"] * [1.0, -1.0]
    return columns


def coefficient_modes(
    robot: Robot, lookup: LookupTable, motion: Motion, knowledge: CalibrationKnowledge
) -> list[Mode]:
    """Turn the covariances of the robot's parameters and of the current into modes.

    Raises:
        InputError: the table does not say what a parameter changes.
    """
    modes: list[Mode] = []
    if knowledge.names:
        slopes = [
            _slope_of_number(robot, lookup, motion, name)
            if name in NUMBERS
            else _slope(robot, lookup, motion, name)
            for name in knowledge.names
        ]
        scale = np.sqrt(np.maximum(np.diag(knowledge.covariance), 1e-300))
        values, vectors = np.linalg.eigh(knowledge.covariance / np.outer(scale, scale))
        root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        for k, column in enumerate(root.T):
            total = Motion(np.zeros((2, 3)), np.zeros_like(motion.lag))
            for slope, factor in zip(slopes, column.tolist(), strict=True):
                total = total.plus(slope, factor)
            modes.append(Mode(f"coefficients: {k + 1}", total.twist, total.lag))
    unit = robot.time_scale / robot.tail_length
    for i, sigma in enumerate(knowledge.current_error):
        if sigma > 0:
            current = np.zeros(2)
            current[i] = sigma * unit
            modes.append(Mode(f"current {'xy'[i]}", np.zeros((2, 3)), current=current))
    return modes


def _slope_of_number(robot: Robot, lookup: LookupTable, motion: Motion, name: str) -> Motion:
    """Compute the derivative of the motion by the logarithm of a number of the robot.

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
    by_before, by_time = np.gradient(motion.lag, np.log(BEFORE_KNOTS), TIMES, axis=(1, 2))
    slope = Motion(
        motion.twist * [faster + longer, faster + longer, faster],
        motion.lag * [longer, longer, 0.0] + faster * (by_before + TIMES[:, None] * by_time),
    )
    for group, change in changes.items():
        slope = slope.plus(_slope(robot, lookup, motion, group), change)
    return slope


def _slope(robot: Robot, lookup: LookupTable, motion: Motion, name: str) -> Motion:
    """Compute the derivative of the motion by the logarithm of a group, or by the size of an effect."""
    values = robot.group_values()
    stored = getattr(lookup, "slopes", {})
    if name in stored:
        twist = np.asarray(stored[name])
        turned = (twist[:, 2] / motion.twist[:, 2])[:, None, None, None]
        return Motion(twist, motion.lag * turned * [0.0, 0.0, 1.0])
    effect = name in catalogue()
    step = _STEP * catalogue()[name].typical if effect else _STEP
    ends = []
    for sign in (1.0, -1.0):
        value = values.get(name, 0.0) + sign * step if effect else values[name] * np.exp(sign * step)
        try:
            ends.append((_other(lookup, {**values, name: value}, motion), sign * step))
        except InputError:  # at the edge of the table
            ends.append((motion, 0.0))
    (above, step_up), (below, step_down) = ends
    if step_up == step_down:
        raise InputError(
            f"the table does not say what {name} changes; make the robot's own table with {OWN_TABLE}"
        )
    width = step_up - step_down
    return Motion((above.twist - below.twist) / width, (above.lag - below.lag) / width)


def _other(lookup: LookupTable, values: Mapping[str, float], motion: Motion) -> Motion:
    """Ask a table for the motion of another robot; it has the lags of `motion` if its own are not known.

    Raises:
        InputError: the table does not know this robot.
    """
    columns = both_directions(values)
    answer = lookup.query(columns)
    twist = np.stack([answer[name] for name in STEADY], -1)
    try:
        curves = lookup.response(columns)
    except InputError:  # of robots whose left and right turns differ
        return Motion(twist, motion.lag)
    lag = np.stack([lag_table(curves.lag[i], curves.memory[i], curves.before) for i in (0, 1)])
    return Motion(twist, motion.lag if curves.failed.any() else mirrored(lag))
