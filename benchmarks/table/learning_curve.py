"""Error of the look-up table against the number of rows that it learned.

Tables are trained on the first rows of one data set: a 64th of those that training learns, a 32nd, and so on to
all of them. Each part holds the one before it. Errors are those of the rows that are held out, two tails and more
which do not touch. Two networks are trained: a quick one, and a larger one for longer. Where a curve is flat, more
rows do not help; where the two lie apart, the network and its training limit the table, and not the rows.

Usage: python -m benchmarks learning_curve DATA [--picture docs/learning.png]
       (docs/learning.png is made from surrogate/shipped/domain.toml)

Takes 20 minutes.
"""

from __future__ import annotations

import argparse
import time
from typing import NamedTuple

import numpy as np
import torch

from dataset.report.figures import plain_logarithms
from surrogate.networks.checkpoints import TrainingContext
from surrogate.networks.training_loop import Settings
from surrogate.table.compiled_query import BRANCHES
from surrogate.table.errors import relative_errors
from surrogate.table.wrench_table import WrenchTable
from surrogate.training.fit_wrench import WrenchSamples, fit_wrench, learnable, wrench_samples
from surrogate.training.simulated import SimulatedRobots, read_robots
from surrogate.training.train import split, with_radius

SETTINGS = {
    "24 × 2, 300 iterations": Settings(width=24, depth=2, members=1, epochs=60, iterations=300),
    "40 × 3, 1,000 iterations": Settings(width=40, depth=3, members=1, epochs=60, iterations=1000),
}
PARTS = tuple(2.0**-k for k in range(6, -1, -1))
_NAMES = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l")


class Found(NamedTuple):
    """A trained table's errors."""

    name: str  # of its settings
    rows: int
    seconds: float  # of processor time
    errors: dict[str, tuple[float, float]]  # output -> median and 95 %, in %


def usable(rows: SimulatedRobots) -> tuple[SimulatedRobots, WrenchSamples]:
    """Select robots with two tails and more which a table may learn, as simulated and as rows of tails."""
    rows = rows.at(rows.robots["N"] > 1)
    samples = wrench_samples(rows.robots, rows.motion)
    good = np.flatnonzero(learnable(samples))
    return rows.at(good), samples.at(good)


def test_errors(
    table: WrenchTable, tested: SimulatedRobots, rows: WrenchSamples
) -> dict[str, tuple[float, float]]:
    """Median and 95 % of the relative errors, in %, by output."""
    motion = table.solve(rows.heads, rows.tails)[0]
    values = table.outputs(rows.heads, motion, table.tail_gap(rows.tails, motion))
    names = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l", "theta_deg", "tail_gap")
    answer = dict(zip(names, values, strict=True))
    deviations = relative_errors(answer, with_radius(tested.motion))
    deviations["v_z"] = answer["v_z"] / tested.motion["v_z"] - 1  # of itself
    sizes = {name: 100 * np.abs(np.nan_to_num(deviations[name], nan=1.0)) for name in _NAMES}
    return {name: (float(np.median(size)), float(np.quantile(size, 0.95))) for name, size in sizes.items()}


def draw(curves: list[Found], path: str) -> None:
    """Plot the error of the yaw rate and of the surge against rows, both logarithmic."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.4), layout="constrained")
    shown = (("omega_yr_bar", "yaw rate"), ("v_z", "surge, of itself"))
    for place, (output, words) in enumerate(shown):
        axes = figure.add_subplot(1, 2, place + 1)
        for name, colour in zip(SETTINGS, ("#d9a441", "#2a7fba"), strict=True):
            curve = [point for point in curves if point.name == name]
            rows = [point.rows for point in curve]
            for i, (style, level) in enumerate((("o-", "median"), ("s--", "95 %"))):
                axes.plot(rows, [point.errors[output][i] for point in curve], style, color=colour, ms=4,
                          label=f"{name}: {level}")  # fmt: skip
        axes.set_xscale("log")
        axes.set_yscale("log")
        plain_logarithms(axes.xaxis)
        plain_logarithms(axes.yaxis)
        axes.grid(alpha=0.3)
        axes.set_xlabel("rows learned")
        axes.set_ylabel(f"error of the {words} [%]")
    lines = figure.axes[0].get_legend_handles_labels()
    figure.legend(*lines, loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    figure.savefig(path, dpi=100)


def main(*words: str) -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("data", help="a finished data set")
    parser.add_argument("--picture", help="draw the errors into this file")
    options = parser.parse_args(words)
    torch.set_num_threads(1)
    every, numbers = read_robots(options.data)
    part = split(numbers)
    tested, _ = usable(every.at(part == 2))
    slow = np.abs(tested.motion["omega_yr_bar"]) < BRANCHES * np.abs(tested.motion["omega_t_bar"])
    tested, held_out = usable(tested.at((tested.motion["tail_gap"] >= 1) & slow))
    learned, rows = usable(every.at(part == 0))
    print(f"{len(learned)} rows to learn from, {len(tested)} held out; errors in %, median / 95 %")
    print(
        f"{'':26}{'rows':>7}{'s':>6}{'yaw rate':>17}{'turn radius':>17}{'spin of tails':>17}{'v_z of itself':>17}"
    )
    curves = []
    for name, settings in SETTINGS.items():
        for share in PARTS:
            samples = rows.at(np.arange(round(share * len(learned))))
            began = time.process_time()
            table = fit_wrench(samples, settings, TrainingContext())
            spent = time.process_time() - began
            point = Found(name, len(samples.motion), spent, test_errors(table, tested, held_out))
            curves.append(point)
            shown = [point.errors[n] for n in ("omega_yr_bar", "R_yr_over_l", "omega_t_bar", "v_z")]
            figures = "".join(f"{f'{median:.4f} / {high:.3f}':>17}" for median, high in shown)
            print(f"{name:26}{point.rows:7d}{point.seconds:6.0f}{figures}", flush=True)
    if options.picture:
        draw(curves, options.picture)
