"""Pictures of a region, and of what a round footprint covers along a track; given in l, on axes in cm."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.patches import Circle as Disc

from planner.jobs.region import Field, corners
from planner.planning.picture import DECLARED
from sim.arrays import Floats

SWATH = "#d5ead6"
_DISCS = 3_000  # at most
_DENSE = 12  # discs on a way as long as the footprint is wide


def draw_swath(axes: Axes, track: Floats, width: float, tail_length: float) -> None:
    """Draw what a footprint of some width covers along a track (S, 2); `tail_length` is l in m."""
    cm = 100 * tail_length
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track, axis=0).T))])
    places = np.linspace(0.0, way[-1], min(_DISCS, math.ceil(_DENSE * way[-1] / width) + 1))
    centres = cm * np.stack([np.interp(places, way, track[:, i]) for i in (0, 1)], 1)
    discs = [Disc((x, y), cm * width / 2) for x, y in centres.tolist()]
    axes.add_collection(PatchCollection(discs, color=SWATH, lw=0))
    axes.plot([], [], color=SWATH, lw=6, label="swept")
    axes.autoscale_view()


def draw_field(axes: Axes, field: Field, tail_length: float) -> None:
    """Draw the outlines of a region and its holes."""
    for region in (field.outline, *field.holes):
        outline = 100 * tail_length * corners(region)
        axes.plot(*np.concatenate([outline, outline[:1]]).T, color=DECLARED, lw=1.0, ls="--")
