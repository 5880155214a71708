"""What chosen rows save: errors of look-up tables against rows, drawn evenly and chosen where a table is unsure.

Steady motion over the whole domain of the shipped table. A table learns the first rows of a sweep. Then as many
rows are added again, once the next ones of the sequence, once chosen ones (`surrogate.training.refine`). Errors
are those of other robots, drawn evenly. Networks are smaller than the shipped ones, and trained for a shorter
time.

Usage: python -m benchmarks refine [--rows N]

Takes an hour.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import torch

from dataset.rows.design import Axis, Design
from surrogate.input_ranges import DOMAIN, MOST_TAILS
from surrogate.networks.training_loop import Settings
from surrogate.table.errors import relative_errors
from surrogate.table.lookup import Lookup, steady_outputs
from surrogate.training.refine import choose
from surrogate.training.simulated import Simulated, as_reached, drawn, joined, simulated
from surrogate.training.train import learn, split, with_radius

ROWS, TEST, FLIPS, SEEDS = 2048, 4096, 48, (1, 2)
POWERS = (1.0, 2.0, np.inf)  # of the doubt that chances are in proportion to; infinite: the most doubtful ones
_JUDGED = ("omega_yr_bar", "v_x", "v_z", "omega_h_bar", "omega_t_bar")


def whole_domain() -> Design:
    """The sweep."""
    axes = {name: Axis(low, high, "log") for name, (low, high) in DOMAIN.items()}
    return Design({**axes, "N": Axis(1, MOST_TAILS, "integer")}, 1, 7)


def motions(design: Design, indices: Iterable[int]) -> tuple[Simulated, np.ndarray]:
    """Rows of the design that converge, and their indices."""
    chosen = tuple(indices)
    points = replace(design, rows=len(chosen), chosen=chosen).points()
    points["row"] = np.array(chosen, dtype=float)
    found = as_reached({name: values for name, values in points.items() if name != "row"}, title="")
    # `as_reached` leaves rows out: those that stay are found by their first input, which no two rows share
    place = np.flatnonzero(np.isin(points["C_t"], found.robots["C_t"]))
    return found, np.array(chosen)[place]


def trained(rows: Simulated, numbers: np.ndarray, flips: Simulated, seed: int) -> Lookup:
    """A table; its intervals are those of the rows that are held out."""
    settings = Settings(width=40, depth=2, epochs=60, iterations=300, seed=seed)
    once = Settings(width=8, depth=1, members=1, epochs=1, iterations=1)
    part = split(numbers)
    learned, widths, held_out = (rows.at(part == i) for i in range(3))
    return learn(learned, widths, held_out, flips, settings, once)


def errors(table: Lookup, test: Simulated) -> dict[str, np.ndarray]:
    """Relative errors of robots, the root mean square over five outputs, (M,), by number of tails."""
    answer = steady_outputs(table.motions(test.robots, flag=True), table.tails)
    found = relative_errors(answer, with_radius(test.motion))
    size = np.sqrt(np.nanmean([found[name] ** 2 for name in _JUDGED], axis=0))
    tails = test.robots["N"]
    return {"N = 1": size[tails == 1], "N = 2": size[tails == 2], "N >= 3": size[tails >= 3], "all": size}


def main(*words: str) -> None:
    parser = argparse.ArgumentParser(description="Errors against rows, even and chosen.")
    parser.add_argument("--rows", type=int, default=ROWS, help=f"rows of the first table (default: {ROWS})")
    rows = parser.parse_args(words).rows
    torch.set_num_threads(1)
    design = whole_domain()
    test = as_reached(drawn(TEST, 99, wide=False), title="")
    flips = simulated(
        {n: v[:FLIPS] for n, v in drawn(64, 98, wide=False).items()} | {"N": np.full(FLIPS, 3.0)}, curves=True
    )
    first, numbers = motions(design, range(rows))
    print(f"errors of {len(test)} robots [%], steady outputs: median, 95 %, rms without the worst 1 %, by N")
    for seed in SEEDS:
        began = time.process_time()
        table = trained(first, numbers, flips, seed)
        _print(f"{rows} even, seed {seed}", table, test)
        print(f"  … {time.process_time() - began:.0f} s", flush=True)
        for count in (2, 4):
            more, others = motions(design, range(rows, count * rows))
            both = joined([first, more]), np.concatenate([numbers, others])
            _print(f"{count * rows} even", trained(*both, flips, seed), test)
        for power in POWERS:
            more, others = motions(design, choose(table, design, rows, rows, power=power))
            both = joined([first, more]), np.concatenate([numbers, others])
            _print(f"{rows} even, {rows} chosen, power {power:g}", trained(*both, flips, seed), test)


def _print(title: str, table: Lookup, test: Simulated) -> None:
    cells = []
    for name, found in errors(table, test).items():
        low = np.sort(found[np.isfinite(found)])
        rms = np.sqrt(np.mean(low[: int(0.99 * len(low))] ** 2))
        figures = (np.median(low), np.quantile(low, 0.95), rms)
        cells.append(f"{name}: " + ", ".join(f"{100 * value:.3g}" for value in figures))
    print(f"{title:36} {'   '.join(cells)}", flush=True)
