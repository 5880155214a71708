"""The trade-off that the dwell decides: error against time and number of flips, for one robot and path.

A longer dwell loses less speed at the flips and flips less often, but the heading swings further. One plan is made
for each of several dwells.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure

from planner.jobs.plan import make_plan
from planner.planning.picture import DECLARED, PREDICTED, RAW, REPLAYED, label_points
from planner.planning.plan import Plan
from planner.vehicle.zigzag import QUICK, longest_dwell
from sim.io.errors import InputError

_COUNT = 10


@dataclass(frozen=True)
class TradeOff:
    """Plans of the same path by their shortest dwell, and the one that was chosen."""

    plans: tuple[Plan, ...]
    chosen: Plan


def trade_off(chosen: Plan) -> TradeOff:
    """Plan with dwells from the shortest whose response is known well to the longest that makes sense.

    Args:
        chosen: the plan that the user gets.
    """
    tracked, plans = chosen.tracked, []
    for dwell in np.geomspace(QUICK, longest_dwell(tracked.vehicle, QUICK), _COUNT).tolist():
        try:
            other = replace(chosen.request, dwell=dwell, tolerance=None, arrive_seconds=None, loop=False)
            plans.append(make_plan(chosen.drawn, tracked, other))
        except InputError:  # such dwells do not get the robot around the path
            continue
    return TradeOff(tuple(plans), chosen)


def draw_trade_off(comparison: TradeOff) -> Figure:
    """Draw errors over time, and errors over the number of flips."""
    figure = Figure(figsize=(9, 4), layout="constrained")
    by_time, by_flips = figure.subplots(1, 2, sharey=True)
    values: tuple[tuple[str, Callable[[Plan], float]], ...] = (
        ("time / min", lambda plan: float(plan.seconds.sum()) / 60),
        ("flips", lambda plan: float(len(plan.dwells))),
    )
    for axes, (name, value) in zip((by_time, by_flips), values, strict=True):
        x = [value(plan) for plan in comparison.plans]
        axes.plot(x, [plan.stated_error for plan in comparison.plans], "o-", color=PREDICTED, ms=3, label="stated")
        axes.plot(
            x,
            [plan.predicted_max for plan in comparison.plans],
            "o-",
            color=DECLARED,
            ms=3,
            label="predicted, max",
        )
        axes.plot(
            x, [plan.predicted_rms for plan in comparison.plans], "o-", color=RAW, ms=3, label="predicted, rms"
        )
        axes.plot(
            value(comparison.chosen), comparison.chosen.stated_error, "s", color=REPLAYED, ms=7, label="this plan"
        )
        axes.set_xlabel(name)
    by_time.set_ylabel("error / l")
    by_time.set_ylim(bottom=0)
    numbers = [f"{plan.minimum_dwell:.2g}" for plan in comparison.plans]
    for axes, (_, value) in zip((by_time, by_flips), values, strict=True):
        places = np.array([[value(plan), plan.stated_error] for plan in comparison.plans])
        label_points(axes, places, numbers, [PREDICTED] * len(places), 7)
    by_time.legend(fontsize=8, frameon=False)
    figure.suptitle(
        f"{comparison.chosen.robot.name}: error against time and flips; numbers are dwells", fontsize=10
    )
    return figure
