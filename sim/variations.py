"""Vary one number of a robot, or two: a robot for each value, or each pair of values, all solved in one batch.

A variation is KEY=VALUES with a key TABLE.KEY of robot.toml. Values are FROM:TO:COUNT, equally spaced;
FROM:TO:COUNTlog, spaced by equal ratios; or a list A,B,C.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from common.arrays import Flags, Floats
from common.changes import RobotSource, changed, changes_of
from common.errors import InputError
from common.units import split
from sim.inputs import check_columns, group_columns, load_robot, names_robot, robot_content, robot_of
from sim.model.robot_toml import check_keys
from sim.motion.steady_motion import LARGE_ERROR, lab_title
from sim.robot_rows import RobotRows

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_SPACED = re.compile(r"([^:,]+):([^:,]+):(\d{1,9})(log)?")
_MOST = 10_000  # robots
_DRAWN = ("v_cm_s", "omega_yr_rad_s", "R_yr_cm", "theta_deg")


class Variation(NamedTuple):
    """A number of robot.toml and its values, rising."""

    key: str
    values: Floats
    logarithmic: bool = False

    @property
    def title(self) -> str:
        """The key with its unit as people write it: motor.speed [rpm]."""
        name = split(self.key)
        return f"{name.quantity} [{name.unit.text}]" if name.unit else self.key


def read_variation(words: str) -> Variation:
    """Read KEY=VALUES.

    Raises:
        InputError: the words are no variation.
    """
    key, _, text = words.partition("=")
    low, high, number, log = match.groups() if (match := _SPACED.fullmatch(text)) else (None,) * 4
    try:
        ends = [float(each) for each in ((low, high) if low and high else text.split(","))]
        count = int(number or len(ends))
        if not 2 <= count <= _MOST or (log and min(ends) <= 0) or not all(map(math.isfinite, ends)):
            raise ValueError
    except ValueError:
        raise InputError(
            f"--vary {words}; write KEY=FROM:TO:COUNT, such as motor.speed_rpm=20:120:11, FROM:TO:COUNTlog above "
            f"0, or a list, fluid.viscosity_Pa_s=0.7,1.5, of 2 to {_MOST} values"
        ) from None
    spaced = np.geomspace if log else np.linspace
    return Variation(key, np.unique(spaced(ends[0], ends[1], count) if number else ends), bool(log))


def vary(
    source: RobotSource, variations: Sequence[Variation], solve: Callable[[RobotRows], Mapping[str, Any]]
) -> pd.DataFrame:
    """Solve robots with varied numbers; return a row for each, the first variation fastest.

    Args:
        source: a robot.toml or the name of a preset.
        variations: one or two.
        solve: from robots to the columns of their motion.

    Returns:
        The varied numbers, the motion, NaN for a robot that cannot be, and `note`, which says why.

    Raises:
        InputError: there is no such robot or number, or none of the robots can be.
    """
    if not names_robot(source):
        raise InputError(f"--vary changes one robot; give a robot.toml or a preset, not {source}")
    load_robot(source)  # refuses what is none, and asks about doubtful numbers
    keys = [variation.key for variation in variations]
    check_keys(keys, "--vary")
    quantities = {split(key).quantity for key in keys} - {"name"}
    count = math.prod(len(variation.values) for variation in variations)
    if not len(keys) == len(quantities) <= 2 or count > _MOST:
        raise InputError(
            f"--vary {', '.join(keys)}; vary one number or two different ones, {_MOST} robots at most"
        )
    meshes = np.meshgrid(*(variation.values for variation in variations[::-1]), indexing="ij")
    numbers = dict(zip(keys, (mesh.ravel() for mesh in meshes[::-1]), strict=True))
    content, robots, refused = changed(robot_content(source), changes_of(source)), [], {}
    for row in range(count):
        values = {key: float(column[row]) for key, column in numbers.items()}
        whole = {key: int(value) if value.is_integer() else value for key, value in values.items()}
        try:
            robot = robot_of(changed(content, whole), Path(source).stem)
            check_columns(group_columns([robot]))
            robots.append(robot)
        except InputError as refusal:
            refused[row] = str(refusal)
    if not robots:
        raise InputError(f"--vary {keys[0]}: none of these robots can be: {refused[0]}")
    rows = RobotRows(check_columns(group_columns(robots)), tuple(robots), {})
    table = rows.frame(solve(rows))
    table.index = [row for row in range(count) if row not in refused]
    table = table.reindex(range(count))
    notes = table["note"] if "note" in table else [""] * count
    return table.assign(**numbers, note=[refused.get(row, note) for row, note in enumerate(notes)])


def write_variations(
    source: RobotSource,
    words: Sequence[str],
    solve: Callable[[RobotRows], Mapping[str, Any]],
    out: str | None,
    plot: str | None,
) -> None:
    """Vary a robot; write the motion as CSV, with `plot` beside the figure, or print it where no file is named."""
    from common.figure_files import check_figure_name, write_figure
    from common.files import write_csv

    if not words:
        raise InputError("--plot draws what is varied; add --vary, such as --vary motor.speed_rpm=20:120:11")
    if plot is not None:
        check_figure_name(plot)
        out = out or str(Path(plot).with_suffix(".csv"))
    variations = [read_variation(each) for each in words]
    table = vary(source, variations, solve)
    doubtful, none = (int(flags.sum()) for flags in doubts(table))
    if none == len(table):
        raise InputError(f"--vary {words[0]}: no steady motion was found: {table['note'].iloc[0]}")
    said = f"{len(table)} robot{'s' * (len(table) > 1)}"
    said += f", {doubtful} without a reliable answer" * bool(doubtful)
    said += f", {none} that cannot be simulated" * bool(none)
    first = [variation.key for variation in variations]
    if out is None:
        shown = table[[*first, *_DRAWN, "note"]]
        return print(shown.to_string(index=False, float_format="{:.4g}".format, na_rep="-"), said, sep="\n")
    write_csv(table[[*first, *table.columns.difference(first, sort=False)]], out)
    if plot is not None:
        write_figure(draw_variations(load_robot(source).name, variations, table), plot)
    print(said, "->", ", ".join(filter(None, (plot, out))))


def doubts(table: pd.DataFrame) -> tuple[Flags, Flags]:
    """Tell which rows have no reliable answer, and which none at all, (P,) each."""
    none = table["v_cm_s"].isna().to_numpy()
    wrong = table["error"].to_numpy(dtype=float) > LARGE_ERROR
    return (wrong | table["converged"].ne(True).to_numpy()) & ~none, none


def draw_variations(title: str, variations: Sequence[Variation], table: pd.DataFrame) -> Figure:
    """Draw speed, yaw rate, turn radius and slip angle against the first number, a curve for each second one."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    first, second = variations[0], variations[1] if variations[1:] else None
    x, shape = first.values, (-1, len(first.values))
    doubtful, none = (flags.reshape(shape) for flags in doubts(table))
    figure = Figure(figsize=(7.5, 5.8), layout="constrained")
    for name, axes in zip(_DRAWN, figure.subplots(2, 2, sharex=True).flat, strict=True):
        curves = table[name].to_numpy(dtype=float).reshape(shape)
        for k, colour in enumerate(mpl.colormaps["viridis"](np.linspace(0, 0.85, len(curves)))):
            label = f"{second.values[k]:.4g}" if second else None
            axes.plot(x, curves[k], "o-", color=colour, lw=1.2, ms=4, label=label)
            axes.plot(x[doubtful[k]], curves[k][doubtful[k]], "o", color=colour, mfc="white", ms=4)
        # An empty curve gives the legend one entry for all doubtful points.
        if doubtful.any():
            axes.plot([], [], "o", color="black", mfc="white", ms=4, label="no reliable answer")
        if none.any():
            at = x[none.any(0)]
            bottom, words = axes.get_xaxis_transform(), "cannot be simulated"
            axes.plot(at, 0.03 + 0 * at, "rx", ms=5, transform=bottom, label=words)
        axes.set(ylabel=lab_title(name), xscale="log" if first.logarithmic else "linear")
        axes.grid(alpha=0.25)
    for axes in figure.axes[2:]:
        axes.set_xlabel(first.title)
    figure.suptitle(title, fontsize=11, parse_math=False)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    if handles:
        heading = second.title if second else None
        figure.legend(
            handles, labels, title=heading, loc="outside lower center", fontsize=8, ncols=6, frameon=False
        )
    return figure
