"""plan.svg: the plan over its path, with the stated error."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from planner.files.svg_axes import SvgAxes
from planner.paths.units import in_lab
from planner.planning.plan import Plan
from sim.io.units import format_time


def plan_svg(result: Plan, identity: str) -> str:
    """Return plan.svg as text; `identity` names the plan."""
    axes: Any = SvgAxes()
    replace(result, job=None).plot(axes)
    rms, stated = (in_lab(error, result.robot) for error in (result.predicted_rms, result.stated_error))
    axes.set_title(f"{schedule_words(result)}\npredicted error {rms} rms, stated error {stated}")
    return str(axes.text(identity))


def schedule_words(result: Plan) -> str:
    """Name the robot, the number of dwells and their duration."""
    return f"{result.robot.name}: {len(result.dwells)} dwells, {format_time(float(result.seconds.sum()))}"
