"""Table, picture and page of the steady motions along an input (`sim.motion.branches`)."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from pandas import DataFrame

from sim.arrays import Floats
from sim.io.files import make_folder, whole_file, write_csv
from sim.io.pages import BLUE, GREEN, INK, ORANGE, RED, SOFT, VIOLET, Page
from sim.io.provenance import code_version
from sim.motion.branches import Branch, Branches, Motion
from sim.motion.stability import DOUBLING, FOLD, HOPF
from sim.motion.swept_input import SweptState

UP, DOWN = "time steps, up", "time steps, down"
_MARKS = {FOLD: ("o", RED), HOPF: ("s", VIOLET), DOUBLING: ("D", GREEN)}
_LINEAR = 1.0  # growth up to which its axis is linear; beyond, it is logarithmic
_NAMES = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z")


def branch_table(result: Branches) -> DataFrame:
    """Make a table of all points: those of the branches in the order along each, then those of the slow sweeps.

    Columns: the input; `branch` (from 1; 0 for time steps) and `origin`; whether the tails move alike; the
    means of `sim.motion.steady_motion.STEADY_OUTPUTS`; growth, stability, `turns` (`sim.motion.stability`);
    `kind`, where a fold, Hopf point or period doubling was located; `converged`: false where time steps did not
    settle.
    """
    rows = []
    for number, branch in enumerate(result.branches, 1):
        for motion in branch.motions:
            rows.append(
                {
                    **_means(result, motion.s, motion.means),
                    "branch": number,
                    "origin": "continuation",
                    "tails_alike": branch.alike,
                    "growth": motion.leading.growth,
                    "stable": motion.stable,
                    "turns": motion.leading.turns,
                    "kind": motion.kind,
                    "converged": True,
                }
            )
    for origin, sweep in ((UP, result.up), (DOWN, result.down)):
        for stepped in sweep:
            values = _means(result, stepped.s, stepped.means)
            rows.append({**values, "branch": 0, "origin": origin, "kind": "", "converged": stepped.settled})
    return DataFrame(rows)


def _means(result: Branches, s: float, means: Floats) -> dict[str, Any]:
    speed = float(np.hypot(means[3], means[4]))
    return {
        result.swept.column: result.swept.value(s),
        **dict(zip(_NAMES, map(float, means), strict=True)),
        "R_yr_over_l": speed / abs(float(means[2])) if means[2] else np.inf,
        "theta_deg": float(np.degrees(np.arctan2(abs(means[3]), means[4]))),
        "omega_yr_rad_s": _yaw_rate(result, s, means),
    }


def _yaw_rate(result: Branches, s: float, means: Floats) -> float:
    """Convert the yaw rate to rad/s, with the robot's unit of time."""
    return float(means[2]) / result.swept.robot.time_scale


def special_rows(result: Branches) -> list[list[str]]:
    """List the special points: branch, kind, input, yaw rate, growth."""
    return [
        [
            str(number),
            motion.kind,
            f"{result.swept.value(motion.s):.4g}",
            f"{_yaw_rate(result, motion.s, motion.means):.4g} rad/s",
            f"{motion.leading.growth:.2g}",
        ]
        for number, branch in enumerate(result.branches, 1)
        for motion in branch.special
    ]


def largest_hysteresis(result: Branches) -> tuple[float, float]:
    """Find the largest relative difference between the yaw rates of the slow sweeps, and the input there."""
    down = {round(motion.s, 9): motion for motion in result.down if motion.settled}
    largest, place = 0.0, np.nan
    for motion in result.up:
        other = down.get(round(motion.s, 9))
        if motion.settled and other is not None:
            away = abs(motion.means[2] / other.means[2] - 1)
            if away > largest:
                largest, place = float(away), result.swept.value(motion.s)
    return largest, place


def draw_branches(result: Branches) -> Figure:
    """Draw yaw rate and growth along the input: stable solid, unstable dashed; special points; slow sweeps."""
    figure = Figure(figsize=(7.2, 6.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    shown: set[str] = set()

    def once(label: str) -> str | None:
        if label in shown:
            return None
        shown.add(label)
        return label

    for branch in result.branches:
        colour = BLUE if branch.alike else ORANGE
        who = "tails alike" if branch.alike else "tails not alike"
        for stable, part in _stretches(branch):
            inputs = [result.swept.value(motion.s) for motion in part]
            style = {"color": colour, "lw": 1.8 if stable else 1.1, "ls": "-" if stable else (0, (4, 2))}
            label = once(f"{who}, {'stable' if stable else 'unstable'}")
            upper.plot(inputs, [_yaw_rate(result, m.s, m.means) for m in part], label=label, **style)
            lower.plot(inputs, [m.leading.growth for m in part], **style)
        for motion in branch.special:
            mark, edge = _MARKS[motion.kind]
            options = {"marker": mark, "ms": 6, "mfc": "white", "mec": edge, "mew": 1.5, "ls": "", "zorder": 5}
            at = result.swept.value(motion.s)
            upper.plot(at, _yaw_rate(result, motion.s, motion.means), label=once(motion.kind), **options)
            lower.plot(at, motion.leading.growth, **options)
    for label, sweep, mark in ((UP, result.up, "^"), (DOWN, result.down, "v")):
        _draw_sweep(upper, result, sweep, label, mark)
    lower.axhline(0.0, color=SOFT, lw=0.8)
    lower.set_yscale("symlog", linthresh=_LINEAR)
    lower.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    upper.set_ylabel("yaw rate [rad/s]")
    lower.set_ylabel("growth in a motor revolution")
    lower.set_xlabel(result.swept.label)
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    upper.legend(fontsize=8, frameon=False, loc="upper left")
    upper.set_title(f"{result.swept.robot.name}: steady motions", fontsize=10)
    return figure


def _draw_sweep(axes: Any, result: Branches, sweep: list[SweptState], label: str, mark: str) -> None:
    """Draw where time steps ended; unsettled motions are pale."""
    for settled in (True, False):
        points = [m for m in sweep if m.settled == settled and np.isfinite(m.means).all()]
        if points:
            axes.plot(
                [result.swept.value(m.s) for m in points],
                [_yaw_rate(result, m.s, m.means) for m in points],
                ls="", marker=mark, ms=4.5, mfc="none", mec=INK, alpha=0.85 if settled else 0.3,
                label=label if settled else f"{label}, unsettled", zorder=4,
            )  # fmt: skip


def _stretches(branch: Branch) -> list[tuple[bool, list[Motion]]]:
    """Split a branch where its stability changes; neighbours share a point."""
    parts: list[tuple[bool, list[Motion]]] = []
    for before, motion in pairwise(branch.motions):
        stable = (motion if before.kind else before).stable
        if parts and parts[-1][0] == stable:
            parts[-1][1].append(motion)
        else:
            parts.append((stable, [before, motion]))
    return parts or [(branch.motions[0].stable, branch.motions)]


def write_branches(result: Branches, out: str | Path) -> list[Path]:
    """Write the CSV, the picture and the page, and return their names.

    Args:
        result: the steady motions.
        out: a folder for branches.csv, branches.png and branches.html, or the page's name, NAME.html; then the
            others are beside it.

    Raises:
        InputError: a file cannot be written.
    """
    path = Path(out)
    if path.suffix.lower() not in (".html", ".htm"):
        make_folder(path)
        path = path / "branches.html"
    table, picture = path.with_suffix(".csv"), path.with_suffix(".png")
    figure = draw_branches(result)
    write_csv(branch_table(result), table)
    with whole_file(picture) as part:
        figure.savefig(part, format="png", dpi=130)
    _write_page(result, figure, path)
    return [path, table, picture]


def _write_page(result: Branches, figure: Figure, path: Path) -> None:
    """Write the page: the picture, the special points, the branches."""
    swept = result.swept
    page = Page(
        f"Steady motions of {swept.robot.name}",
        f"{swept.label} from {swept.low:g} to {swept.high:g}; {summary(result)}",
    )
    page.section("Yaw rate and growth of small perturbations")
    page.figure(figure, "Yaw rate and growth of small perturbations along the input, on each branch")
    page.section("Folds, Hopf points and period doublings")
    rows = special_rows(result)
    if rows:
        page.table(["branch", "kind", swept.label, "yaw rate", "growth there"], rows)
    else:
        page.text("None was found in this range.")
    page.section("Branches")
    page.table(
        ["branch", "tails", swept.label, "points", "of them stable"],
        [
            [
                str(number),
                "alike" if branch.alike else "not alike",
                f"{swept.value(min(m.s for m in branch.motions)):.4g} to "
                f"{swept.value(max(m.s for m in branch.motions)):.4g}",
                str(len(branch.motions)),
                str(sum(m.stable for m in branch.motions)),
            ]
            for number, branch in enumerate(result.branches, 1)
        ],
    )
    page.write(path, f"code {code_version()}")


def summary(result: Branches) -> str:
    """Say in a line what was found."""
    count = len(result.branches)
    motions = f"{count} {'branch' if count == 1 else 'branches'}"
    if result.incomplete:
        motions += " (the search ended there; there may be more)"
    kinds = [m.kind for b in result.branches for m in b.special]
    names = ((FOLD, "fold"), (HOPF, "Hopf point"), (DOUBLING, "period doubling"))
    counts = [(kinds.count(kind), name) for kind, name in names]
    words = [f"{number} {name}{'' if number == 1 else 's'}" for number, name in counts]
    largest, place = largest_hysteresis(result)
    sweeps = "slow sweeps up and down agree"
    if largest > 0.03:
        sweeps = f"slow sweeps up and down differ by up to {100 * largest:.0f} % (at {place:.4g})"
    return f"{motions}, {', '.join(words)}; {sweeps}"
