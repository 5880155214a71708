"""Inputs -> rows: what is simulated of each robot.

Each robot's steady motion is solved for (`sim.motion.steady`), and from there its response to a flip of the
motor, over all dwells (`sim.motion.response`). Robots are simulated one by one, so that a row depends on nothing
but its inputs: not on the robots beside it, and not on their order.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from sim.arrays import Floats
from sim.effects.tail_contact import EFFECT as CONTACT
from sim.effects.tail_contact import least_gap
from sim.inputs import check_columns
from sim.model.groups import Groups
from sim.model.response import LAG_PARTS
from sim.model.slopes import SLOPE_INPUTS
from sim.motion.response import responses
from sim.motion.sensitivity import sensitivities as derivatives
from sim.motion.steady import steady
from sim.motion.steady_motion import STEADY_COLUMNS

Columns = dict[str, Any]
NO_RESPONSE = "the response to a flip broke down, or asked for more time steps than a row may"
HISTORY = "history"  # an input of a row that is no number of the robot: whether memory and rest are simulated


def simulate(inputs: dict[str, Any], *, sensitivities: bool = False) -> Columns:
    """All columns of the schema except `row`.

    Args:
        inputs: robots by column name, each (B,); `history`, (B,), says of which memory and rest are simulated.
        sensitivities: with derivatives of the steady motion in the inputs.

    Raises:
        InputError: a column is missing or unknown, or a number is outside its range.
    """
    values = check_columns({name: array for name, array in inputs.items() if name != HISTORY})
    history = np.asarray(inputs[HISTORY], dtype=bool)
    rows = [
        _row({name: array[i : i + 1] for name, array in values.items()}, bool(history[i]), sensitivities)
        for i in range(len(history))
    ]
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


def _row(values: dict[str, Floats], history: bool, sensitivities: bool) -> Columns:
    began = time.thread_time()
    groups = Groups.from_columns(values)
    motion = steady(groups)
    response = responses(groups, motion, history=history)
    steady_values = motion.columns()
    columns: Columns = {**values, **{k: steady_values[k] for k in STEADY_COLUMNS}}
    failed = motion.failed | response.failed
    columns |= {
        "net_speed_bar": response.net_speed,
        "error": motion.error,
        "failed": failed,
        "converged": columns["converged"] & ~failed,
        "touching": columns["tail_gap"] < least_gap(values.get(CONTACT.name, 0.0)),
        "stepped": response.stepped,
        HISTORY: np.array([history]),
        "reason": np.where(response.failed & ~motion.failed, NO_RESPONSE, motion.note),
    }
    curves = {"lag": response.lag, "spread": response.spread, "rest": response.rest, "memory": response.memory}
    for name, curve in curves.items():
        for i, axis in enumerate(LAG_PARTS):
            columns[f"{name}_{axis}"] = curve[..., i].reshape(1, -1)
    for name in STEADY_COLUMNS[:7]:
        columns[name] = np.where(failed, np.nan, columns[name])
    if sensitivities:
        slopes = derivatives(groups, SLOPE_INPUTS).derivatives
        columns |= {f"d_{name}": slope for name, slope in slopes.items()}
    columns["N"] = values["N"].astype(int)
    columns["cost_s"] = np.array([time.thread_time() - began])
    return columns
