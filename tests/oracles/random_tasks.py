"""Random tasks, as arguments of `planner.goal.trip.to_goal`, and the clearance of a replayed plan."""

from __future__ import annotations

from typing import Any

import numpy as np

from planner.paths.obstacles import Circle, Footprint, Polygon
from planner.planning.plan import Plan
from sim.motion.replay import replay


def random_goal(rng: np.random.Generator) -> tuple[float, float, float]:
    """Return a pose within 4 l of the start, with any heading."""
    x, y, heading = rng.uniform([-4, -4, -np.pi], [4, 4, np.pi]).tolist()
    return x, y, heading


def goal_behind_circles(rng: np.random.Generator) -> dict[str, Any]:
    """Return a task with three circles between a start and a goal, in a tank of 11 by 8 l."""
    start = (0.0, float(rng.uniform(-1, 1)), float(rng.uniform(-1, 1)))
    goal = (6.5, float(rng.uniform(-1, 1)), float(rng.uniform(-3, 3)))
    circles = [Circle(*rng.uniform([1.8, -1.5, 0.3], [4.2, 1.5, 0.8]).tolist()) for _ in range(3)]
    walls = Polygon.of([[-2.5, -4.0], [9.0, -4.0], [9.0, 4.0], [-2.5, 4.0]])
    return {"start": start, "goal": goal, "keep_out": circles, "walls": walls}


def replayed_clearance(goal_plan: Plan) -> tuple[float, float, float]:
    """Replay a plan; return least clearance [l], distance from the goal [l] and error of the heading [rad]."""
    track = replay(goal_plan.schedule())
    poses = np.stack([track[name].to_numpy(float) for name in ("x_over_l", "y_over_l", "heading_rad")], 1)
    clearance = Footprint.of(goal_plan.robot, 0.0).clearance(poses, goal_plan.kept_clear.free_space).min()
    turn = (poses[-1, 2] - goal_plan.job.goal[2] + np.pi) % (2 * np.pi) - np.pi
    return float(clearance), float(np.hypot(*(poses[-1, :2] - goal_plan.job.goal[:2]))), float(abs(turn))
