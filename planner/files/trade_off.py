"""What the dwell decides: error against time and number of flips, for one robot and path.

One plan is made for each of some dwells. A longer dwell loses less speed at the flips and flips less often, and it
swings further.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from planner.files.pictures import DECLARED, PREDICTED, RAW, REPLAYED
from planner.planning.plan import Plan
from planner.vehicle.dwell_choice import QUICK, longest_dwell
from sim.io.errors import InputError

_COUNT = 10


@dataclass(frozen=True)
class TradeOff:
    """Plans of the same path by their shortest dwell, and the one that was chosen."""

    plans: tuple[Plan, ...]
    chosen: Plan


def trade_off(chosen: Plan, make: Callable[[float], Plan], *, count: int = _COUNT) -> TradeOff:
    """Plan with dwells from the shortest whose response is known well to the longest that makes sense.

    Args:
        chosen: the plan that the user gets.
        make: the plan with a given shortest dwell; it raises `InputError` where there is none.
        count: number of plans.
    """
    plans = []
    for dwell in np.geomspace(QUICK, longest_dwell(chosen.vehicle, QUICK), count).tolist():
        try:
            plans.append(make(dwell))
        except InputError:  # such dwells do not get the robot around the path
            continue
    return TradeOff(tuple(plans), chosen)


def draw_trade_off(found: TradeOff) -> Figure:
    """Errors above time, and errors above the number of flips."""
    figure = Figure(figsize=(9, 4), layout="constrained")
    one, other = figure.subplots(1, 2, sharey=True)
    values: tuple[tuple[str, Callable[[Plan], float]], ...] = (
        ("time / min", lambda plan: float(plan.seconds.sum()) / 60),
        ("flips", lambda plan: float(len(plan.dwells))),
    )
    for axes, (name, value) in zip((one, other), values, strict=True):
        x = [value(plan) for plan in found.plans]
        axes.plot(x, [plan.stated_error for plan in found.plans], "o-", color=PREDICTED, ms=3, label="stated")
        axes.plot(
            x, [plan.predicted_max for plan in found.plans], "o-", color=DECLARED, ms=3, label="predicted, max"
        )
        axes.plot(x, [plan.predicted_rms for plan in found.plans], "o-", color=RAW, ms=3, label="predicted, rms")
        axes.plot(value(found.chosen), found.chosen.stated_error, "s", color=REPLAYED, ms=7, label="this plan")
        for plan, at in zip(found.plans, x, strict=True):
            axes.annotate(f"{plan.minimum_dwell:.2g}", (at, plan.stated_error), textcoords="offset points",
                          xytext=(0, 6), ha="center", fontsize=7, color=PREDICTED)  # fmt: skip
        axes.set_xlabel(name)
    one.set_ylabel("error / l")
    one.set_ylim(bottom=0)
    one.legend(fontsize=8, frameon=False)
    figure.suptitle(f"{found.chosen.robot.name}: error against time and flips; numbers are dwells", fontsize=10)
    return figure
