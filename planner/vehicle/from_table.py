"""The vehicle that a look-up table gives for a robot: both directions, what is uncertain, and the current.

Uncertain are the table's answers, and what a calibration knows of the robot's parameters and of the current: each
is a mode of the vehicle. A parameter moves the twists and the lags: by differences of the table's answers, where
the table knows other robots. The table of one robot has derivatives of the twists alone. There the heading part of
the lags changes in proportion to the yaw rate, which the shipped table confirms to a tenth or two, and the other
parts are kept.

The package's table covers a domain of robots without odd effects. For any other robot a table of its own is
simulated, once: it is kept beside the robot's file, and read again as long as the robot is the same.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats
from common.changes import ChangedRobot, RobotSource
from common.errors import InputError
from planner.vehicle.vehicle import BEFORE_KNOTS, TIMES, Mode, Vehicle, lag_table, resampled
from planner.vehicle.zigzag import LONGEST
from sim.effects import effect_named, is_effect
from sim.effects.tail_contact import EFFECT as CONTACT
from sim.effects.tail_contact import least_gap
from sim.knowledge import NUMBERS, CalibrationKnowledge
from sim.mechanics import planar
from sim.model.presets import PRESETS
from sim.model.response import Responses
from sim.model.robot import Robot
from surrogate.answers import refusing_robots
from surrogate.interface import ErrorModes, LookupTable

_TIME_STEPS = 2.5e-4  # of the yaw rate, one standard deviation: error of time steps (`sim.motion.run`)
_ODD = 0.2  # share of a table's error that has opposite signs in the two directions
STEADY = ("v_z", "v_x", "omega_yr_bar")
OWN_TABLE = "softflagella surrogate robot"  # makes the table of one robot
_STEP = 0.02  # of a coefficient, for derivatives
_STIFF = 0.1  # ω̄ below which tails hardly bend
_LEAST_WAY = 1e-5  # forward in the longest dwell [l]: 100,000 flips for the robot's length
ENDING = ".table.json"
_TABLES: dict[tuple[tuple[str, float], ...], LookupTable] = {}  # of robots without a file, by their groups


def default_table() -> LookupTable:
    """Load the table that comes with the package."""
    from surrogate.table_file import load  # loads PyTorch, which the import of a plan does not need

    return load()


def table_for(
    robot: Robot, source: RobotSource | None, knowledge: CalibrationKnowledge, *, own: bool = False
) -> LookupTable:
    """Load the package's table if it knows a robot, else the robot's own; simulate that where there is none.

    Args:
        robot: the robot.
        source: its file, or the name of a preset; None: the table is kept in this process alone.
        knowledge: what a calibration found besides the robot.
        own: take the robot's own table in any case. It is more accurate.

    Raises:
        InputError: the robot's motion cannot be simulated.
    """
    reason = ""
    if not own:
        shipped = default_table()
        try:
            check_known(robot, shipped, knowledge)
        except InputError as unknown:
            reason = f"{str(unknown).partition('; ')[0]}: "
        else:
            return shipped
    kept = None
    if source is not None and str(source) not in PRESETS and not isinstance(source, ChangedRobot):
        kept = Path(source).with_suffix(ENDING)
    table = _kept_table(robot, kept, knowledge)
    if table is None:
        if robot.omega_bar < _STIFF:
            from sim.motion.steady import steady

            _check_bent(robot, float(steady(robot.groups(), stability=False).v_z[0]))
        print(f"{reason}simulating this robot's own look-up table, for some seconds", file=sys.stderr)
        table = _simulated_table(robot, kept)
    return table


def _kept_table(robot: Robot, kept: Path | None, knowledge: CalibrationKnowledge) -> LookupTable | None:
    """Read the table beside the robot's file; None where there is none, or one of another robot or version."""
    from surrogate.robot_table import load_robot_table

    if kept is None:
        return _TABLES.get(_key(robot))
    if not kept.exists():
        return None
    try:
        table = load_robot_table(kept)
        check_known(robot, table, knowledge)
    except InputError:
        return None
    return table


def _simulated_table(robot: Robot, kept: Path | None) -> LookupTable:
    """Simulate the table of a robot, and keep it where that is possible."""
    from surrogate.tabulate import tabulate

    table = tabulate(robot)
    if kept is None:
        _TABLES[_key(robot)] = table
    else:
        try:
            table.save(kept)
            print(f"-> {kept}", file=sys.stderr)
        except InputError as refusal:  # a folder that cannot be written is no reason not to plan
            print(f"the table is not kept: {refusal}", file=sys.stderr)
    return table


def _check_bent(robot: Robot, speed: float) -> None:
    """Refuse a robot whose tails bend so little that its speed v_z forward leads nowhere."""
    if robot.omega_bar < _STIFF and speed * LONGEST < _LEAST_WAY:
        cm_s = 100 * speed * robot.length_scale / robot.time_scale
        raise InputError(
            f"robot {robot.name!r} hardly moves forward, {cm_s:.2g} cm/s: its tails hardly bend (omega_bar = "
            f"{robot.omega_bar:.3g}); check Young's modulus, viscosity and motor speed"
        )


def _key(robot: Robot) -> tuple[tuple[str, float], ...]:
    return tuple(sorted(robot.group_values().items()))


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
    _check_bent(robot, float(speed))
    if (twist[:, 2] * [1.0, -1.0] <= 0).any():
        raise InputError(f"robot {robot.name!r} turns to the same side in both directions of its motor; it cannot "
                         "follow a path")  # fmt: skip
    lag = _lags(curves)
    unit = robot.time_scale / robot.length_scale  # from m/s
    return Vehicle(
        twist=twist,
        lag=lag,
        rest=mirrored(resampled(curves.rest)),
        spread=resampled(curves.spread),
        phase_rate=robot.tails * motion["omega_t_bar"],
        modes=(
            *_table_modes(twist, lookup.error_modes(columns)),
            *coefficient_modes(robot, lookup, TwistsAndLags(twist, lag), knowledge),
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
        lag = _lags(lookup.response(columns))
    coefficient_modes(robot, lookup, TwistsAndLags(twist, lag), knowledge)


def _twists(motion: Mapping[str, Floats]) -> Floats:
    """Return the twists (2, 3) of both directions from a table's answer."""
    return np.stack([motion[name] for name in STEADY], -1)


def _lags(curves: Responses) -> Floats:
    """Return the lags (2, K, T, 3) of both directions from a table's curves."""
    return mirrored(np.stack([lag_table(curves.lag[i], curves.memory[i], curves.before) for i in (0, 1)]))


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


class TwistsAndLags(NamedTuple):
    """Twists and lags of both directions, or their derivatives by one parameter."""

    twist: Floats  # (2, 3)
    lag: Floats  # (2, K, T, 3), as in `planner.vehicle.vehicle`

    def plus(self, other: TwistsAndLags, factor: float) -> TwistsAndLags:
        """Add a multiple of another motion."""
        return TwistsAndLags(self.twist + factor * other.twist, self.lag + factor * other.lag)


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
    robot: Robot, lookup: LookupTable, motion: TwistsAndLags, knowledge: CalibrationKnowledge
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
            total = TwistsAndLags(np.zeros((2, 3)), np.zeros_like(motion.lag))
            for slope, factor in zip(slopes, column.tolist(), strict=True):
                total = total.plus(slope, factor)
            modes.append(Mode(f"coefficients: {k + 1}", total.twist, total.lag))
    unit = robot.time_scale / robot.length_scale
    for i, sigma in enumerate(knowledge.current_error):
        if sigma > 0:
            current = np.zeros(2)
            current[i] = sigma * unit
            modes.append(Mode(f"current {'xy'[i]}", np.zeros((2, 3)), current=current))
    return modes


def _slope_of_number(robot: Robot, lookup: LookupTable, motion: TwistsAndLags, name: str) -> TwistsAndLags:
    """Compute the derivative of the motion by the logarithm of a number of the robot.

    It changes groups, and the units of time and length. The schedule keeps its seconds, the path its metres.
    """
    changed: list[dict[str, Any]] = [{name: robot.number(name) * math.exp(sign * _STEP)} for sign in (1.0, -1.0)]
    ends = [replace(robot, **change) for change in changed]
    above, below = (end.group_values() for end in ends)
    changes = {
        group: math.log(above[group] / below[group]) / (2 * _STEP)
        for group in above
        if not is_effect(group) and above[group] != below[group]
    }
    faster = -math.log(ends[0].time_scale / ends[1].time_scale) / (2 * _STEP)
    longer = math.log(ends[0].length_scale / ends[1].length_scale) / (2 * _STEP)
    by_before, by_time = np.gradient(motion.lag, np.log(BEFORE_KNOTS), TIMES, axis=(1, 2))
    slope = TwistsAndLags(
        motion.twist * [faster + longer, faster + longer, faster],
        motion.lag * [longer, longer, 0.0] + faster * (by_before + TIMES[:, None] * by_time),
    )
    for group, change in changes.items():
        slope = slope.plus(_slope(robot, lookup, motion, group), change)
    return slope


def _slope(robot: Robot, lookup: LookupTable, motion: TwistsAndLags, name: str) -> TwistsAndLags:
    """Compute the derivative of the motion by the logarithm of a group, or by the size of an effect."""
    values = robot.group_values()
    stored = getattr(lookup, "slopes", {})
    if name in stored:
        twist = np.asarray(stored[name])
        turned = (twist[:, 2] / motion.twist[:, 2])[:, None, None, None]
        return TwistsAndLags(twist, motion.lag * turned * [0.0, 0.0, 1.0])
    effect = is_effect(name)
    step = _STEP * effect_named(name).typical if effect else _STEP
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
    return TwistsAndLags((above.twist - below.twist) / width, (above.lag - below.lag) / width)


def _other(lookup: LookupTable, values: Mapping[str, float], motion: TwistsAndLags) -> TwistsAndLags:
    """Ask a table for the motion of another robot; it has the lags of `motion` if its own are not known.

    Raises:
        InputError: the table does not know this robot.
    """
    columns = both_directions(values)
    twist = _twists(lookup.query(columns))
    try:
        curves = lookup.response(columns)
    except InputError:  # of robots whose left and right turns differ
        return TwistsAndLags(twist, motion.lag)
    return TwistsAndLags(twist, motion.lag if curves.failed.any() else _lags(curves))
