"""Held-out error of the shipped look-up table, and its speed against the simulator's in one run.

Usage: python -m benchmarks lookup

Takes 10 seconds.
"""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.timing import processor_time
from sim.motion.batches import steady_columns
from surrogate.table.errors import error_table
from surrogate.table.model_file import load
from surrogate.training.simulated import draw_robots

ROWS, SIMULATED, REPEATS = 16384, 64, 20


def main() -> None:
    threadpool_limits(1)
    lookup = load()
    rows = lookup.provenance["rows"]
    print(f"\nShipped look-up table: {rows['train']} rows learned, errors on {rows['held_out']} others")
    print(error_table(lookup.errors))
    robots = draw_robots(ROWS, 5, wide=False)
    few = {name: values[:SIMULATED] for name, values in robots.items()}
    single_robot = {name: values[:1] for name, values in robots.items()}
    lookup.query(few, flag=True)
    steady_columns(few, jobs=1, title="")
    query = processor_time(lambda: lookup.query(robots, flag=True)) / ROWS
    single = processor_time(lambda: lookup.query(single_robot, flag=True), repeats=REPEATS)
    simulate = processor_time(lambda: steady_columns(few, jobs=1, title="simulate")) / SIMULATED
    outside = np.mean(lookup.query(robots, flag=True)["outside"])
    print(f"\nrobots of the domain, one core, processor time: {1e6 * query:.0f} µs each in a batch of {ROWS}, "
          f"{1e3 * single:.1f} ms for one alone")  # fmt: skip
    print(f"simulated: {1e3 * simulate:.2f} ms each, {simulate / query:.0f} times as long as in the batch")
    print(f"outside the table's domain: {100 * outside:.1f} %")
