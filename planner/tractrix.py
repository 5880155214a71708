"""How the robot's pivot and heading move while the tracked point follows a path: the pivot draws a tractrix.

The tracked point p is ahead of the pivot q by the distance a, along the heading e(φ). When p moves along a path, q
is dragged behind it like a trailer:

    δ = angle from heading to the path's tangent,   dφ/ds = sin δ / a,   dq/ds = cos δ e(φ),

so the curvature of q's track is tan δ / a. At a kink of angle α in the path, δ jumps by α. If the kink is rounded
by an arc, δ grows less. On a closed path the pivot is dragged for a few laps, until the motion repeats.

Lengths in tail lengths l. Source: the slip-free reduction is ours; tractrix as in any text on the planar trailer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from planner.path import Path2D, resample
from sim.arrays import Floats

_LAPS = 6


@dataclass(frozen=True)
class Reference:
    """The declared path p, and the pivot q and heading that belong to each of its points."""

    p: Floats  # (m, 2), closed paths end where they begin
    q: Floats  # (m, 2)
    heading: Floats  # (m,), unwrapped [rad]
    arc: Floats  # (m,), arc length of q
    closed: bool

    @property
    def curvature(self) -> Floats:
        """Curvature of q at the middle of its steps, (m − 1,)."""
        step = np.maximum(np.diff(self.arc), 1e-9)
        return np.diff(self.heading) / step


def reference(path: Path2D, pivot_distance: float, spacing: float) -> Reference:
    """Tractrix of a path with pivot_distance length `pivot_distance` (0: the pivot itself is tracked)."""
    p = resample(path.polyline(), spacing)
    moves = np.diff(p, axis=0)
    tangent = np.unwrap(np.arctan2(moves[:, 1], moves[:, 0]))
    length = np.linalg.norm(moves, axis=1)
    if pivot_distance <= 0:
        wrap = tangent[-1:] if not path.closed else tangent[:1] + _turning(tangent)
        before = tangent[:1] if not path.closed else tangent[-1:] - _turning(tangent)
        ends = np.concatenate([before, tangent, wrap])
        heading = (ends[1:] + ends[:-1]) / 2
    else:
        start = tangent[0]
        for _ in range(_LAPS if path.closed else 1):
            heading = _drag(tangent, length, pivot_distance, start)
            start = heading[-1] - _turning(tangent) if path.closed else start
    q = p - pivot_distance * np.stack([np.cos(heading), np.sin(heading)], 1)
    arc = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    return Reference(p, q, heading, arc, path.closed)


def _turning(tangent: Floats) -> float:
    """Total turn of a closed path: a multiple of 2π."""
    closing = (tangent[0] - tangent[-1] + math.pi) % (2 * math.pi) - math.pi
    return float(tangent[-1] - tangent[0] + closing)


def _drag(tangent: Floats, length: Floats, pivot_distance: float, start: float) -> Floats:
    """Heading along straight steps: exact, tan(δ/2) decays as exp(−s/a)."""
    heading = np.empty(len(tangent) + 1)
    heading[0] = start
    decay = np.exp(-length / pivot_distance)
    for i, (direction, factor) in enumerate(zip(tangent.tolist(), decay.tolist(), strict=True)):
        gap = direction - heading[i]
        gap = (gap + math.pi) % (2 * math.pi) - math.pi
        heading[i + 1] = heading[i] + gap - 2 * math.atan(math.tan(gap / 2) * factor)
    return heading
