"""Simulate the table of one robot, see `robot_table`. Any robot: left and right turns may differ.

The table states its own errors. Its curves are simulated once more with coarser meshes and four times the
tolerance. On a dozen robots, compared with finer meshes and a fifth of the tolerance, the error was 0.1 to 0.3 of
the difference, of nearly the same shape (`_ALONG`, `_ACROSS`). What the last dwell but one changes is not in the
curves. Over speed and yaw rate it falls with the motor speed and with the last dwell S: of 60 robots with 2 to 5
tails, 95 % are below twice

    a ω̄^−p exp(−_FADES S),   (a, p) by axis in _LONGER

which counts as the standard deviation of an error.

Where curves come from time steps, a random schedule is replayed and compared, dwell by dwell, with what the table
predicts. The difference, less what the unknown phase of the disc explains, is the size of the error of a lag.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.keywords import checks_keywords
from common.provenance import provenance
from sim.effects import effect_named, is_effect
from sim.mechanics import planar
from sim.model.groups import Groups
from sim.model.response import BEFORE, DWELLS, LAGS, Responses, memory_after
from sim.model.robot import Robot
from sim.model.schedule import Schedule
from sim.motion.replay import replay
from sim.motion.response import responses
from sim.motion.settling import VERY_FAST
from sim.motion.steady import steady
from sim.motion.steady_motion import STEADY_OUTPUTS, Steady
from surrogate.robot_table import RobotTable

_STEP = 0.02  # in the logarithm of a group and in units of an effect's typical size, for derivatives
TOLERANCE = 1e-4  # of a time step of the curves, in l
_COARSE_TOLERANCE, _COARSE_MESHES = 4 * TOLERANCE, (4, 6)  # of the curves that show the error
_ALONG, _ACROSS = 0.25, 0.1  # standard deviation of the error over the difference, along it and across
_LONGER, _FADES = ((1.5, 1.6), (3.0, 2.3), (0.5, 1.5)), 8.6  # forward, to the side, heading; per time unit
_BOUND = 1.96  # standard deviations; the simulator's error of the steady motion holds in 95 % of the robots
_CHECKED = 24  # dwells of the random schedule
_RANGE = (0.35, 1.8)  # of their lengths


@checks_keywords
def tabulate(robot: Robot) -> RobotTable:
    """Simulate one robot's steady motion and its response to flips, in both directions of the motor.

    Args:
        robot: any robot, with or without effects.

    Raises:
        InputError: the robot's motion cannot be found, or a simulated flip breaks down.

    Example:
        >>> from dataclasses import replace
        >>> from softflagella import circle, load_robot, plan, tabulate
        >>> robot = replace(load_robot("paper-control"), effects={"left_right_bias": 0.2})
        >>> plan(circle(2.0), robot, lookup=tabulate(robot)).predicted_rms < 0.03
        True
    """
    values = robot.group_values()
    if values["omega_bar"] > VERY_FAST:
        raise InputError(f"{robot.name}: omega_bar is above {VERY_FAST:g}, too fast to flip: are all units right?")
    directions = {name: np.array([value, value]) for name, value in values.items()}
    directions["omega_bar"] = directions["omega_bar"] * [1.0, -1.0]
    groups = Groups.from_columns(directions)
    motion = steady(groups, stability=False)
    if not motion.converged.all():
        raise InputError(f"{robot.name} has no steady motion to tabulate: {motion.note[0]}")
    response = responses(groups, motion, tolerance=TOLERANCE, extrapolated_memory=True)
    if response.failed.any():
        raise InputError(f"{robot.name}: a simulated flip broke down; a slower motor may help")
    columns = motion.columns()
    table = RobotTable(
        robot=values,
        steady={name: np.asarray(columns[name], dtype=float).tolist() for name in STEADY_OUTPUTS},
        lag=response.lag.tolist(),
        before=BEFORE.tolist(),
        memory=response.memory.tolist(),
        rest=response.rest.tolist(),
        spread=response.spread.tolist(),
        slopes=_slopes(values),
        errors={},
        error_curves=[],
        provenance=provenance({"robot": robot.name}),
    )
    steady_error = float(motion.error.max()) / _BOUND
    errors = {name: {"rms": steady_error} for name in ("v_x", "v_z", "omega_yr_bar")}
    forward = {name: values[0] for name, values in table.steady.items()}
    speed, yaw = float(np.hypot(forward["v_x"], forward["v_z"])), abs(forward["omega_yr_bar"])
    # Errors are simulated in one direction; in the other they are nearly the mirror image.
    first = Groups.from_columns({name: values[:1] for name, values in directions.items()})
    modes, sizes = _curve_errors(first, motion.at(np.zeros(1, dtype=int)), response, np.array([speed, speed, yaw]))
    if modes is None:
        modes, sizes = np.zeros((0, len(BEFORE) + 1, len(DWELLS), 3)), _error_sizes(*_missed(table))
    total = np.sqrt((modes**2).mean((1, 2)).sum(0) + sizes**2)
    for name, rms, rest in zip(LAGS, total / [speed, speed, yaw], sizes / [speed, speed, yaw], strict=True):
        errors[name] = {"rms": float(rms), "rest": float(rest)}
    return replace(table, errors=errors, error_curves=modes.tolist())


def _curve_errors(
    groups: Groups, motion: Steady, response: Responses, speeds: Floats
) -> tuple[Floats | None, Floats]:
    """Estimate the errors of the curves, in one direction: those of the other one are nearly the mirror image.

    Args:
        groups: the robot with its motor forward.
        motion: its steady motion.
        response: its curves in the first row.
        speeds: its speed, twice, and its yaw rate, (3,).

    Returns:
        Modes (6, K + 1, D, 3) after dwells BEFORE and after a long one, for a positive motor; None where coarser
        curves cannot be simulated. Sizes (3,) of errors of any other shape.
    """
    coarse = responses(
        groups, motion, tolerance=_COARSE_TOLERANCE, meshes=_COARSE_MESHES, extrapolated_memory=True
    )
    if response.stepped.any() or coarse.stepped.any() or coarse.failed.any():
        return None, np.zeros(3)
    difference = _curves(coarse)[0] - _curves(response)[0]
    modes, longer = np.zeros((6, *difference.shape)), longer_memory(BEFORE, abs(float(groups.omega_bar[0])))
    for axis in range(3):
        modes[axis, ..., axis] = _ALONG * difference[..., axis]
        modes[3 + axis, :-1, :, axis] = longer[:, axis, None] * speeds[axis]
    return modes, _ACROSS * np.sqrt((difference**2).mean((0, 1)))


def longer_memory(before: Floats, omega_bar: float) -> Floats:
    """Return one standard deviation (K, 3), over the speeds, of what the last dwell but one changes.

    Args:
        before: length of both dwells before, (K,).
        omega_bar: motor speed, above 0.
    """
    sizes = np.array([size * omega_bar**-power for size, power in _LONGER])
    return np.asarray(sizes * np.exp(-_FADES * before)[:, None])


def _curves(response: Responses) -> Floats:
    """Return the lags (B, K + 1, D, 3) after dwells BEFORE and after a long one."""
    return np.concatenate([response.lag[:, None] + response.memory, response.lag[:, None]], 1)


def _error_sizes(missed: Floats, spread: Floats) -> Floats:
    """Return one standard deviation (3,) of the errors of lags, without what the disc's phase explains.

    Args:
        missed: (M, 3), simulated lags minus the table's.
        spread: (M, 3), standard deviation of the lag over the phase at the flip, which is no error of the table.
    """
    mean = missed.mean(0) ** 2 + missed.var(0) / len(missed)
    return np.asarray(np.sqrt(np.maximum((missed**2 - spread**2).mean(0), mean)))


def _slopes(values: dict[str, float]) -> dict[str, Any]:
    """Difference the twists: derivatives (2, 3) in ln of each group and in the size of each effect."""
    names = [name for name in values if name != "N"]
    rows, widths = [], []
    for name in names:
        ends = _ends(name, values[name])
        widths.append(ends[0][1] - ends[1][1])
        rows += [{**values, name: value} for value, _ in ends for _ in (0, 1)]
    columns = {name: np.array([row[name] for row in rows]) for name in values}
    columns["omega_bar"] = columns["omega_bar"] * np.tile([1.0, -1.0], 2 * len(names))
    motion = steady(Groups.from_columns(columns), stability=False)
    twist = np.stack([motion.v_z, motion.v_x, motion.omega_yr], -1).reshape(len(names), 2, 2, 3)
    slopes = (twist[:, 0] - twist[:, 1]) / np.array(widths)[:, None, None]
    by_name = dict(zip(names, slopes, strict=True))
    return {name: slope.tolist() for name, slope in by_name.items() if np.isfinite(slope).all()}


def _ends(name: str, value: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Choose two values beside `value`, within an effect's bounds, with their places on the derivative's scale."""
    if not is_effect(name):
        return (value * math.exp(_STEP), _STEP), (value * math.exp(-_STEP), -_STEP)
    effect = effect_named(name)
    step = _STEP * abs(effect.typical - effect.null)
    low, high = (min(max(value + sign * step, effect.bounds[0]), effect.bounds[1]) for sign in (-1, 1))
    return (high, high), (low, low)


def _missed(table: RobotTable) -> tuple[Floats, Floats]:
    """Subtract the table's lags from those of a replay in time steps, seen as for a positive motor.

    Returns:
        Differences (M, 3), and the spread (M, 3) of the lag over the disc's phase.
    """
    dwells = np.exp(np.random.default_rng(0).uniform(math.log(_RANGE[0]), math.log(_RANGE[1]), _CHECKED))
    track = replay(Schedule(table.robot, 1, dwells, (0.0, 0.0, 0.0), 1.0))
    flips = track.groupby("dwell").last()[["x_over_l", "y_over_l", "heading_rad"]].to_numpy()
    poses = np.concatenate([np.zeros((1, 3)), flips])
    moved = planar.between(poses[:-1], poses[1:])
    lag, memory = np.array(table.lag), np.array(table.memory)
    missed, spreads = [], []
    for i in range(1, len(dwells)):
        side = i % 2
        mirror = planar.MIRROR if side else np.ones(3)
        twist = np.array([table.steady[name][side] for name in ("v_z", "v_x", "omega_yr_bar")]) * mirror
        simulated = planar.compose(moved[i] * mirror, planar.inverse(planar.arc(twist, dwells[i])))
        curve = lag[side] + memory_after(memory[side], float(dwells[i - 1]))
        predicted = [np.interp(np.log(dwells[i]), np.log(DWELLS), column) for column in curve.T]
        missed.append(simulated - predicted)
        spreads.append([np.interp(np.log(dwells[i]), np.log(DWELLS), s) for s in np.array(table.spread[side]).T])
    return np.array(missed), np.array(spreads)
