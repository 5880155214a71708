"""Pictures of plans as SVG: of a path with the stated error, and of a job."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from common.units import format_time
from planner.paths.units import in_lab
from planner.planning.plan import Plan

_LONGER = 5.2  # inches, of the longer side of the frame
_LEAST = np.array([4.2, 1.2])  # inches, width and height of the frame
_MARGIN = 0.05  # of the longer side of what is drawn, around it
_LEGEND = 32.0  # points, from the frame to the legend: the numbers and the label of the x axis are between


def draw_plan(plan: Plan) -> Figure:
    """Draw a plan with what belongs to its job, if it has one, on a frame that fits it."""
    figure = Figure()
    axes = replace(plan, job=None).plot(figure.add_axes((0, 0, 1, 1)))
    axes.set_aspect("equal", adjustable="datalim")
    margin = _MARGIN * max(axes.dataLim.size)  # the same on all sides, so that labels find room in a flat picture
    size = np.array(axes.dataLim.size) + 2 * margin
    axes.set_xlim(axes.dataLim.xmin - margin, axes.dataLim.xmax + margin)
    axes.set_ylim(axes.dataLim.ymin - margin, axes.dataLim.ymax + margin)
    figure.set_size_inches(*np.maximum(_LONGER * size / size.max(), _LEAST))
    if plan.job is None:
        rms, stated = (in_lab(error, plan.robot) for error in (plan.predicted_rms, plan.stated_error))
        counts = f"predicted error {rms} rms, stated error {stated}"
    else:
        plan.job.draw(axes, plan)  # it finds room for words on a frame that has its size
        counts = plan.job.title(plan)
    words = f"{plan.robot.name}: {len(plan.dwells)} dwells, {format_time(float(plan.seconds.sum()))}"
    axes.set_title(f"{words}\n{counts}", fontsize=10, parse_math=False)
    below = axes.transAxes + ScaledTranslation(0.0, -_LEGEND / 72, figure.dpi_scale_trans)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), bbox_transform=below, ncol=2, fontsize=8,
                frameon=False)  # fmt: skip
    return figure
