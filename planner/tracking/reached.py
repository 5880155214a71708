"""The place of its path that a robot has reached, as its track so far tells.

Along the track a place of the path is chosen for each pose, so that the sum of their mismatches is least. Places
never go back, and never advance faster than the robot can swim. So where a robot was carried to another part of
its path, it has reached the place where it was taken away: the last one at less than FARTHEST from a pose. The
mismatch is the distance of the pivots, at most FARTHEST, and TURNED (1 − cos Δ) for headings that differ by Δ.
Where the track begins in the middle of the path, the length that is left out before counts LEFT_OUT, as on a way
back. The least sum is found by dynamic programming. Lengths in l.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import minimum_filter1d

from planner.paths.tractrix import Reference
from planner.tracking.way_back import LEFT_OUT
from sim.arrays import Floats, Integers

FARTHEST = 1.0
TURNED = 0.5
FASTER = 1.5  # times the robot's largest speed
_MOST_POSES = 2000
_MOST_PLACES = 4000


def reached(reference: Reference, times: Floats, pivots: Floats, speed: float) -> int:
    """Return the point of the reference that the robot has reached.

    Args:
        reference: the pivot's.
        times: (N,), not falling.
        pivots: (N, 3), places and headings of the pivot at these times.
        speed: the largest of the robot.
    """
    rows = np.unique(np.linspace(0, len(times) - 1, min(len(times), _MOST_POSES)).round().astype(int))
    every = math.ceil(len(reference.q) / _MOST_PLACES)
    places = np.unique(np.append(np.arange(0, len(reference.q), every), len(reference.q) - 1))
    arc = reference.arc[places] - reference.arc[0]
    spacing = float(np.diff(arc).max())
    # Arc lengths are nearly equal from place to place, so that a number of places stands for a length.
    ahead = np.ceil(FASTER * speed * np.diff(times[rows]) / max(spacing, 1e-9)).astype(int) + 1
    mismatch = _mismatch(reference, places, pivots[rows[0]])
    total = LEFT_OUT * arc + mismatch
    best, last = int(total.argmin()), rows[0]
    for row, most in zip(rows[1:].tolist(), ahead.tolist(), strict=True):
        mismatch = _mismatch(reference, places, pivots[row])
        total = _least_before(total, min(most, len(places))) + mismatch
        place = int(total.argmin())
        if mismatch[place] < FARTHEST:
            best, last = place, row
    coarse = int(places[best])
    near = np.arange(max(coarse - every, 0), min(coarse + every + 1, len(reference.q)))
    return int(near[int(_mismatch(reference, near, pivots[last]).argmin())])


def _mismatch(reference: Reference, places: Integers, pivot: Floats) -> Floats:
    x, y, heading = pivot.tolist()
    q = reference.q[places]
    apart = np.minimum(np.hypot(q[:, 0] - x, q[:, 1] - y), FARTHEST)
    return np.asarray(apart + TURNED * (1 - np.cos(reference.heading[places] - heading)))


def _least_before(total: Floats, most: int) -> Floats:
    """Find the least of each entry and of `most` entries before it."""
    size = most + 1
    return np.asarray(minimum_filter1d(total, size, mode="constant", cval=np.inf, origin=(size - 1) // 2))
