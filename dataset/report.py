"""A data set at a glance: outputs against motor speed, counts and ranges, one page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from dataset.schema import INPUTS
from dataset.store import read, read_manifest
from sim.io.pages import Page

COLOURS = {2: "#2a7fba", 3: "#e08a1e", 4: "#3d9a5f", 5: "#8a4fa3"}
_SHOWN = (
    ("omega_yr_bar", "yaw rate $\\bar\\omega_{yr}$", "log"),
    ("R_yr_over_l", "turn radius $R_{yr}/l$", "linear"),
    ("theta_deg", "slip angle $\\theta$ [deg]", "linear"),
    ("net_speed_bar", "net speed $\\bar v$", "log"),
    ("share", "head's share $|\\omega_h|/\\omega$", "linear"),
    ("tail_gap", "gap between tails / $2r_0$", "log"),
)


def draw_sweep(rows: pd.DataFrame) -> Figure:
    """Six outputs against ω̄, coloured by N; rows whose tails touch are pale."""
    table = rows.assign(share=-rows["omega_h_bar"] / rows["omega_bar"])
    figure = Figure(figsize=(11, 6))
    for place, (name, label, scale) in enumerate(_SHOWN):
        axes = figure.add_subplot(2, 3, place + 1)
        for count, part in table.groupby("N"):
            for touching, alpha in ((False, 0.8), (True, 0.15)):
                some = part[part["touching"] == touching]
                good = some[some[name] > 0] if scale == "log" else some
                axes.scatter(
                    good["omega_bar"],
                    good[name],
                    s=5,
                    alpha=alpha,
                    color=COLOURS.get(int(str(count)), "#555555"),
                    lw=0,
                    label=f"N = {count}" if not touching else None,
                )
        axes.set_xscale("log")
        axes.set_yscale(scale)
        plain_logarithms(axes.xaxis)
        if scale == "log":
            plain_logarithms(axes.yaxis)
        axes.set_xlabel("motor speed $\\bar\\omega$")
        axes.set_ylabel(label)
        axes.grid(alpha=0.25, lw=0.5)
    figure.axes[0].legend(fontsize=8, frameon=False)
    figure.tight_layout()
    return figure


def plain_logarithms(axis: Axis) -> None:
    """Label a logarithmic axis with few plain numbers (1, 2, 5, 10, …)."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=8))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def write_report(folder: str, out: str | Path) -> None:
    """Write the page of a finished data set."""
    manifest, rows = read_manifest(folder), read(folder)
    page = Page("Sweep at a glance", f"{len(rows)} robots, simulated to steady motion and through flips.")
    page.section("Outputs")
    page.text("Each point is one robot; pale points have tails that touch, where the model has no contact.")
    page.figure(draw_sweep(rows), "six outputs against motor speed, by number of tails")
    page.section("Inputs")
    ranges = [(c.name, f"{rows[c.name].min():.4g}", f"{rows[c.name].max():.4g}", c.unit) for c in INPUTS]
    page.table(("input", "smallest", "largest", "unit"), ranges)
    page.section("Rows")
    flags = [(name, int(np.count_nonzero(rows[name]))) for name in ("converged", "failed", "touching")]
    page.table(("flag", "rows"), flags)
    page.write(out, f"configuration {manifest['config_hash']}, code {manifest['code_version']}")
