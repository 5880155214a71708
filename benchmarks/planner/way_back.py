"""Way back to the path from random starts: how many arrive, and how long it takes beside the best way.

The starts are within 5 l of the start of an eight, with any heading. The tracker learns of them from the camera.
The best way is the fastest of the shortest Dubins tracks to all poses of the path. The tracker is tracker.h,
compiled in double and in single precision (the tests compare it with Python); this needs a C compiler.

Usage: python -m benchmarks way_back [STARTS]

Takes 5 minutes.
"""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.parallel import in_parallel
from benchmarks.planner.feedback import eight
from planner.goal.dubins import shortest_paths
from planner.planning.camera import POSE, Camera
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.tracking.swim import swim
from sim.model.presets import PRESETS
from tests.planner.compiled import CompiledTracker

ON_PATH = 0.08  # l
_AT_ONCE = 25  # starts of one task


def random_start(planned: Plan, seed: int) -> tuple[POSE, np.random.Generator]:
    """Draw a pose of the head's centre, and return what else is drawn from."""
    rng, (x, y, _) = np.random.default_rng(seed), planned.start
    r, angle = 5 * math.sqrt(rng.random()), rng.uniform(0, 2 * math.pi)
    return (x + r * math.cos(angle), y + r * math.sin(angle), rng.uniform(-math.pi, math.pi)), rng


def best_time(planned: Plan, start: POSE) -> float:
    """Compute the time of the fastest of the shortest Dubins tracks to all poses of the path."""
    reference, car = planned.declared.reference, planned.tracked.vehicle
    goals, a = np.column_stack([reference.q, reference.heading]), car.pivot_distance
    pivot = start - np.array([a * math.cos(start[2]), a * math.sin(start[2]), 0.0])
    ways = shortest_paths(np.repeat(pivot[None], len(goals), 0), goals, car.pivot_radius)
    speed = np.where(ways.turns == 0, planned.straight.net_speed, np.abs(car.twist[:, 0]).max())
    return float((ways.lengths / speed).sum(1).min())


def times_back(planned: Plan, seeds: list[int], single: bool) -> list[tuple[float, float]]:
    """Return the times until robots are on the path for good (NaN: never), and those of the best ways."""
    times = []
    with TemporaryDirectory() as folder:
        tracker = CompiledTracker(planned, Path(folder), single=single)
        for seed in seeds:
            tracker.restart()
            start, rng = random_start(planned, seed)
            camera = Camera(seed=rng, delay_s=0, lost=0)
            result = swim(tracker, planned, planned.tracked.vehicle, camera, start=start, longest=10)
            off = np.flatnonzero(result.distance > ON_PATH)
            arrived = result.finished and (not len(off) or off[-1] + 1 < len(result.times))
            spent = float(result.times[off[-1] + 1]) if arrived and len(off) else 0.0 if arrived else math.nan
            times.append((spent, best_time(planned, start)))
    return times


def main(starts: str = "500") -> None:
    planned, count = plan(eight(12.0), PRESETS["paper-control"]), int(starts)
    for single in (False, True):
        parts = [list(range(first, min(first + _AT_ONCE, count))) for first in range(0, count, _AT_ONCE)]
        lists = in_parallel(times_back, [(planned, part, single) for part in parts], quiet=True)
        times = np.array([pair for each in lists for pair in each])
        back = ~np.isnan(times[:, 0])
        ratio = times[back, 0] / times[back, 1]
        middle, most, worst = np.quantile(ratio, (0.5, 0.9, 0.99))
        print(
            f"{'single' if single else 'double'} precision: {back.sum()} of {len(times)} back; time over "
            f"that of the best way: median {middle:.3f}, 90 % below {most:.2f}, 99 % below {worst:.2f}"
        )
