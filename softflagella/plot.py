"""Pictures of motions, plans, sweeps and verdicts: on the axes `ax`, by default on those of a new figure.

Example:
    >>> import softflagella as sf
    >>> from matplotlib.figure import Figure
    >>> axes = sf.plot.motion("paper-control", ax=Figure().add_subplot())
    >>> axes.get_xlabel()
    'x [cm]'
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from common.errors import InputError
from common.keywords import checks_types
from common.notebook import given_axes

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from calibration.verdict.verdict import Verdict
    from planner.planning.plan import Plan
    from sim.model.robot import Robot


@checks_types
def motion(robot: Robot | str | Path, *, ax: Axes | None = None) -> Axes:
    """Simulate a robot, and draw the circle of its head's centre for each direction of the motor, in cm."""
    from sim.motion.steady import steady
    from sim.pictures.robot_views import plot_circles
    from sim.robot_rows import one_robot

    given = one_robot(robot)
    groups = given.groups()
    both = [steady(each, stability=False) for each in (groups, groups.reversed())]
    ax = given_axes(ax)
    plot_circles(ax, given, both)
    ax.legend(frameon=False, fontsize=8)
    return ax


@checks_types
def plan(result: Plan, *, ax: Axes | None = None) -> Axes:
    """Draw the given, the declared and the predicted path of a plan, with the stated error, in cm."""
    ax = result.plot(given_axes(ax))
    ax.legend(frameon=False, fontsize=8)
    return ax


@checks_types
def sweep(
    rows: pd.DataFrame | str | Path,
    output: str = "R_yr_over_l",
    over: str = "omega_bar",
    *,
    ax: Axes | None = None,
) -> Axes:
    """Draw an output of a sweep against an input: median and middle half of the rows, for each number of tails.

    Args:
        rows: of `read_sweep`, or the folder of the sweep; only converged rows without touching tails are drawn.
        output, over: columns.

    Raises:
        InputError: there is no such column, or it has no single numbers.
    """
    from dataset.data_set import read
    from dataset.figures import add_tails, plot_trend
    from dataset.report import usable_rows

    table = read(str(rows)) if isinstance(rows, str | Path) else rows
    for name in (output, over, "N", "converged", "failed", "touching"):
        if name not in table or table[name].dtype.kind not in "fiub":
            numbers = ", ".join(map(str, table.select_dtypes("number").columns))
            raise InputError(f"{name!r} is no column of numbers in this sweep; there are {numbers}")
    ax, usable = given_axes(ax), usable_rows(table)
    plot_trend(ax, usable, output, over)
    ax.legend(handles=add_tails(ax, usable), frameon=False, fontsize=8)
    return ax


@checks_types
def verdict(result: Verdict, *, ax: Axes | None = None) -> Axes:
    """Draw the residual of each output of a verdict, before and after, over the noise of a run."""
    return result.plot(given_axes(ax))
