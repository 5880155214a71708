"""Inputs -> rows: what is simulated of each robot.

Each robot's steady motion is solved for (`sim.motion.steady`), and from there it is stepped through flips of the
motor with its own half-period (`sim.motion.switching`). Robots are simulated one by one, so that a row depends on
nothing but its inputs: not on the robots beside it, and not on their order.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from sim.arrays import Floats
from sim.inputs import check_columns
from sim.model.groups import DWELL, Groups
from sim.motion.resolution import Resolution
from sim.motion.steady import steady
from sim.motion.steady_motion import STEADY_COLUMNS
from sim.motion.switching import switch_response

Columns = dict[str, Any]
NO_RESPONSE = "the response to a switch broke down, or asked for more time steps than a row may"


def simulate(inputs: dict[str, Floats]) -> Columns:
    """All columns of the schema except `row`.

    Args:
        inputs: robots by column name, `dwell_bar` included, each (B,).

    Raises:
        InputError: a column is missing or unknown, or a number is outside its range.
    """
    values = check_columns({name: array for name, array in inputs.items() if name != DWELL})
    values[DWELL] = np.asarray(inputs[DWELL], dtype=float)
    rows = [_row({name: array[i : i + 1] for name, array in values.items()}) for i in range(len(values["N"]))]
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


def _row(values: dict[str, Floats]) -> Columns:
    began = time.thread_time()
    groups = Groups.from_columns({name: array for name, array in values.items() if name != DWELL})
    motion = steady(groups)
    response = switch_response(groups, values[DWELL], motion)
    resolution = Resolution.fitting(float(values["omega_bar"][0]))
    steady_values = motion.columns()
    columns: Columns = {**values, **{k: steady_values[k] for k in STEADY_COLUMNS}}
    failed = motion.failed | response.failed
    columns |= {
        "net_speed_bar": response.net_speed,
        "lag_psi_rad": response.lag_psi,
        "lag_x": response.lag_x,
        "lag_z": response.lag_z,
        "error": motion.error,
        "failed": failed,
        "converged": columns["converged"] & ~failed,
        "touching": columns["tail_gap"] < 1,
        "edges": np.array([resolution.edges]),
        "steps": np.array([resolution.steps]),
        "reason": np.where(response.failed & ~motion.failed, NO_RESPONSE, motion.note),
    }
    for name in STEADY_COLUMNS[:7]:
        columns[name] = np.where(failed, np.nan, columns[name])
    columns["N"] = values["N"].astype(int)
    columns["cost_s"] = np.array([time.thread_time() - began])
    return columns
