"""Simulate robots: `softflagella.steady`, `response`, `sensitivities` and `replay`.

Robots are a `Robot`, or a table with one row for each robot: a mapping or a pandas table with the columns `C_t`,
`C_r`, `C_yr`, `l_over_R`, `L_over_R`, `l_over_r0`, `omega_bar`, `N`, and optionally `a_over_R` and sizes of
effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from planner.planning.plan import Plan
from sim.arrays import Floats
from sim.inputs import check_columns
from sim.io.errors import InputError
from sim.model.groups import DWELL, Groups
from sim.model.response import BEFORE, DWELLS
from sim.model.robot import Robot
from sim.model.schedule import Schedule
from sim.motion.batches import sensitivity_columns, split, steady_columns
from sim.motion.replay import replay as replay_schedules
from sim.motion.response import responses
from sim.motion.switching import switch_response as respond

Robots = Robot | Mapping[str, Any] | pd.DataFrame


def robot_columns(robots: Robots) -> dict[str, Floats]:
    """Convert robots to checked columns, each (M,)."""
    if isinstance(robots, Robot):
        robots = {name: [value] for name, value in robots.group_values().items()}
    columns = {str(name): np.atleast_1d(np.asarray(values)) for name, values in robots.items()}
    try:
        rows = np.broadcast_shapes(*(column.shape for column in columns.values()))
    except ValueError:
        sizes = ", ".join(f"{name} {len(column)}" for name, column in columns.items())
        raise InputError(
            f"columns differ in length ({sizes}); give one value for each robot, or one for all"
        ) from None
    return check_columns({name: np.broadcast_to(column, rows) for name, column in columns.items()})


def steady(robots: Robots, *, jobs: int | None = None) -> pd.DataFrame:
    """Simulate the mean motion at constant motor speed, as reached from rest.

    Args:
        robots: a `Robot`, or a table with M rows (single values stand for all rows).
        jobs: threads; default all processors.

    Returns:
        A table with M rows and the columns `omega_t_bar`, `omega_h_bar`, `omega_yr_bar` (spins of tails and head
        and yaw rate [EI/(μ0 l⁴)]), `v_x`, `v_z` (sway and surge of the head's centre [EI/(μ0 l³)]), `R_yr_over_l`,
        `theta_deg`, `converged`, `tail_gap` ([2 r0], below 1 if tails touch), `error` (the estimated relative
        error), `method` ("direct" or "stepping") and `note` (why a row is not converged or not solved directly).

    Raises:
        InputError: a column is unknown, or a number is not possible.

    Source: Du, Miller, Jawed (arXiv 2103.05712) for the model.

    Example:
        >>> import softflagella as sf
        >>> motion = sf.steady(sf.load_robot("paper-control"))
        >>> motion[["omega_yr_bar", "v_x", "v_z"]].round(3).values.tolist()
        [[0.049, 0.043, 0.018]]
        >>> faster = {**sf.load_robot("paper-control").group_values(), "omega_bar": [10.0, 20.0, 40.0]}
        >>> sf.steady(faster)["omega_yr_bar"].round(2).tolist()
        [0.05, 0.08, 0.16]
    """
    return pd.DataFrame(steady_columns(robot_columns(robots), jobs=jobs, title=""))


def switch_response(robots: Robots, dwell: ArrayLike) -> pd.DataFrame:
    """Simulate flips of the motor every `dwell`, from the steady motion (deprecated: use `response`).

    Args:
        robots: a `Robot`, or a table with M rows.
        dwell: half-period T̄ [μ0 l⁴/EI], one for all robots or (M,).

    Returns:
        A table with M rows and the columns `dwell_bar`, `net_speed_bar` [EI/(μ0 l³)], and the offset of a flip
        `lag_psi_rad`, `lag_x`, `lag_z` [l]; NaN where a simulation broke down.

    Raises:
        InputError: a robot is not possible, or a dwell is not above 0.
    """
    columns = robot_columns(robots)
    dwells = np.broadcast_to(np.asarray(dwell, dtype=float), columns["N"].shape)
    names = (DWELL, "net_speed_bar", "lag_psi_rad", "lag_x", "lag_z")
    table = pd.DataFrame({name: np.full(len(dwells), np.nan) for name in names})
    for rows in split(columns["N"], len(dwells)):
        flips = respond(Groups.from_columns({k: v[rows] for k, v in columns.items()}), dwells[rows])
        values = (flips.dwell, flips.net_speed, flips.lag_psi, flips.lag_x, flips.lag_z)
        for name, column in zip(names, values, strict=True):
            table.loc[rows, name] = column
    return table


def response(robot: Robot) -> pd.DataFrame:
    """Simulate the response to a flip of the motor: one row for each direction, preceding dwell and dwell.

    Args:
        robot: any robot, effects included.

    Returns:
        A table with the columns `direction` (of the motor after the flip), `before_bar` (the dwell before:
        infinite after a long one, 0 for the start from rest), `dwell_bar`, the lag `lag_z`, `lag_x` [l] and
        `lag_psi_rad`, and `net_speed_bar` of equal dwells, where `before_bar` is infinite. `sim.model.response`
        defines them.

    Raises:
        InputError: the robot breaks down.

    Example:
        >>> import softflagella as sf
        >>> table = sf.response(sf.load_robot("paper-control"))
        >>> long = table[(table["direction"] == 1) & np.isinf(table["before_bar"])]
        >>> long["net_speed_bar"].iloc[[6, 12, 24]].round(4).tolist()
        [0.0116, 0.0159, 0.0174]
    """
    tables = []
    for direction in (1, -1):
        groups = robot.groups()
        flip = responses(replace(groups, omega_bar=direction * groups.omega_bar))
        if flip.failed.any():
            raise InputError(f"{robot.name}: the response to a flip breaks down; try a slower motor")
        curves = {np.inf: flip.lag[0], 0.0: flip.rest[0]}
        curves |= {float(T): flip.lag[0] + memory for T, memory in zip(BEFORE, flip.memory[0], strict=True)}
        for before, lag in curves.items():
            table = pd.DataFrame({"direction": direction, "before_bar": before, DWELL: DWELLS})
            table[["lag_z", "lag_x", "lag_psi_rad"]] = lag
            table["net_speed_bar"] = flip.net_speed[0] if before == np.inf else np.nan
            tables.append(table)
    return pd.concat(tables, ignore_index=True)


def sensitivities(robots: Robots, parameters: Sequence[str], *, jobs: int | None = None) -> pd.DataFrame:
    """Differentiate the steady motion in inputs and effect sizes, by the implicit function theorem.

    Args:
        robots: a `Robot`, or a table with M rows.
        parameters: names of inputs (except N) and of effects, K of them.
        jobs: threads; default all processors.

    Returns:
        A table with M rows and a column for each pair (output, parameter), which holds the derivative per unit of
        the parameter. Outputs are `omega_t_bar`, `omega_h_bar`, `omega_yr_bar`, `v_x`, `v_z`, `R_yr_over_l`,
        `theta_rad`. NaN where there is no direct solution.

    Raises:
        InputError: a robot is not possible, or a parameter is unknown.

    Example:
        >>> import softflagella as sf
        >>> slopes = sf.sensitivities(sf.load_robot("paper-control"), ["C_yr"])
        >>> slopes["omega_yr_bar", "C_yr"].round(4).tolist()  # in proportion to C_yr = 2
        [0.0245]
    """
    result = sensitivity_columns(robot_columns(robots), parameters, jobs=jobs, title="")
    columns = {
        (output, parameter): slopes[:, k]
        for output, slopes in result.derivatives.items()
        for k, parameter in enumerate(result.parameters)
    }
    return pd.DataFrame(columns)


def replay(schedule: Schedule | Plan, robot: Robot | None = None) -> pd.DataFrame:
    """Simulate a schedule, from rest with straight tails.

    Args:
        schedule: a plan, or its schedule.
        robot: the robot that carries out a plan; default: the one that the plan was made for.

    Returns:
        The track of the head's centre, with the columns `time_bar` [μ0 l⁴/EI], `time_s`, `x_over_l`, `y_over_l`,
        `heading_rad`, `direction` of the motor, `dwell` (index).

    Raises:
        InputError: the schedule cannot be simulated, or it needs too many time steps.

    Example:
        >>> import softflagella as sf
        >>> robot = sf.load_robot("paper-control")
        >>> flips = sf.Schedule(robot.group_values(), 1, np.array([1.0, 1.0]), (0.0, 0.0, 0.0), robot.time_scale)
        >>> track = sf.replay(flips)
        >>> round(float(track["time_bar"].iloc[-1]), 6), track["direction"].unique().tolist()
        (2.0, [1, -1])
    """
    if isinstance(schedule, Plan):
        schedule = schedule.schedule(robot)
    elif robot is not None:
        raise InputError("a schedule names its own robot; give a plan where another robot carries it out")
    return replay_schedules([schedule])[0]
