"""Held-out error of the shipped look-up table, as it states it.

Usage: python -m benchmarks lookup

Takes 5 seconds.
"""

from __future__ import annotations

import numpy as np

from surrogate.errors import error_table
from surrogate.table_file import load
from surrogate.training.simulated import draw_robots

ROWS = 16384


def main() -> None:
    lookup = load()
    rows = lookup.provenance["rows"]
    print(f"\nShipped look-up table: {rows['train']} rows learned, errors on {rows['held_out']} others")
    print(error_table(lookup.errors))
    outside = np.mean(lookup.query(draw_robots(ROWS, 5, wide=False), flag=True)["outside"])
    print(f"robots of the domain that it refuses: {100 * outside:.1f} %")
