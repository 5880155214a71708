"""Pictures of regions that a robot must keep out of, and of its poses at start and goal, on axes in cm.

What is drawn is given in l; `tail_length` is l in m.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle as Patch

from planner.goal.obstacles import Circle, Footprint, FreeSpace
from planner.planning.picture import DECLARED, REPLAYED

KEEP_OUT = "#d8b365"


def draw_regions(axes: Axes, free_space: FreeSpace, tail_length: float) -> None:
    """Draw obstacles as areas, and walls as lines."""
    cm = 100 * tail_length
    for region in free_space.regions:
        if isinstance(region, Circle):
            axes.add_patch(Patch((cm * region.x, cm * region.y), cm * region.radius, color=KEEP_OUT, lw=0))
        else:
            axes.fill(*(cm * region.corners.T), color=KEEP_OUT, lw=0)
    if free_space.walls is not None:
        corners = cm * free_space.walls.corners
        axes.plot(*np.concatenate([corners, corners[:1]]).T, color=KEEP_OUT, lw=3)


def draw_places(
    axes: Axes,
    body: Footprint,
    poses: Sequence[tuple[float, float, float]],
    via: Sequence[tuple[float, float]],
    tail_length: float,
) -> None:
    """Draw the robot's axis at some poses, and the places on its way."""
    cm = 100 * tail_length
    axis = cm * np.array([body.places.min() - body.radius, body.places.max() + body.radius])
    for x, y, heading in poses:
        along = np.array([[math.cos(heading)], [math.sin(heading)]])
        axes.plot(*(np.array([[cm * x], [cm * y]]) + along * axis), color=DECLARED, lw=3, alpha=0.3)
        axes.plot(cm * x, cm * y, "o", color=DECLARED, ms=5)
    for x, y in via:
        axes.plot(cm * x, cm * y, "+", color=REPLAYED, ms=10)
    axes.autoscale_view()
