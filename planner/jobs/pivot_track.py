"""Tracks of the pivot as references for the guidance: the tracked point is ahead on a rod."""

from __future__ import annotations

import math

import numpy as np

from planner.paths.path import arc_length
from planner.paths.tractrix import Drift, Reference, slips
from sim.arrays import Floats


def pivot_reference(poses: Floats, rod: float, drift: Drift, heading: float | None = None) -> Reference:
    """Make the reference of a track of the pivot.

    Args:
        poses: (m, 3), places of the pivot and its courses, without jumps.
        rod: distance from the pivot to the tracked point.
        drift: what carries the robot off its heading.
        heading: the first one, whole turns included.
    """
    headings = poses[:, 2] - slips(poses[:, 2], drift)
    if heading is not None:
        headings = headings + 2 * math.pi * round((heading - headings[0]) / (2 * math.pi))
    q = poses[:, :2]
    p = q + rod * np.stack([np.cos(headings), np.sin(headings)], 1)
    return Reference(p, q, headings, arc_length(q), False)
