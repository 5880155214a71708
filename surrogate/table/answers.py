"""Ask a look-up table for the motion of robots, each with an error of its own.

    error = largest half-width of the 90 % intervals of spins, yaw rate and velocities, relative to the value
            (of velocities: to the speed)

A table of one robot has no intervals. Its error is the largest of those that it states.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from typing import Any

import numpy as np

from sim.arrays import Floats
from sim.robot_rows import RobotRows
from surrogate.interface import LookupTable
from surrogate.table.certify import CERTIFIED_OUTPUTS, RATES
from surrogate.table.lookup import NeuralTable
from surrogate.table.refusals import refusing_robots


def answer_with_error(
    table: LookupTable, columns: Mapping[str, Floats], *, flag: bool = False, certify: bool = False
) -> dict[str, Any]:
    """Predict outputs, their intervals where the table has them, and `error`, each (M,).

    Args:
        table: the table.
        columns: robots by column name, each (M,).
        flag: answer for robots outside the domain as well, see `NeuralTable.query`.
        certify: simulate each robot as well.

    Raises:
        InputError: a robot that cannot be, or one outside the domain.
    """
    if not isinstance(table, NeuralTable):
        answer: dict[str, Any] = dict(table.query(columns))
        error = max(table.errors[name]["rms"] for name in CERTIFIED_OUTPUTS if name in table.errors)
        return {**answer, "error": np.full(len(answer["v_z"]), error)}
    intervals = table.intervals is not None
    answer = table.query(columns, intervals=intervals, flag=flag, certify=certify)
    if not intervals:
        return answer
    speed = np.hypot(answer["v_x"], answer["v_z"])
    sizes = {name: np.abs(answer[name]) if name in RATES else speed for name in CERTIFIED_OUTPUTS}
    with np.errstate(divide="ignore", invalid="ignore"):  # a rate of zero
        widths = [(answer[f"{name}_high"] - answer[f"{name}_low"]) / 2 / size for name, size in sizes.items()]
    return {**answer, "error": np.max(widths, axis=0)}


def answer_rows(
    rows: RobotRows, table: LookupTable, *, flag: bool = False, certify: bool = False
) -> dict[str, Any]:
    """Answer as `answer_with_error`; refusals name the robots, and the file of their table."""
    with rows.naming(), refusing_robots(rows.robots, table) if rows.robots else nullcontext():
        return answer_with_error(table, rows.columns, flag=flag, certify=certify)
