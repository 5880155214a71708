"""Simulate the table of one robot, see `surrogate.single`.

Left out: robots whose left and right turns differ (odd effects).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sim.effects import catalogue
from sim.io.errors import InputError
from sim.io.provenance import provenance
from sim.model.groups import DWELL, Groups
from sim.model.robot import Robot
from sim.motion.steady import steady
from sim.motion.switching import switch_response
from surrogate.lookup import STEADY_OUTPUTS
from surrogate.single import LAGS, SingleRobot

DWELLS = (0.2, 8.0)  # range of the half-periods
_POINTS, _HELD_OUT = 24, 6


def tabulate(robot: Robot) -> SingleRobot:
    """Simulate one robot's steady motion and its response to switches.

    Args:
        robot: any robot, with or without effects.

    Raises:
        InputError: left and right turns of the robot differ, or its motion cannot be found.

    Example:
        >>> from dataclasses import replace
        >>> from softflagella import circle, load_robot, plan, tabulate
        >>> robot = replace(load_robot("paper-control"), effects={"end_over_end_drag": 5.0})
        >>> plan(circle(2.0), robot, lookup=tabulate(robot)).predicted_rms < 0.03
        True
    """
    odd = [name for name in robot.effects if catalogue()[name].symmetry == "odd"]
    if odd:
        raise InputError(f"{odd[0]} makes left and right turns differ; the planner takes them for mirror images")
    values = robot.group_values()
    knots = np.geomspace(*DWELLS, _POINTS)
    between = np.sqrt(knots[:-1] * knots[1:])[:: _POINTS // _HELD_OUT]
    dwells = np.concatenate([knots, between])
    groups = Groups.from_columns({name: np.full(len(dwells), value) for name, value in values.items()})
    motion = steady(groups)
    if not motion.converged.all():
        raise InputError(f"{robot.name} has no steady motion to tabulate: {motion.note[0]}")
    response = switch_response(groups, dwells, motion)
    if response.failed.any():
        raise InputError(f"{robot.name}: a simulated switch broke down; a slower motor may help")
    lags = np.stack([response.lag_z, response.lag_x, response.lag_psi], -1)
    columns = motion.columns()
    own = {name: float(columns[name][0]) for name in STEADY_OUTPUTS}
    table = SingleRobot(
        values, own, knots.tolist(), lags[:_POINTS].tolist(), {}, provenance({"robot": robot.name})
    )
    speed, yaw = float(np.hypot(own["v_x"], own["v_z"])), abs(own["omega_yr_bar"])
    missed = lags[_POINTS:] - np.stack([table.query({DWELL: between})[k] for k in LAGS], -1)
    rms = np.sqrt((missed**2).mean(0)) / [speed, speed, yaw]
    errors = {name: {"rms": float(motion.error[0])} for name in ("v_x", "v_z", "omega_yr_bar")}
    errors |= {name: {"rms": float(value)} for name, value in zip(LAGS, rms, strict=True)}
    return replace(table, errors=errors)
