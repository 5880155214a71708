"""Held-out error of the shipped look-up table, and its speed against the simulator's in one run.

Usage: python -m benchmarks lookup

Takes 10 seconds.
"""

from __future__ import annotations

import time

import numpy as np
import torch

from sim.motion.batches import steady_columns
from surrogate.table.errors import error_table
from surrogate.table.model_file import load
from surrogate.training.simulated import drawn

ROWS, SIMULATED, REPEATS = 16384, 64, 20


def main() -> None:
    torch.set_num_threads(1)
    lookup = load()
    rows = lookup.provenance["rows"]
    print(f"\nShipped look-up table: {rows['train']} rows learned, errors on {rows['held_out']} others")
    print(error_table(lookup))
    robots = drawn(ROWS, 5, wide=False)
    few = {name: values[:SIMULATED] for name, values in robots.items()}
    one = {name: values[:1] for name, values in robots.items()}
    lookup.query(few, flag=True)
    steady_columns(few, jobs=1, title="")
    query = _seconds(lambda: lookup.query(robots, flag=True), 1) / ROWS
    single = _seconds(lambda: lookup.query(one, flag=True), REPEATS)
    simulate = _seconds(lambda: steady_columns(few, jobs=1, title="simulate"), 1) / SIMULATED
    outside = np.mean(lookup.query(robots, flag=True)["outside"])
    print(f"\nrobots of the domain, one core, processor time: {1e6 * query:.0f} µs each in a batch of {ROWS}, "
          f"{1e3 * single:.1f} ms for one alone")  # fmt: skip
    print(f"simulated: {1e3 * simulate:.2f} ms each, {simulate / query:.0f} times as long as in the batch")
    print(f"outside the table's domain: {100 * outside:.1f} %")


def _seconds(work, repeats: int) -> float:  # type: ignore[no-untyped-def]
    began = time.process_time()
    for _ in range(repeats):
        work()
    return (time.process_time() - began) / repeats
