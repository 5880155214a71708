"""Pictures of a region, and of what a round footprint covers along a track; given in l, on axes in cm."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.patches import Circle as Disc

from planner.jobs.region import Field, corners
from planner.planning.picture import DECLARED
from sim.arrays import Floats

SWATH = "#d5ead6"
_DISCS = 3_000


def draw_swath(axes: Axes, track: Floats, width: float, tail_length: float) -> None:
    """Draw what a footprint of some width covers along a track (S, 2); `tail_length` is l in m."""
    cm = 100 * tail_length
    every = max(1, len(track) // _DISCS)
    discs = [Disc((x, y), cm * width / 2) for x, y in (cm * track[::every]).tolist()]
    axes.add_collection(PatchCollection(discs, color=SWATH, lw=0))
    axes.autoscale_view()


def draw_field(axes: Axes, field: Field, tail_length: float) -> None:
    """Draw the outlines of a region and its holes."""
    for region in (field.outline, *field.holes):
        outline = 100 * tail_length * corners(region)
        axes.plot(*np.concatenate([outline, outline[:1]]).T, color=DECLARED, lw=1.0, ls="--")
