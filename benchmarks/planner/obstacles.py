"""Clearance of the robot's body on routes around obstacles, replayed in the simulator.

Usage: python -m benchmarks obstacles [CASES] [FIRST SEED]

Takes a minute.
"""

from __future__ import annotations

import numpy as np

from benchmarks.planner.random_goals import planned
from tests.oracles.random_tasks import goal_behind_circles, replayed_clearance


def main(cases: str = "12", first: str = "0") -> None:
    seeds = range(int(first), int(first) + int(cases))
    rows = []
    heads = (f"{'way':>8}{'flips':>7}{'margin':>8}{'stated':>8}{'predicted':>11}{'replayed':>10}"
             f"{'off goal':>10}{'rad':>8}{'s':>7}")  # fmt: skip
    for seed, goal_plan, spent in planned(goal_behind_circles, seeds, heads):
        clearance, off, angle = replayed_clearance(goal_plan)
        rows.append((clearance, off, angle))
        print(f"{seed:5d}{goal_plan.length:8.2f}{len(goal_plan.plan.dwells):7d}{goal_plan.margin:8.3f}"
              f"{goal_plan.plan.stated_error:8.3f}{goal_plan.clearance:11.3f}{clearance:10.3f}{off:10.4f}{angle:8.4f}"
              f"{spent:7.1f}", flush=True)  # fmt: skip
    clear, missed, turned = np.array(rows).T
    print(f"\n{len(rows)} replays: smallest room {clear.min():.3f} l; {np.sum(clear <= 0)} touch; "
          f"from the goal {np.median(missed):.3f} l and {np.median(turned):.3f} rad at the median, "
          f"{missed.max():.3f} l and {turned.max():.3f} rad at most")  # fmt: skip
