"""Held-out error of the shipped look-up table, as it states it, and the coverage of its intervals.

Usage: python -m benchmarks lookup [MODEL] [WORK]    with the fresh robots kept in WORK by shipped_table

The robots are drawn as users draw them, with another seed than those of the calibration.

Takes 3 minutes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from benchmarks.table.shipped_table import as_reached, inside, kept, robots
from surrogate.held_out import COMPARED, error_table
from surrogate.intervals import COVERAGE
from surrogate.table_file import load
from surrogate.training.model_card import coverage_by_group
from surrogate.training.simulated import draw_robots

ROWS = 16384
FAR = 0.03  # from COVERAGE


def main(model: str | None = None, work: str | None = None) -> None:
    lookup = load(model)
    rows = lookup.provenance["rows"]
    print(f"\nLook-up table {lookup.identity}: {rows['train']} rows learned, errors on {rows['held_out']} others")
    print(error_table(lookup.errors))
    outside = np.mean(lookup.query(draw_robots(ROWS, 5, wide=False), flag=True)["outside"])
    print(f"robots of the domain that it refuses: {100 * outside:.1f} %")
    drawn = kept(Path(work), "fresh") if work else as_reached(robots("fresh"), title="fresh robots")
    fresh = inside(lookup, drawn)
    print(f"\nCoverage of intervals for {100 * COVERAGE:.0f} % on {len(fresh)} fresh robots")
    print(f"couple N third robots{''.join(f'{name:>14}' for name in COMPARED)}")
    far, clearly, cells = 0, 0, 0
    for k, (count, shares) in enumerate(coverage_by_group(lookup, fresh)):
        percent = "".join(f"{100 * shares.get(name, np.nan):14.1f}" for name in COMPARED)
        print(f"{('no', 'yes')[k // 24]:6}{1 + k // 3 % 8:2}{1 + k % 3:6}{count:7}{percent}")
        for share in shares.values():
            low, high = binomtest(round(count * share), count).proportion_ci(method="wilson")
            far, cells = far + (abs(share - COVERAGE) > FAR), cells + 1
            clearly += int(low > COVERAGE + FAR or high < COVERAGE - FAR)
    print(f"{far} of {cells} are further than {100 * FAR:.0f} % from it, {clearly} with their whole 95 % interval")
