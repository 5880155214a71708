"""Pictures beside those of plans, by matplotlib: a way from pose to pose, and how a figure is written."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from planner.files.plan_picture import schedule_words
from planner.goal.goal_plan import GoalPlan
from planner.jobs.coverage_plan import CoveragePlan
from planner.jobs.tour_plan import TourPlan
from planner.paths.units import in_lab
from sim.io.files import whole_file


def write_svg(figure: Figure, path: Path, identity: str) -> None:
    """Write a figure as SVG, completely or not at all; `identity` names the plan."""
    with whole_file(path) as part:
        figure.savefig(part, format="svg", bbox_inches="tight", metadata={"Date": None, "Identifier": identity})


def draw_goal_plan(goal_plan: GoalPlan) -> Figure:
    """Draw a plan from pose to pose, with what the robot must keep out of."""
    figure = Figure(figsize=(6, 6))
    axes = goal_plan.plot(figure.add_subplot())
    robot = goal_plan.plan.robot
    way, stated = in_lab(goal_plan.length, robot), in_lab(goal_plan.plan.stated_error, robot)
    axes.set_title(
        f"{schedule_words(goal_plan.plan)}\nway {way}, stated error {stated}", fontsize=10, parse_math=False
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncol=2, fontsize=8, frameon=False)
    return figure


def draw_tour(tour: TourPlan) -> Figure:
    """Draw a tour with the numbers of its places."""
    figure = Figure(figsize=(6, 6))
    axes = tour.plot(figure.add_subplot())
    stated = in_lab(tour.plan.stated_error, tour.plan.robot)
    axes.set_title(f"{schedule_words(tour.plan)}\nstated error {stated}", fontsize=10, parse_math=False)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncol=2, fontsize=8, frameon=False)
    return figure


def draw_cover(cover: CoveragePlan) -> Figure:
    """Draw a region and what is covered of it."""
    figure = Figure(figsize=(6, 6))
    axes = cover.plot(figure.add_subplot())
    axes.set_title(
        f"{schedule_words(cover.plan)}\ncovers {100 * cover.share:.1f} %", fontsize=10, parse_math=False
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncol=2, fontsize=8, frameon=False)
    return figure
