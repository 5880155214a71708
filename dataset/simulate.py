"""Simulate rows: all columns of each robot, from its inputs.

Each robot's steady motion is solved for (`sim.motion.steady`), and from there its response to a flip of the motor,
over all dwells (`sim.motion.response`). Robots of one N share groups (`sim.lanes`), in which a robot's numbers do
not depend on the others. So a row depends only on its inputs, neither on other robots nor on their order.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from common.arrays import Flags, Floats, Integers
from dataset.schema import COST, OUTPUTS
from sim.effects.tail_contact import EFFECT as CONTACT
from sim.effects.tail_contact import least_gap
from sim.inputs import check_columns
from sim.model.groups import SLOPE_INPUTS, Groups
from sim.model.response import LAG_PARTS
from sim.motion.response import responses
from sim.motion.sensitivity import sensitivities as derivatives
from sim.motion.steady import steady
from sim.motion.steady_motion import STEADY_COLUMNS

Columns = dict[str, Any]
NO_RESPONSE = "the response to a flip broke down, or asked for more time steps than a row may"
HISTORY = "history"  # not a property of the robot: whether memory and rest are simulated


def simulate(inputs: dict[str, Any], *, sensitivities: bool = False) -> Columns:
    """Simulate all columns of the schema except `row`.

    Args:
        inputs: robots by column name, each (B,); `history`, (B,), says for which robots memory and rest are
        simulated.
        sensitivities: also return derivatives of the steady motion in the inputs.

    Raises:
        InputError: a column is missing or unknown, or a number is outside its range.
    """
    values = check_columns({name: array for name, array in inputs.items() if name != HISTORY})
    history = np.asarray(inputs[HISTORY], dtype=bool)
    parts: list[Columns] = []
    places: list[Integers] = []
    for with_history, tails in sorted(set(zip(history.tolist(), values["N"].tolist(), strict=True))):
        alike = np.flatnonzero((history == with_history) & (values["N"] == tails))
        picked = {name: array[alike] for name, array in values.items()}
        parts.append(_rows(picked, with_history, sensitivities))
        places.append(alike)
    order = np.argsort(np.concatenate(places))
    return {name: np.concatenate([part[name] for part in parts])[order] for name in parts[0]}


def _rows(values: dict[str, Floats], history: bool, sensitivities: bool) -> Columns:
    """Simulate robots of one N."""
    began, count = time.thread_time(), len(values["N"])
    groups = Groups.from_columns(values)
    motion = steady(groups, stability=False)
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
        HISTORY: np.full(count, history),
        "reason": np.where(response.failed & ~motion.failed, NO_RESPONSE, motion.note),
    }
    curves = {"lag": response.lag, "spread": response.spread, "rest": response.rest, "memory": response.memory}
    for name, curve in curves.items():
        for i, axis in enumerate(LAG_PARTS):
            columns[f"{name}_{axis}"] = curve[..., i].reshape(count, -1)
    clear_failed(columns, failed)
    if sensitivities:
        slopes = derivatives(groups, SLOPE_INPUTS).derivatives
        columns |= {f"d_{name}": slope for name, slope in slopes.items()}
    columns["N"] = values["N"].astype(int)
    columns[COST] = np.full(count, (time.thread_time() - began) / count)
    return columns


def clear_failed(columns: Columns, failed: Flags) -> None:
    """Set the outputs of failed rows to NaN, in place; a column may say that its value is kept."""
    for column in OUTPUTS:
        if not column.kept:
            columns[column.name] = np.array(columns[column.name])
            columns[column.name][failed] = np.nan
