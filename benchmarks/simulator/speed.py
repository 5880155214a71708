"""Speed of the simulator on one thread, compared with scipy's BDF on the same equations in the same run.

1. A steady operating point of a whole robot: the direct route against BDF.
2. Operating points a second over the sweep's domain, on one thread and on all, and the errors that they state.

Usage: python -m benchmarks speed

Takes 3 minutes.
"""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.common import timed
from dataset.design import load_design
from sim.model.groups import Groups
from sim.motion.batches import steady_columns
from sim.motion.steady import steady
from sim.threads import available_jobs
from tests.oracles.plain_swimmer import settle_plainly

ROBOTS = 5
POINTS = 2048


def sweep(rows: int) -> dict[str, np.ndarray]:
    return load_design().with_rows(rows).points()


def robots() -> None:
    points = sweep(ROBOTS)
    print("\nA steady operating point of the whole robot, one thread")
    print("  N  motor speed   scipy BDF [s]   direct [ms]   ratio   apart (16 edges there)")
    ratios = []
    for i in range(ROBOTS):
        groups = Groups.from_columns({name: values[i : i + 1] for name, values in points.items()})
        quick, motion = timed(lambda groups=groups: steady(groups, stability=False), repeats=5)  # type: ignore[misc]
        slow, reference = timed(lambda groups=groups: settle_plainly(groups))  # type: ignore[misc]
        apart = abs(reference[1] / motion.omega_yr[0] - 1)
        ratios.append(slow / quick)
        speed = float(groups.omega_bar[0])
        line = f"  {groups.N}  {speed:11.1f}   {slow:13.1f}   {1e3 * quick:11.2f}   {ratios[-1]:5.0f}"
        print(f"{line}   yaw rate {100 * apart:.2f} %")
    print(f"  smallest ratio {min(ratios):.0f}, geometric mean {np.exp(np.mean(np.log(ratios))):.0f}")


def throughput() -> None:
    points = sweep(POINTS)
    print(f"\n{POINTS} steady operating points over the sweep's domain")
    for jobs in sorted({1, available_jobs()}):
        spent, columns = timed(lambda jobs=jobs: steady_columns(points, jobs=jobs, stability=False, title=""))  # type: ignore[misc]
        direct_rows = int((columns["method"] == "direct").sum())
        print(f"  {jobs} threads: {POINTS / spent:6.0f} a second ({direct_rows} solved directly)")
    error = 100 * columns["error"]
    print(f"  error that rows state of themselves: median {np.median(error):.3f} %, largest {error.max():.2f} %")


def main() -> None:
    steady_columns(sweep(8), stability=False, title="")  # compile
    with threadpool_limits(1):
        robots()
    throughput()
