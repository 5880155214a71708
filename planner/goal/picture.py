"""Pictures of a robot's poses at start and goal, and of the places on its way, on axes in cm."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from planner.paths.obstacles import Footprint
from planner.planning.picture import BODY, REPLAYED


def draw_places(
    axes: Axes,
    body: Footprint,
    poses: Sequence[tuple[float, float, float]],
    via: Sequence[tuple[float, float]],
    tail_length: float,
) -> None:
    """Draw the robot's axis at some poses, and the places on its way, given in l; `tail_length` is l in m."""
    cm = 100 * tail_length
    axis = cm * np.array([body.places.min() - body.radius, body.places.max() + body.radius])
    for x, y, heading in poses:
        along = np.array([[math.cos(heading)], [math.sin(heading)]])
        axes.plot(*(np.array([[cm * x], [cm * y]]) + along * axis), color=BODY, lw=4, alpha=0.6)
        axes.plot(cm * x, cm * y, "o", color=BODY, ms=5)
    for x, y in via:
        axes.plot(cm * x, cm * y, "+", color=REPLAYED, ms=10)
    axes.autoscale_view()
