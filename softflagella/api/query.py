"""Ask look-up tables about robots: `softflagella.query`."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from sim.motion.lab_units import lab_motion
from softflagella.api.robots import Robots, robot_rows
from surrogate.interface import LookupTable
from surrogate.table.answers import answer_with_error
from surrogate.table.model_file import load_table


def query(
    robots: Robots, *, table: LookupTable | str | Path | None = None, flag: bool = False, certify: bool = False
) -> pd.DataFrame:
    """Ask a look-up table for the mean motion at constant motor speed, without simulating.

    Args:
        robots: as for `steady`.
        table: the table, or its file; default: the one that comes with the package.
        flag: answer for robots outside the domain as well; the column `outside` says which.
        certify: simulate each robot as well; the column `certified_error` is the actual error of its answer.

    Returns:
        A table with M rows and the columns of `steady`, without those that say how a row was simulated. `error` is
        the relative half-width of the 90 % intervals, the largest of spins, yaw rate and velocities.
        `<column>_low` and `<column>_high` are the intervals of the dimensionless columns.

    Raises:
        InputError: a robot cannot be, or is outside the domain of the table.

    Example:
        >>> import softflagella as sf
        >>> motion = sf.query(["paper-control", "paper-triangle"])
        >>> motion[["robot", "R_yr_cm", "v_cm_s"]].round(2).values.tolist()
        [['paper-control', 10.36, 0.23], ['paper-triangle', 10.11, 0.36]]
    """
    rows = robot_rows(robots)
    lookup = load_table(table) if table is None or isinstance(table, str | Path) else table
    answer = answer_with_error(lookup, rows.columns, flag=flag, certify=certify)
    return rows.frame(lab_motion(rows.robots, answer) if rows.robots else {}, answer)
