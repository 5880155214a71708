"""Duration of plans from pose to pose, without obstacles, over the optimum found by brute force.

The optimum is that of `tests.oracles.quickest` for the same vehicle.

Usage: python -m benchmarks goals [CASES] [FIRST_SEED]

Takes 5 minutes.
"""

from __future__ import annotations

import numpy as np

from benchmarks.planner.random_goals import planned
from tests.oracles.quickest import brute_force
from tests.oracles.random_tasks import goal_alone


def main(cases: str = "100", first: str = "0") -> None:
    seeds = range(int(first), int(first) + int(cases))
    ratios = []
    heads = f"{'x':>7}{'y':>7}{'heading':>9}{'plan':>9}{'optimum':>9}{'/':>8}{'end':>10}{'s':>7}"
    for seed, goal_plan, spent in planned(goal_alone, seeds, heads):
        goal = goal_plan.goal
        least = brute_force(goal_plan.plan.tracked.vehicle, goal)
        ratios.append(goal_plan.plan.duration / least)
        print(f"{seed:5d}{goal[0]:7.2f}{goal[1]:7.2f}{goal[2]:9.2f}{goal_plan.plan.duration:9.1f}{least:9.1f}"
              f"{ratios[-1]:8.3f}{max(goal_plan.end_error):10.1e}{spent:7.2f}", flush=True)  # fmt: skip
    ratio = np.array(ratios)
    print(f"\n{len(ratio)} goals: time by the optimum's {np.median(ratio):.3f} at the median, "
          f"{np.quantile(ratio, 0.95):.3f} at 95 %, {ratio.max():.3f} at most; within 5 %: "
          f"{100 * np.mean(ratio <= 1.05):.0f} %")  # fmt: skip
