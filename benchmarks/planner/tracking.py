"""Tracking error of plans replayed in the simulator, and planning time a switch.

Usage: python -m benchmarks tracking

Takes a minute.
"""

from __future__ import annotations

import time

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from planner.jobs.plan import plan
from planner.paths.path import circle, polygon
from sim.model.presets import PRESETS
from sim.motion.replay import replay
from surrogate.table_file import load
from tracking.tracks import tracking_error

CASES = (
    ("circle, radius 1.5 l, N = 2", circle(1.5), "paper-control"),
    ("square, side 3 l, N = 2", polygon(4, 3.0), "paper-control"),
    ("triangle, side 4 l, N = 4", polygon(3, 4.0), "paper-triangle"),
)


def main() -> None:
    threadpool_limits(1)
    lookup = load()
    plans, spent = [], []
    for _, path, robot in CASES:
        began = time.perf_counter()
        plans.append(plan(path, PRESETS[robot], lookup=lookup))
        spent.append(time.perf_counter() - began)
    schedules = [p.schedule() for p in plans]
    with tqdm(total=sum(len(p.dwells) for p in plans), desc="replay", unit="dwell") as bar:
        tracks = [replay(schedule, progress=bar.update) for schedule in schedules]
    print("\nOpen-loop replay against the declared path, in tail lengths l")
    print(f"{'case':30}{'dwells':>8}{'rms':>9}{'max':>9}{'stated':>9}{'raw rms':>9}{'ms/switch':>11}")
    for (name, _, _), result, track, seconds in zip(CASES, plans, tracks, spent, strict=True):
        error = tracking_error(result.to_dict(), track)
        count = len(result.dwells)
        print(
            f"{name:30}{count:8d}{error.rms:9.4f}{error.largest:9.4f}{error.stated:9.3f}"
            f"{error.raw_rms:9.3f}{1000 * seconds / count:11.2f}"
        )
