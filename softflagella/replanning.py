"""Measure what a corrected model gains: plan with different models, and run every schedule on the true robot.

Each model is tabulated (`surrogate.tabulate`) and plans the same path. Then the schedule is run on the
simulated true robot, without feedback. With a wrong yaw rate the robot drifts from the path with every
dwell. So errors of a few percent in the model can lead to errors as large as the path.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from planner.api.plan import plan
from planner.files.tracking_error import TrackingError, tracking_error
from planner.paths.path import Path2D
from sim.arrays import Floats
from sim.model.robot import Robot
from sim.motion.replay import replay
from surrogate.tabulate import tabulate


@dataclass(frozen=True)
class Steered:
    """One model's plan and how the true robot followed it; lengths in l."""

    plan: dict[str, Any]  # plan.json
    error: TrackingError
    track: Floats  # (K, 2)


def steer(models: Mapping[str, Robot], truth: Robot, path: Path2D) -> dict[str, Steered]:
    """Plan `path` with every model and run the schedules on `truth`.

    Args:
        models: by label; the same robot with other coefficients, numbers and effects.
    """
    runs = {}
    for label, model in models.items():
        planned = plan(path, model, lookup=tabulate(model))
        content = planned.to_dict()
        track = replay([planned.schedule(truth)])[0]
        track[["x_over_l", "y_over_l"]] *= truth.tail_length / model.tail_length
        runs[label] = Steered(content, tracking_error(content, track), track[["x_over_l", "y_over_l"]].to_numpy())
    return runs


def gap_closed(before: float, after: float, best: float) -> float:
    """Return the share of the avoidable error that the correction removes."""
    return (before - after) / (before - best)
