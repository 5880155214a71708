"""Pictures of plans and replays: the path as given, the declared path, the predicted track, the replayed track."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from planner.goal.goal_plan import GoalPlan
from planner.planning.planned import Plan
from sim.io.files import whole_file


def write_svg(figure: Figure, path: Path, identity: str) -> None:
    """Write a figure as SVG, completely or not at all; `identity` names the plan."""
    with whole_file(path) as part:
        figure.savefig(part, format="svg", bbox_inches="tight", metadata={"Date": None, "Identifier": identity})


def draw_plan(result: Plan) -> Figure:
    """Draw the plan over its path, with the stated error."""
    figure = Figure(figsize=(6, 6))
    axes = figure.add_subplot()
    result.plot(axes)
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
    figure = Figure(figsize=(6, 6))
    axes = goal_plan.plot(figure.add_subplot())
    minutes = goal_plan.plan.seconds.sum() / 60
    axes.set_title(
        f"{goal_plan.plan.robot.name}: {len(goal_plan.plan.dwells)} dwells, {minutes:.1f} min\n"
        f"way {goal_plan.length:.2f} l, stated error {goal_plan.plan.stated_error:.2f} l",
        fontsize=10,
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncol=2, fontsize=8, frameon=False)
    return figure
