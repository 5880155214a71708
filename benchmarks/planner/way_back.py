"""Way back to the path from random starts: how many arrive, and how long it takes beside the best way.

The starts are within 5 l of the start of an eight, with any heading. The tracker learns of them from the camera.
The best way is the fastest of the shortest Dubins tracks to all poses of the path.

Usage: python -m benchmarks way_back [STARTS]

Takes 20 minutes.
"""

from __future__ import annotations

import math

import numpy as np

from benchmarks.parallel import in_parallel
from benchmarks.planner.feedback import eight
from planner.goal.dubins import shortest_paths
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.tracking.tracker import Tracker
from sim.model.presets import PRESETS
from tests.planner.swimming import Camera, swum

ON_PATH = 0.08  # l


def time_back(planned: Plan, seed: int) -> tuple[float, float]:
    """Return the time until one robot is on the path for good (NaN: never), and that of the best way."""
    rng, (x, y, _), car = np.random.default_rng(seed), planned.start, planned.tracked.vehicle
    r, angle = 5 * math.sqrt(rng.random()), rng.uniform(0, 2 * math.pi)
    start = np.array([x + r * math.cos(angle), y + r * math.sin(angle), rng.uniform(-math.pi, math.pi)])
    result = swum(Tracker(planned), planned, car, Camera(rng=rng), start=start, most=2000)
    off = np.flatnonzero(result.distance > ON_PATH)
    arrived = result.finished and (not len(off) or off[-1] + 1 < len(result.times))
    spent = result.times[off[-1] + 1] if arrived and len(off) else 0.0 if arrived else math.nan
    reference, a = planned.declared.reference, car.pivot_distance
    goals = np.column_stack([reference.q, reference.heading])
    pivot = start - np.array([a * math.cos(start[2]), a * math.sin(start[2]), 0.0])
    ways = shortest_paths(np.repeat(pivot[None], len(goals), 0), goals, car.pivot_radius)
    speed = np.where(ways.turns == 0, planned.straight.net_speed, np.abs(car.twist[:, 0]).max())
    return float(spent), float((ways.lengths / speed).sum(1).min())


def main(starts: str = "500") -> None:
    planned = plan(eight(12.0), PRESETS["paper-control"])
    times = np.array(in_parallel(time_back, [(planned, seed) for seed in range(int(starts))], quiet=True))
    back = ~np.isnan(times[:, 0])
    ratio = times[back, 0] / times[back, 1]
    print(
        f"{back.sum()} of {len(times)} back on the path; time over that of the best way: median "
        f"{np.median(ratio):.3f}, 90 % of them below {np.quantile(ratio, 0.9):.2f}"
    )
