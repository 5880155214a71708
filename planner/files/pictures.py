"""Pictures beside those of plans, by matplotlib: a way from pose to pose, and how a figure is written."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from planner.files.plan_picture import schedule_words
from planner.goal.goal_plan import GoalPlan
from planner.jobs.coverage_plan import CoveragePlan
from planner.jobs.fleet_picture import draw_distances, draw_motions
from planner.jobs.fleet_plan import FleetPlan
from planner.jobs.hold_plan import HoldPlan
from planner.jobs.tour_plan import TourPlan
from planner.paths.units import in_lab
from sim.io.files import whole_file
from sim.io.units import format_length, format_time

_BELOW = 32.0  # points, from the axes to the legend: the numbers and the label of the x axis are between


def write_svg(figure: Figure, path: Path, identity: str) -> None:
    """Write a figure as SVG, completely or not at all; `identity` names the plan."""
    with whole_file(path) as part:
        figure.savefig(part, format="svg", bbox_inches="tight", metadata={"Date": None, "Identifier": identity})


def legend_below(axes: Axes) -> None:
    """Put the legend below the label of the x axis, however flat the axes are."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    below = axes.transAxes + ScaledTranslation(0.0, -_BELOW / 72, figure.dpi_scale_trans)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), bbox_transform=below, ncol=2, fontsize=8,
                frameon=False)  # fmt: skip


def draw_goal_plan(goal_plan: GoalPlan) -> Figure:
    """Draw a plan from pose to pose, with what the robot must keep out of."""
    figure = Figure(figsize=(6, 6))
    axes = goal_plan.plot(figure.add_subplot())
    robot = goal_plan.plan.robot
    way, stated = in_lab(goal_plan.length, robot), in_lab(goal_plan.plan.stated_error, robot)
    axes.set_title(
        f"{schedule_words(goal_plan.plan)}\nway {way}, stated error {stated}", fontsize=10, parse_math=False
    )
    legend_below(axes)
    return figure


def draw_tour(tour: TourPlan) -> Figure:
    """Draw a tour with the numbers of its places."""
    figure = Figure(figsize=(6, 6))
    axes = tour.plot(figure.add_subplot())
    stated = in_lab(tour.plan.stated_error, tour.plan.robot)
    axes.set_title(f"{schedule_words(tour.plan)}\nstated error {stated}", fontsize=10, parse_math=False)
    legend_below(axes)
    return figure


def draw_cover(cover: CoveragePlan) -> Figure:
    """Draw a region and what is covered of it."""
    figure = Figure(figsize=(6, 6))
    axes = cover.plot(figure.add_subplot())
    axes.set_title(
        f"{schedule_words(cover.plan)}\ncovers {100 * cover.share:.1f} %", fontsize=10, parse_math=False
    )
    legend_below(axes)
    return figure


def draw_hold(held: HoldPlan) -> Figure:
    """Draw an orbit about a place."""
    figure = Figure(figsize=(6, 6))
    axes = held.plot(figure.add_subplot())
    within = in_lab(held.within, held.plan.robot)
    axes.set_title(f"{schedule_words(held.plan)}\nwith feedback within {within}", fontsize=10, parse_math=False)
    legend_below(axes)
    return figure


def draw_fleet_plan(fleet: FleetPlan) -> Figure:
    """Draw the tracks of a fleet, and below them the distances between bodies."""
    figure = Figure(figsize=(6, 8.5), layout="constrained")
    tracks, distances = figure.subplots(2, 1, height_ratios=(3, 1.2))
    draw_motions(tracks, fleet.names, fleet.scheduled)
    robots, apart = len(fleet.names), format_length(fleet.apart_m)
    tracks.set_title(
        f"{robots} robots, {format_time(fleet.duration_s)}; bodies keep {apart} apart\ndots: minutes",
        fontsize=10,
        parse_math=False,
    )
    draw_distances(distances, fleet.names, *fleet.distances, fleet.apart_m)
    for axes in (tracks, distances):
        axes.legend(fontsize=8, frameon=False)
    return figure
