"""Draw the figures of the sweep report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from common.arrays import Floats
from dataset.schema import column_named
from dataset.statistics import Indices
from sim.model.response import DWELLS

COLOURS = ("#5b6a78", "#2a7fba", "#e08a1e", "#3d9a5f", "#8a4fa3", "#c8452f", "#7a5c3e", "#1c2733")  # N = 1 to 8
RESPONSES = ("lag_psi_rad", "lag_z", "net_speed_bar")  # the columns of responses that are drawn
_Axes = Literal["both", "x", "y"]
_BINS = 10
_MOST_BANDS = 4  # with more numbers of tails, one band is drawn for all
_ALL = "#5b6a78"
_FEWEST = 12  # rows in a bin that is drawn


def colour(tails: float) -> str:
    """Return the colour of a number of tails."""
    return COLOURS[(int(tails) - 1) % len(COLOURS)]


def draw_trends(rows: pd.DataFrame, output: str, inputs: Sequence[str]) -> Figure:
    """Draw an output against each input: medians and the middle half of the rows, by number of tails."""
    columns = 4
    figure = Figure(figsize=(11, 2.6 * -(-len(inputs) // columns)))
    for panel, name in enumerate(inputs):
        axes = figure.add_subplot(-(-len(inputs) // columns), columns, panel + 1)
        plot_trend(axes, rows, output, name)
        if panel % columns:
            axes.set_ylabel("")
    return _with_tails_above(figure, rows, 0.95)


def plot_trend(axes: Axes, rows: pd.DataFrame, output: str, name: str) -> None:
    """Draw an output against an input, as `draw_trends` does, without a legend."""
    parts = [(colour(float(str(tails))), part) for tails, part in rows.groupby("N")]
    x, y = column_named(name), column_named(output)
    if len(parts) > _MOST_BANDS:
        _draw_band(axes, rows[name].to_numpy(float), rows[output].to_numpy(float), _ALL, line=False)
    for shade, part in parts:
        values = part[name].to_numpy(float), part[output].to_numpy(float)
        _draw_band(axes, *values, shade, band=len(parts) <= _MOST_BANDS)
    _style(axes, x=x.title, y=y.title, logarithmic="x" * x.logarithmic + "y" * y.logarithmic)


def _draw_band(axes: Axes, x: Floats, y: Floats, shade: str, *, line: bool = True, band: bool = True) -> None:
    """Draw median (line) and quartiles (band) of y in bins of equally many rows; few rows are drawn as points."""
    good = np.isfinite(x) & np.isfinite(y)
    if good.sum() < 2 * _FEWEST:
        if line:
            axes.plot(x[good], y[good], ".", ms=4, color=shade)
        return
    x, y = x[good], y[good]
    bins = min(_BINS, good.sum() // _FEWEST)
    edges = np.quantile(x, np.linspace(0, 1, bins + 1))
    bin_number = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bins - 1)
    members = [bin_number == i for i in range(bins) if (bin_number == i).any()]
    middle = [float(np.median(x[rows])) for rows in members]
    quartiles = np.array([np.quantile(y[rows], [0.25, 0.5, 0.75]) for rows in members])
    if line:
        axes.plot(middle, quartiles[:, 1], color=shade, lw=1.4)
    if band:
        axes.fill_between(middle, quartiles[:, 0], quartiles[:, 2], color=shade, alpha=0.15, lw=0)


def draw_indices(by_output: Mapping[str, Indices]) -> Figure:
    """Draw total indices as pale bars with their intervals, first-order indices as full bars."""
    figure = Figure(figsize=(11, 3.2))
    for panel, (output, indices) in enumerate(by_output.items()):
        axes = figure.add_subplot(1, len(by_output), panel + 1)
        y = np.arange(len(indices.inputs))[::-1]
        axes.barh(y, indices.total, color="#2a7fba", alpha=0.3, height=0.7, label="total")
        axes.barh(y, indices.first, color="#2a7fba", height=0.4, label="first order")
        spread = np.abs(indices.total_bounds.T - indices.total)
        axes.errorbar(indices.total, y, xerr=spread, fmt="none", ecolor="#1c2733", elinewidth=0.8, capsize=2)
        axes.set_yticks(y, [column_named(name).title for name in indices.inputs], fontsize=9)
        axes.set_xlim(0, 1)
        _style(axes, title=column_named(output).title, numbered="x")
    return _finished(figure, loc="lower right")


def draw_collapse(rows: pd.DataFrame, linear: Mapping[str, Floats], outputs: Sequence[str]) -> Figure:
    """Draw outputs over their values in linear theory, against the drag number S of a tail."""
    figure = Figure(figsize=(11, 3))
    for panel, output in enumerate(outputs):
        axes = figure.add_subplot(1, len(outputs), panel + 1)
        ratio = np.abs(rows[output].to_numpy(float)) / linear[output]
        tails = rows["N"].to_numpy()
        for n in sorted(set(tails)):
            finite = (tails == n) & np.isfinite(ratio)
            axes.plot(linear["S"][finite], ratio[finite], ".", ms=2.5, alpha=0.5, color=colour(n))
        axes.axhline(1, color="#1c2733", lw=0.8)
        low, high = np.nanquantile(ratio, [0.005, 0.995])
        axes.set_ylim(low - 0.1 * (high - low), high + 0.1 * (high - low))
        title = f"{column_named(output).title} / linear theory"
        _style(axes, x="$S = \\zeta_\\perp\\omega_t l^4/EI$", title=title, logarithmic="x")
    return _with_tails_above(figure, rows, 0.92)


def draw_responses(rows: pd.DataFrame) -> Figure:
    """Draw lags and net speed over the dwell: medians and the middle half, for slow, medium and fast motors."""
    figure = Figure(figsize=(11, 3))
    speed = np.hypot(rows["v_x"].to_numpy(float), rows["v_z"].to_numpy(float))
    turn = np.abs(rows["omega_yr_bar"]).to_numpy(float)
    scales = (
        (turn, "heading lag / yaw rate [time units]"),
        (rows["v_z"].to_numpy(float), "forward lag / surge [time units]"),
        (speed, "net speed / speed"),
    )
    thirds = np.asarray(pd.qcut(rows["omega_bar"].abs(), 3, labels=False))
    for panel, (name, (scale, label)) in enumerate(zip(RESPONSES, scales, strict=True)):
        axes = figure.add_subplot(1, 3, panel + 1)
        curves = np.stack([np.asarray(curve, dtype=float) for curve in rows[name]]) / scale[:, None]
        if name == "net_speed_bar" and rows["history"].any():  # else that of short dwells is unknown
            curves[~rows["history"].to_numpy(bool)] = np.nan
        for third, (shade, which) in enumerate(zip(COLOURS[1:4], ("slow", "medium", "fast"), strict=True)):
            group = curves[thirds == third]
            group = group[np.isfinite(group).any(1)]
            if not len(group):
                continue
            known = np.isfinite(group).mean(0) > 0.5
            low, middle, high = np.nanquantile(group[:, known], [0.25, 0.5, 0.75], axis=0)
            axes.plot(DWELLS[known], middle, color=shade, lw=1.4, label=f"{which} motors")
            axes.fill_between(DWELLS[known], low, high, color=shade, alpha=0.15, lw=0)
        _style(axes, x="dwell $\\bar T$", title=label, logarithmic="x")
    return _finished(figure)


def draw_where(rows: pd.DataFrame) -> Figure:
    """Draw the shares of rows whose tails touch, and of rows that failed or needed time steps, over ω̄."""
    figure = Figure(figsize=(11, 2.8))
    panels = (("touching", "tails touch"), ("hard", "failed, or needed time steps"))
    for panel, (name, label) in enumerate(panels):
        axes = figure.add_subplot(1, 2, panel + 1)
        for tails, part in rows.groupby("N"):
            bins = np.array_split(np.argsort(part["omega_bar"].to_numpy()), max(1, min(_BINS, len(part) // 20)))
            speed = [float(np.median(part["omega_bar"].to_numpy()[b])) for b in bins]
            share = [100 * float(np.mean(part[name].to_numpy()[b])) for b in bins]
            axes.plot(speed, share, "-o", ms=3, lw=1.2, color=colour(float(str(tails))), label=f"N = {tails}")
        axes.set_ylim(bottom=0)
        _style(axes, x=column_named("omega_bar").title, y="share of rows [%]", title=label, logarithmic="x")
    return _finished(figure)


def _style(
    axes: Axes, *, x: str = "", y: str = "", title: str = "", logarithmic: str = "", numbered: _Axes = "both"
) -> None:
    """Give axes what all figures have in common: labels, scales, small ticks and a pale grid.

    Args:
        x, y, title: labels.
        logarithmic: the axes with a logarithmic scale: "", "x", "y" or "xy".
        numbered: the axes with numbers and grid lines.
    """
    axes.set_xlabel(x, fontsize=9)
    axes.set_ylabel(y, fontsize=9)
    axes.set_title(title, fontsize=9)
    if "x" in logarithmic:
        axes.set_xscale("log")
        _label_plainly(axes.xaxis)
    if "y" in logarithmic:
        axes.set_yscale("log")
        _label_plainly(axes.yaxis)
    axes.tick_params(axis=numbered, labelsize=7)
    axes.grid(axis=numbered, alpha=0.25, lw=0.5)


def _with_tails_above(figure: Figure, rows: pd.DataFrame, top: float) -> Figure:
    """Add a legend of the numbers of tails above the panels, which end at `top` of the figure's height."""
    axes = figure.axes[0]
    handles = add_tails(axes, rows)
    figure.legend(handles=handles, ncols=len(handles), fontsize=8, frameon=False, loc="upper center")
    figure.tight_layout(rect=(0, 0, 1, top))
    return figure


def add_tails(axes: Axes, rows: pd.DataFrame) -> list[Line2D]:
    """Add what a legend of the numbers of tails shows."""
    return [axes.plot([], [], color=colour(n), label=f"N = {n}")[0] for n in sorted(set(rows["N"]))]


def _finished(figure: Figure, **legend: Any) -> Figure:
    """Add a legend in the first panel."""
    figure.axes[0].legend(fontsize=7, frameon=False, **legend)
    figure.tight_layout()
    return figure


def _label_plainly(axis: Axis) -> None:
    """Label a logarithmic axis with a few plain numbers: 1, 2 and 5 times 1, 10, …."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=8))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
    axis.set_minor_locator(NullLocator())
