"""Simulate robots: `softflagella.steady`, `response`, `sensitivities` and `replay`.

What robots are is said in `sim.robot_rows`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
import pandas as pd

from common.arrays import Floats
from common.errors import InputError
from common.keywords import checks_keywords
from sim.model.groups import DWELL, Groups
from sim.model.response import BEFORE, DWELLS, LAGS
from sim.model.robot import Robot
from sim.model.schedule import Schedule, load_schedule
from sim.motion.batches import RESPONSE_ROWS, in_batches, sensitivity_columns, steady_columns
from sim.motion.replay import replay as replay_schedule
from sim.motion.response import responses
from sim.robot_rows import NAME, OneRobot, RobotRows, one_robot, robot_rows, with_units

if TYPE_CHECKING:
    from sim.robot_rows import Robots


class Scheduled(Protocol):
    """A plan."""

    def schedule(self) -> Schedule:
        """Return its schedule."""


@checks_keywords
def steady(
    robots: Robots, *, robot: OneRobot | None = None, stability: bool = True, jobs: int | None = None
) -> pd.DataFrame:
    """Simulate the mean motion at constant motor speed, as reached from rest.

    Args:
        robots: a `Robot`, the path of a robot.toml, the name of a preset, or a list of these; or dimensionless
            robots, a table with M rows (single values stand for all rows), or its file; or, with `robot`, a table
            of its runs: `N`, `l_cm`, `omega_rpm`, or these in other units.
        robot: the robot of a table of runs.
        stability: compute whether small perturbations decay, `stable` and `growth`. This adds a quarter to the
            time, for robots with non-local effects (flow, contact, natural shape, thinning) it doubles it.
        jobs: threads; default all processors.

    Returns:
        A table with M rows. It begins with the columns of a table that was given. For robots in SI units it has
        their names (`robot`), `omega_h_rpm`, `omega_t_rpm`, `omega_yr_rad_s`, `R_yr_cm`, `theta_deg`, `v_cm_s` and
        `circle_s`, the time of a circle.
        The dimensionless columns are `omega_t_bar`, `omega_h_bar`, `omega_yr_bar` (spins of tails and head and
        yaw rate [EI/(μ0 l⁴)]), `v_x`, `v_z` (sway and surge of the head's centre [EI/(μ0 l³)]), `R_yr_over_l`,
        `theta_deg`, `converged`, `tail_gap` ([2 r0], below 1 if tails touch), `stable` (whether small
        perturbations decay), `growth` (the logarithm of the factor by which they grow in a motor revolution; NaN
        if time stepping found the motion), `error` (the estimated relative error), `method` ("direct" or
        "stepping") and `note` (why a row is not converged, not stable, or not solved directly).
        `attrs["units"]` has the units.

    Raises:
        InputError: a column is unknown, or a number is not possible.

    Source: Du, Miller, Jawed (arXiv 2103.05712) for the model.

    Example:
        >>> import softflagella as sf
        >>> motion = sf.steady("paper-control")
        >>> motion[["R_yr_cm", "v_cm_s", "circle_s", "omega_yr_bar"]].round(3).values.tolist()
        [[10.359, 0.23, 282.776, 0.049]]
        >>> motion.attrs["units"]["v_cm_s"]
        'cm/s'
        >>> faster = {**sf.load_robot("paper-control").group_values(), "omega_bar": [10.0, 20.0, 40.0]}
        >>> sf.steady(faster)["omega_yr_bar"].round(2).tolist()
        [0.05, 0.08, 0.16]
        >>> runs = {"N": 2, "l_cm": [9.0, 11.0], "omega_rpm": [60.0, -60.0]}
        >>> sf.steady(runs, robot="paper-control")[["l_cm", "omega_rpm", "R_yr_cm"]].round(2).values.tolist()
        [[9.0, 60.0, 9.19], [11.0, -60.0, 10.24]]
    """
    rows = robot_rows(robots, robot)
    with rows.naming():
        motion = steady_columns(rows.columns, stability=stability, jobs=jobs, title="")
    return rows.frame(motion)


@checks_keywords
def response(robots: Robots) -> pd.DataFrame:
    """Simulate the response to a flip of the motor: one row for each robot, direction, preceding dwell and dwell.

    Args:
        robots: as for `steady`; any robots, effects included.

    Returns:
        A table with the columns `direction` (of the motor after the flip), `before_bar` (the dwell before:
        infinite after a long one, 0 for the start from rest), `dwell_bar`, the lag `lag_z`, `lag_x` [l] and
        `lag_psi_rad`, and `net_speed_bar` of equal dwells, where `before_bar` is infinite. `sim.model.response`
        defines them. For robots in SI units it begins with `robot` and with the same in lab units: `before_s`,
        `dwell_s`, `lag_z_cm`, `lag_x_cm`, `lag_psi_deg`, `net_speed_cm_s`. For dimensionless robots it begins
        with `row`.

    Raises:
        InputError: a robot breaks down.

    Example:
        >>> import softflagella as sf
        >>> table = sf.response("paper-control")
        >>> long = table[(table["direction"] == 1) & np.isinf(table["before_bar"])]
        >>> long["net_speed_bar"].iloc[[6, 12, 24]].round(4).tolist()
        [0.0116, 0.0159, 0.0174]
        >>> long[["dwell_s", "net_speed_cm_s"]].iloc[24].round(3).tolist()
        [8.83, 0.087]
    """
    rows = robot_rows(robots)
    curves = {direction: _responses(rows, direction) for direction in (1, -1)}
    tables = []
    for row in range(len(rows.columns["N"])):
        table = pd.concat([_curves(flip, row, direction) for direction, flip in curves.items()], ignore_index=True)
        if rows.robots:
            lab = _lab_response(table, rows.robots[row])
            table = pd.concat([table[["direction"]], lab, table.drop(columns="direction")], axis=1)
            table.insert(0, NAME, rows.robots[row].name)
        else:
            table.insert(0, "row", row)
        tables.append(table)
    return with_units(pd.concat(tables, ignore_index=True))


def _responses(rows: RobotRows, direction: int) -> dict[str, Floats]:
    """Simulate the response of all robots, with the motor in one direction after the flip."""

    def work(groups: Groups) -> dict[str, Floats]:
        return {name: curve for name, curve in vars(responses(groups)).items() if name != "before"}

    columns = {**rows.columns, "omega_bar": direction * rows.columns["omega_bar"]}
    flips = in_batches(work, columns, RESPONSE_ROWS)
    for row in np.flatnonzero(flips["failed"]):
        name = rows.robots[row].name if rows.robots else f"the robot in row {row + 1}"
        raise InputError(f"{name}: the response to a flip breaks down; try a slower motor")
    return flips


def _curves(flips: Mapping[str, Floats], row: int, direction: int) -> pd.DataFrame:
    """Tabulate the curves of one robot."""
    lag, memory, rest, speed = (flips[name][row] for name in ("lag", "memory", "rest", "net_speed"))
    curves = {np.inf: lag, 0.0: rest, **dict(zip(BEFORE.tolist(), lag + memory, strict=True))}
    tables = []
    for before, lag in curves.items():
        table = pd.DataFrame({"direction": direction, "before_bar": before, DWELL: DWELLS})
        table[list(LAGS)] = lag
        table["net_speed_bar"] = speed if before == np.inf else np.nan
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def _lab_response(table: pd.DataFrame, robot: Robot) -> pd.DataFrame:
    """Convert the columns of a response to the units of a lab."""
    time, length = robot.time_scale, 100 * robot.tail_length
    lab = {f"{name}_s": table[f"{name}_bar"] * time for name in ("before", "dwell")}
    lab |= {f"{name}_cm": table[name] * length for name in ("lag_z", "lag_x")}
    lab |= {
        "lag_psi_deg": np.degrees(table["lag_psi_rad"]),
        "net_speed_cm_s": table["net_speed_bar"] * length / time,
    }
    return pd.DataFrame(lab)


@checks_keywords
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
    result = sensitivity_columns(robot_rows(robots).columns, parameters, jobs=jobs, title="")
    columns = {
        (output, parameter): slopes[:, k]
        for output, slopes in result.derivatives.items()
        for k, parameter in enumerate(result.parameters)
    }
    return pd.DataFrame(columns)


@checks_keywords
def replay(schedule: Schedule | Scheduled | str | Path, robot: OneRobot | None = None) -> pd.DataFrame:
    """Simulate a schedule, from rest with straight tails.

    Args:
        schedule: a plan, the path of its plan.json, or a schedule.
        robot: the robot that carries it out; default: its own. Times and lengths stay in units of its own.

    Returns:
        The track of the head's centre, with the columns `time_bar` [μ0 l⁴/EI], `time_s`, `x_over_l`, `y_over_l`,
        `heading_rad`, `direction` of the motor, `dwell` (index), and `plan_id` where it is that of a plan.

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
    if isinstance(schedule, str | Path):
        schedule = load_schedule(schedule)
    elif not isinstance(schedule, Schedule):
        schedule = schedule.schedule()
    swum = schedule if robot is None else schedule.swum_by(one_robot(robot))
    track = replay_schedule(swum)
    return with_units(track if robot is None else schedule.in_own_units(track))
