"""What repeats and identities say without a model: false alarms, and how often a fault is named.

Tables of 192 runs by `tests.oracles.misread_tables`.

Usage: python -m benchmarks between_repeats [TABLES] [FIRST_SEED]

Takes 5 minutes.
"""

from __future__ import annotations

import time

from benchmarks.common import heading, in_parallel, per_cent, row
from calibration.statistics.study import LEVEL
from calibration.swimmer.measured_table import read_measurements
from calibration.table.between_repeats import find_differences
from tests.oracles.misread_tables import CASES, Case, make_table


def found(case: Case, seed: int) -> tuple[str, set[tuple[str, str]], float]:
    """Return what a table says, and the processor time."""
    runs = read_measurements(make_table(case, seed))
    began = time.process_time()
    differences = find_differences(runs, level=LEVEL, seed=seed)
    return case.label, {(d.output, d.column) for d in differences}, time.process_time() - began


def main(tables: str = "200", first: str = "0") -> None:
    done = in_parallel(found, [(case, int(first) + seed) for case in CASES for seed in range(int(tables))])
    print(heading("case", "tables", "named", "something else is named"))
    for case in CASES:
        said = [names for label, names, _ in done if label == case.label]
        named = per_cent(sum(case.named in names for names in said), len(said)) if any(case.named) else "–"
        other = {("R_yr", "view_deg")} if case.named == ("v", "view_deg") else set()
        print(
            row(
                case.label,
                len(said),
                named,
                per_cent(sum(bool(n - {case.named} - other) for n in said), len(said)),
            )
        )
    print(f"\nProcessor time of a table: largest {max(seconds for *_, seconds in done):.2f} s")
