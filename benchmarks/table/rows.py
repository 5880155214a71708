"""What more rows buy: time of training, and held-out error of the look-up table, against its rows.

Robots are the points of `dataset/sweep.toml`, with their steady motion; 8,192 further points are held out. Each
table is trained with the default settings, on the first rows. The response to a flip has the same 256 robots in
each.

Usage: python -m benchmarks rows [MOST] [FIGURE]

Takes an hour of one core with 100,000 rows.
"""

from __future__ import annotations

import time
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import bootstrap

from benchmarks.common import heading, row
from common.arrays import Floats
from dataset.design import SWEEP_TOML, load_design
from surrogate.held_out import relative_errors
from surrogate.table import NeuralTable
from surrogate.training.networks import Settings
from surrogate.training.simulated import SimulatedRobots, simulate_robots
from surrogate.training.train import learn, split, with_radius

_HELD_OUT, _FLIPS = 8192, 256
_OUTPUTS = {"omega_yr_bar": "yaw rate", "R_yr_over_l": "turn radius", "v_z": "surge, of the speed"}
_BRIEF = Settings(width=16, depth=1, members=1, epochs=2, iterations=2)  # the response is not looked at


def points(start: int, stop: int, *, curves: bool = False) -> SimulatedRobots:
    """Simulate points of the sweep."""
    design = replace(load_design(SWEEP_TOML), rows=stop)
    drawn = {name: np.asarray(values, dtype=float) for name, values in design.points(start, stop).items()}
    drawn["a_over_R"] = np.ones_like(drawn["N"])
    return simulate_robots(drawn, curves=curves, title=f"points {start} to {stop}")


def errors(lookup: NeuralTable, rows: SimulatedRobots) -> dict[str, Floats]:
    """Return the errors on held-out robots in the table's domain whose tails do not touch, in per cent."""
    apart = rows.at(rows.motion["tail_gap"] >= 1)
    apart = apart.at(~lookup.query(apart.robots, flag=True)["outside"])
    answer = lookup.query(apart.robots)
    found = relative_errors(answer, with_radius(apart.motion))
    return {name: 100 * np.abs(found[name]) for name in _OUTPUTS}


def quantile_with_interval(values: Floats, share: float) -> str:
    """Write a quantile with its 95 % bootstrap interval."""
    found = bootstrap((values,), lambda x, axis: np.quantile(x, share, axis=axis), method="percentile", rng=1,
                      n_resamples=500).confidence_interval  # fmt: skip
    return f"{np.quantile(values, share):.3f} ({found.low:.3f} to {found.high:.3f})"


def main(most: str = "100000", figure: str = "") -> None:
    """Print the table; draw the figure."""
    counts = [count for count in (2048, 4096, 8192, 16384, 32768, 65536, 100_000) if count <= int(most)]
    began = time.process_time()
    rows, held_out = points(0, counts[-1]), points(counts[-1], counts[-1] + _HELD_OUT)
    simulated = 1e3 * (time.process_time() - began) / (counts[-1] + _HELD_OUT)
    several = points(0, _FLIPS, curves=True)
    part = split(np.arange(_HELD_OUT))  # of the held-out robots, those of the widths are not those of the errors
    part = part[: len(held_out)]
    print(f"\nsimulation of a steady motion: {simulated:.2f} ms of processor time\n")
    print(heading("rows", "training, s", "µs a row and an epoch",
                  *(f"{words}: median, %; 95 %" for words in _OUTPUTS.values())))  # fmt: skip
    drawn: dict[int, dict[str, Floats]] = {}
    for count in counts:
        began = time.process_time()
        lookup = learn(rows.at(np.arange(min(count, len(rows)))), held_out.at(part == 1), held_out.at(part == 2),
                       several, Settings(), _BRIEF)  # fmt: skip
        seconds, settings = time.process_time() - began, Settings()
        # an iteration over all rows counts as an epoch
        epochs = settings.epochs + settings.iterations * settings.members
        drawn[count] = errors(lookup, held_out.at(part != 1))
        cells = [
            f"{quantile_with_interval(e, 0.5)}; {quantile_with_interval(e, 0.95)}" for e in drawn[count].values()
        ]
        print(row(count, f"{seconds:.0f}", f"{1e6 * seconds / count / epochs:.1f}", *cells), flush=True)
    if figure:
        draw(drawn, figure)


def draw(drawn: dict[int, dict[str, Floats]], figure: str) -> None:
    """Draw errors against rows, medians and 95 % quantiles."""
    picture, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
    for index, (name, words) in enumerate(_OUTPUTS.items()):
        for share, style in ((0.5, "o-"), (0.95, "o--")):
            values = [np.quantile(found[name], share) for found in drawn.values()]
            label = words if share == 0.5 else None
            axes.plot(list(drawn), values, style, color=f"C{index}", ms=4, label=label)
    axes.set_xscale("log", base=2)
    axes.set_xticks(list(drawn), [f"{count:,}" for count in drawn])
    axes.minorticks_off()
    axes.set_yscale("log")
    axes.set_xlabel("rows that the table has learned")
    axes.set_ylabel("held-out error [%]")
    axes.set_title("solid: median; dashed: 95 % of robots", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    picture.savefig(figure, dpi=110)
