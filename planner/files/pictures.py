"""Pictures by matplotlib: of plans with their jobs, of fleets, and how a figure is written."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from planner.files.plan_picture import schedule_words
from planner.jobs.fleet_picture import draw_distances, draw_motions
from planner.jobs.fleet_plan import FleetPlan
from planner.planning.plan import Plan
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


def draw_plan(plan: Plan) -> Figure:
    """Draw a plan with what belongs to its job."""
    figure = Figure(figsize=(6, 6))
    axes = plan.plot(figure.add_subplot())
    axes.set_title(f"{schedule_words(plan)}\n{plan.job.title(plan)}", fontsize=10, parse_math=False)
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
