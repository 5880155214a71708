"""Pictures of plans and replays: the path as given, the declared path, the predicted track, the replayed track."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle as Patch

from planner.goal.obstacles import Circle, Footprint
from planner.goal.to_goal import GoalPlan
from planner.planning.plan import Plan
from sim.arrays import Floats
from sim.io.files import whole_file

KEEP_OUT = "#d8b365"
RAW, DECLARED, PREDICTED, REPLAYED = "#b0b0b0", "#1a1a1a", "#2a7fba", "#c8452f"


def write_svg(figure: Figure, path: Path, identity: str) -> None:
    """Write a figure as SVG, completely or not at all; `identity` names the plan."""
    with whole_file(path) as part:
        figure.savefig(part, format="svg", bbox_inches="tight", metadata={"Date": None, "Identifier": identity})


def draw_plan(result: Plan) -> Figure:
    """Draw the plan over its path, with the stated error."""
    figure = Figure(figsize=(6, 6))
    axes = figure.add_subplot()
    draw_tracks(axes, result.drawn.polyline(), result.reference, result.stated_error)
    axes.plot(*result.track.T, color=PREDICTED, lw=0.8, label="predicted")
    axes.plot(*result.track[0], "o", color=DECLARED, ms=5)
    minutes = result.seconds.sum() / 60
    axes.set_title(
        f"{result.robot.name}: {len(result.dwells)} dwells, {minutes:.1f} min\n"
        f"predicted error {result.predicted_rms:.3f} l rms, stated error {result.stated_error:.2f} l",
        fontsize=10,
        parse_math=False,
    )
    axes.legend(loc="center", fontsize=8, frameon=False)
    return figure


def draw_goal_plan(goal_plan: GoalPlan) -> Figure:
    """Draw a plan from pose to pose, with what the robot must keep out of."""
    figure = draw_plan(goal_plan.plan)
    axes = figure.axes[0]
    for region in goal_plan.free_space.regions:
        if isinstance(region, Circle):
            axes.add_patch(Patch((region.x, region.y), region.radius, color=KEEP_OUT, lw=0))
        else:
            axes.fill(*region.corners.T, color=KEEP_OUT, lw=0)
    if goal_plan.free_space.walls is not None:
        corners = goal_plan.free_space.walls.corners
        axes.plot(*np.concatenate([corners, corners[:1]]).T, color=KEEP_OUT, lw=3)
    body = Footprint.of(goal_plan.plan.robot, 0.0)
    for x, y, heading in (goal_plan.plan.start, goal_plan.goal):
        axis = np.array([body.places.min() - body.radius, body.places.max() + body.radius])
        axes.plot(x + axis * math.cos(heading), y + axis * math.sin(heading), color=DECLARED, lw=3, alpha=0.3)
        axes.plot(x, y, "o", color=DECLARED, ms=5)
    for x, y in goal_plan.via:
        axes.plot(x, y, "+", color=REPLAYED, ms=10)
    axes.autoscale_view()
    minutes = goal_plan.plan.seconds.sum() / 60
    axes.set_title(
        f"{goal_plan.plan.robot.name}: {len(goal_plan.plan.dwells)} dwells, {minutes:.1f} min\n"
        f"way {goal_plan.length:.2f} l, stated error {goal_plan.plan.stated_error:.2f} l",
        fontsize=10,
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncol=2, fontsize=8, frameon=False)
    return figure


def draw_tracks(axes: Axes, raw: Floats, declared: Floats, stated: float) -> None:
    """Draw the raw and the declared path with a band of the stated error."""
    edges = _band(declared, stated)
    axes.fill(*edges.T, color="#2a7fba", alpha=0.10, lw=0, label=f"stated error {stated:.2f} l")
    axes.plot(*raw.T, color=RAW, lw=1.0, label="path as given")
    axes.plot(*declared.T, color=DECLARED, lw=1.2, label="declared")
    axes.set_aspect("equal")
    axes.set_xlabel("x / l")
    axes.set_ylabel("y / l")


def _band(polyline: Floats, width: float) -> Floats:
    tangent = np.gradient(polyline, axis=0)
    norm = np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    left = np.stack([-tangent[:, 1], tangent[:, 0]], 1) / norm * width
    return np.concatenate([polyline + left, (polyline - left)[::-1]])
