"""Ways around obstacles, replayed in the simulator: does the robot's body ever touch what it must keep out of?

Usage: python -m benchmarks.keep_out [CASES] [FIRST SEED]
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.cases import planned
from planner.goal.obstacles import Circle, Footprint, Polygon
from planner.goal.to_goal import GoalPlan
from sim.motion.replay import replay


def random_case(rng: np.random.Generator) -> dict[str, Any]:
    """Three circles between a start and a goal, in a tank of 11 by 8 l."""
    start = (0.0, float(rng.uniform(-1, 1)), float(rng.uniform(-1, 1)))
    goal = (6.5, float(rng.uniform(-1, 1)), float(rng.uniform(-3, 3)))
    circles = [Circle(*rng.uniform([1.8, -1.5, 0.3], [4.2, 1.5, 0.8]).tolist()) for _ in range(3)]
    walls = Polygon.of([[-2.5, -4.0], [9.0, -4.0], [9.0, 4.0], [-2.5, 4.0]])
    return {"start": start, "goal": goal, "keep_out": circles, "walls": walls}


def replayed_clearance(goal_plan: GoalPlan) -> tuple[float, float, float]:
    """Of the replay: smallest room around the body [l], distance from the goal [l], error of the heading [rad]."""
    track = replay([goal_plan.plan.schedule()])[0]
    poses = np.stack([track[name].to_numpy(float) for name in ("x_over_l", "y_over_l", "heading_rad")], 1)
    clearance = Footprint.of(goal_plan.plan.robot, 0.0).clearance(poses, goal_plan.free_space).min()
    turn = (poses[-1, 2] - goal_plan.goal[2] + np.pi) % (2 * np.pi) - np.pi
    return float(clearance), float(np.hypot(*(poses[-1, :2] - goal_plan.goal[:2]))), float(abs(turn))


def main() -> None:
    rows = []
    heads = (f"{'way':>8}{'flips':>7}{'margin':>8}{'stated':>8}{'predicted':>11}{'replayed':>10}"
             f"{'off goal':>10}{'rad':>8}{'s':>7}")  # fmt: skip
    for seed, goal_plan, spent in planned(random_case, 12, heads):
        clearance, off, turned = replayed_clearance(goal_plan)
        rows.append((clearance, off, turned))
        print(f"{seed:5d}{goal_plan.length:8.2f}{len(goal_plan.plan.dwells):7d}{goal_plan.margin:8.3f}"
              f"{goal_plan.plan.stated_error:8.3f}{goal_plan.clearance:11.3f}{clearance:10.3f}{off:10.4f}{turned:8.4f}"
              f"{spent:7.1f}", flush=True)  # fmt: skip
    found = np.array(rows)
    print(f"\n{len(found)} replays: smallest room {found[:, 0].min():.3f} l; {np.sum(found[:, 0] <= 0)} touch; "
          f"from the goal {np.median(found[:, 1]):.3f} l and {np.median(found[:, 2]):.3f} rad at the median, "
          f"{found[:, 1].max():.3f} l and {found[:, 2].max():.3f} rad at most")  # fmt: skip


if __name__ == "__main__":
    main()
