"""Held-out error of the shipped look-up table, and its speed against the simulator's in one run.

Usage: python -m benchmarks.lookup
"""

from __future__ import annotations

import time

import torch

from dataset.design import load_design
from sim.motion.batches import steady_columns
from surrogate.evaluate import error_table
from surrogate.export import load

ROWS = 64


def main() -> None:
    torch.set_num_threads(1)
    lookup = load()
    rows = lookup.provenance["rows"]
    print(f"\nShipped look-up table: {rows['train']} rows learned, errors on {rows['held_out']} others")
    print(error_table(lookup))
    points = load_design("sweep.toml").with_rows(ROWS).points()
    robots = {k: v for k, v in points.items() if k != "dwell_bar"}
    lookup.query(points)
    steady_columns(robots, jobs=1, title="")
    began = time.perf_counter()
    lookup.query(points)
    query = time.perf_counter() - began
    began = time.perf_counter()
    steady_columns(robots, jobs=1, title="simulate")
    simulate = time.perf_counter() - began
    count = len(robots["N"])
    print(f"\n{count} robots of the sweep, one core: look-up {1e6 * query / count:.0f} µs a robot,")
    print(f"steady motion solved for {1e3 * simulate / count:.2f} ms a robot: ratio {simulate / query:.0f}")


if __name__ == "__main__":
    main()
