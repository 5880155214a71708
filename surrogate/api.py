"""Ask look-up tables about robots: `softflagella.query` and `inverse`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from common.errors import naming
from common.keywords import checks_keywords
from common.tables import read_table
from sim.model.groups import DWELL
from sim.robot_rows import OneRobot, robot_rows, with_units
from surrogate.answers import answer_rows
from surrogate.interface import LookupTable
from surrogate.inverse import inverse_table
from surrogate.table_file import as_table, trained_table

if TYPE_CHECKING:
    from sim.robot_rows import Robots


@checks_keywords
def query(
    robots: Robots,
    *,
    robot: OneRobot | None = None,
    lookup: LookupTable | str | Path | None = None,
    flag: bool = False,
    certify: bool = False,
    strict: bool = False,
    derivatives: bool | Sequence[str] = False,
) -> pd.DataFrame:
    """Ask a look-up table for the mean motion at constant motor speed, without simulating.

    Args:
        robots, robot: as for `steady`; a table may have a column `dwell_bar`, for the response to flips after it.
        lookup: look-up table, or its file; default: the one that comes with the package.
        flag: give numbers for robots outside the domain, too; the column `outside` says which. Otherwise these
            are missing, and the column `note` says why.
        certify: simulate each robot as well; the column `certified_error` is the actual error of its answer.
        strict: refuse all robots where one is outside the domain.
        derivatives: add the Jacobian, in all dimensionless inputs but N, or in those named; effects may be named,
            too. A column `omega_yr_bar_per_C_yr` is ∂ω̄_yr/∂C_yr. For torch there is `torch_query`.

    Returns:
        A table with M rows and the columns of `steady`, without those that say how a row was simulated. `error` is
        the relative half-width of the 90 % intervals, the largest of spins, yaw rate and velocities.
        `<column>_low` and `<column>_high` are the intervals of the dimensionless columns.

    Raises:
        InputError: a robot cannot be, none is within the domain of the table, an input has no derivatives, or
            `flag` and `strict` are given.

    Example:
        >>> import softflagella as sf
        >>> motion = sf.query(["paper-control", "paper-triangle"])
        >>> motion[["robot", "R_yr_cm", "v_cm_s"]].round(2).values.tolist()
        [['paper-control', 10.36, 0.23], ['paper-triangle', 10.11, 0.36]]
    """
    rows, table = robot_rows(robots, robot, DWELL), as_table(lookup)
    answer = answer_rows(rows, table, flag=flag, certify=certify, strict=strict)
    if derivatives is not False:
        names = () if derivatives is True else derivatives
        slopes = trained_table(table).derivatives(rows.columns, names, flag=True)
        answer |= {
            f"{output}_per_{name}": s + 0 * answer["v_z"]
            for output, part in slopes.items()
            for name, s in part.items()
        }
    return rows.frame(answer)


@checks_keywords
def inverse(
    targets: Mapping[str, Any] | pd.DataFrame | str | Path,
    *,
    free: Sequence[str] | str = "C_t,C_r,C_yr",
    lookup: LookupTable | str | Path | None = None,
) -> pd.DataFrame:
    """Find robots that have given motions, with a trained look-up table.

    Args:
        targets: CSV: the given inputs of the robots, and outputs that they shall have, such as `omega_yr_bar`.
            In Python also M rows of these (single values stand for all rows).
        free: inputs to find, with commas or as a list.
        lookup: a trained table, or its file; default: the one that comes with the package.

    Returns:
        A row for each solution: `target` (the row of the target, from 1), the inputs, `misfit`, `outside`.
        `attrs["targets"]` is their number.

    Raises:
        InputError: there is no output among the columns, or an input cannot be found.

    Example:
        >>> import softflagella as sf
        >>> robot = sf.load_robot("paper-control").group_values()
        >>> given = {name: value for name, value in robot.items() if name != "C_yr"}
        >>> sf.inverse({**given, "omega_yr_bar": 0.06}, free=["C_yr"])["C_yr"].round(2).tolist()
        [2.45]
    """
    file = None
    if isinstance(targets, str | Path):
        file, targets = targets, read_table(targets)
    points = pd.DataFrame(dict(targets), index=_index(targets))
    names = [name.strip() for name in free.split(",")] if isinstance(free, str) else free
    with naming(file):
        table = inverse_table(trained_table(lookup), points, names, where=str(file or "the table"))
    table.attrs["targets"] = len(points)
    return with_units(table)


def _index(targets: Mapping[str, Any] | pd.DataFrame) -> Any:
    """Return the rows of a table of single values; None where columns say how many there are."""
    if isinstance(targets, pd.DataFrame) or any(hasattr(values, "__len__") for values in targets.values()):
        return None
    return [0]
