"""Pictures by matplotlib: of plans with their jobs, of fleets, and of the trade-off that the dwell decides.

A longer dwell loses less speed at the flips and flips less often, but the heading swings further. For the
trade-off one plan is made for each of several dwells.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from planner.files.plan_svg import schedule_words
from planner.jobs.fleet_plan import FleetPlan
from planner.jobs.plan import make_plan
from planner.planning.picture import DECLARED, PREDICTED, RAW, REPLAYED, label_points
from planner.planning.plan import Plan
from planner.vehicle.zigzag import QUICK, longest_dwell
from sim.io.errors import InputError
from sim.io.files import whole_file
from sim.io.units import format_length, format_time

_BELOW = 32.0  # points, from the axes to the legend: the numbers and the label of the x axis are between
_COUNT = 10


def write_svg(figure: Figure, path: Path, identity: str) -> None:
    """Write a figure as SVG, completely or not at all; `identity` names the plan."""
    with whole_file(path) as part:
        figure.savefig(part, format="svg", bbox_inches="tight", metadata={"Date": None, "Identifier": identity})


def draw_plan(plan: Plan) -> Figure:
    """Draw a plan with what belongs to its job."""
    figure = Figure(figsize=(6, 6))
    axes = plan.plot(figure.add_subplot())
    axes.set_title(f"{schedule_words(plan)}\n{plan.job.title(plan)}", fontsize=10, parse_math=False)
    # Below the label of the x axis, however flat the axes are.
    below = axes.transAxes + ScaledTranslation(0.0, -_BELOW / 72, figure.dpi_scale_trans)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), bbox_transform=below, ncol=2, fontsize=8,
                frameon=False)  # fmt: skip
    return figure


def draw_fleet_plan(fleet: FleetPlan) -> Figure:
    """Draw the tracks of a fleet, and below them the distances between bodies."""
    figure = Figure(figsize=(6, 8.5), layout="constrained")
    tracks, distances = figure.subplots(2, 1, height_ratios=(3, 1.2))
    fleet.plot(tracks)
    robots, apart = len(fleet.names), format_length(fleet.apart_m)
    tracks.set_title(
        f"{robots} robots, {format_time(fleet.duration_s)}; bodies keep {apart} apart\ndots: minutes",
        fontsize=10,
        parse_math=False,
    )
    fleet.plot_distances(distances)
    for axes in (tracks, distances):
        axes.legend(fontsize=8, frameon=False)
    return figure


def draw_trade_off(chosen: Plan) -> Figure:
    """Draw errors over time and over the number of flips, for dwells from the shortest to the longest.

    Args:
        chosen: the plan that the user gets.
    """
    plans = []
    for dwell in np.geomspace(QUICK, longest_dwell(chosen.tracked.vehicle, QUICK), _COUNT).tolist():
        with suppress(InputError):  # such dwells do not get the robot around the path
            other = replace(chosen.request, dwell=dwell, tolerance=None, arrive_seconds=None, loop=False)
            plans.append(make_plan(chosen.drawn, chosen.tracked, other))
    errors = np.array([(plan.stated_error, plan.predicted_max, plan.predicted_rms) for plan in plans]).T
    kinds = (("stated", PREDICTED), ("predicted, max", DECLARED), ("predicted, rms", RAW))
    figure = Figure(figsize=(9, 4), layout="constrained")
    values: dict[str, Callable[[Plan], float]] = {
        "time / min": lambda plan: float(plan.seconds.sum()) / 60,
        "flips": lambda plan: float(len(plan.dwells)),
    }
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (name, value) in zip(panels, values.items(), strict=True):
        x = [value(plan) for plan in plans]
        for (label, colour), y in zip(kinds, errors, strict=True):
            axes.plot(x, y, "o-", color=colour, ms=3, label=label)
        axes.plot(value(chosen), chosen.stated_error, "s", color=REPLAYED, ms=7, label="this plan")
        axes.set_xlabel(name)
    panels[0].set_ylabel("error / l")
    panels[0].set_ylim(bottom=0)
    for axes, value in zip(panels, values.values(), strict=True):
        places = np.array([[value(plan), plan.stated_error] for plan in plans])
        label_points(axes, places, [f"{plan.minimum_dwell:.2g}" for plan in plans], [PREDICTED] * len(plans), 7)
    panels[0].legend(fontsize=8, frameon=False)
    figure.suptitle(f"{chosen.robot.name}: error against time and flips; numbers are dwells", fontsize=10)
    return figure
