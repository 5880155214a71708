"""How the robot's pivot and heading move while the tracked point follows a path: the pivot draws a tractrix.

The tracked point p is ahead of the pivot q by the distance a, along the heading e(φ). When p moves along a path, q
is dragged behind it like a trailer:

    δ = angle from heading to the path's tangent,   dφ/ds = sin δ / a,   dq/ds = cos δ e(φ),

so the curvature of q's track is tan δ / a. At a kink of angle α in the path, δ jumps by α. If the kink is rounded
by an arc, δ grows less. On a closed path the pivot is dragged for a few laps, until the motion repeats.

A robot whose two directions differ moves sideways at a rate u, and a current c carries it. With the net speed V
along the heading, the path's speed is v = (V + c·e)/cos δ, and dφ/ds = (sin δ − (u + c·n)/v)/a.

Lengths in tail lengths l. Source: the slip-free reduction is ours; tractrix as in any text on the planar trailer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from planner.paths.path import Path2D, arc_length, resample
from sim.arrays import Floats
from sim.io.errors import InputError

_LAPS = 6
_MOST_SLIP = 3.0  # sideways by forward motion


@dataclass(frozen=True)
class Drift:
    """What moves the pivot besides its net speed along the heading, as shares of that speed."""

    sideways: float = 0.0  # to the left of the heading
    current: tuple[float, float] = (0.0, 0.0)  # in the lab

    @property
    def none(self) -> bool:
        return self.sideways == 0.0 and self.current == (0.0, 0.0)


STILL = Drift()


@dataclass(frozen=True)
class Reference:
    """The declared path p, and the pivot q and heading that belong to each of its points."""

    p: Floats  # (m, 2), closed paths end where they begin
    q: Floats  # (m, 2)
    heading: Floats  # (m,), unwrapped [rad]
    arc: Floats  # (m,), arc length of q
    closed: bool  # the path ends where it begins

    @property
    def curvature(self) -> Floats:
        """Turn of the heading per length of q at the middle of its steps, (m − 1,)."""
        step = np.maximum(np.diff(self.arc), 1e-9)
        return np.diff(self.heading) / step


def reference(path: Path2D, pivot_distance: float, spacing: float, drift: Drift = STILL) -> Reference:
    """Compute the tractrix of a path.

    Args:
        path: the path of the tracked point.
        pivot_distance: length of the rod; 0: the pivot itself is tracked.
        spacing: of the points.
        drift: what carries the robot off its heading.

    Raises:
        InputError: the drift is as fast as the robot.
    """
    p = resample(path.polyline(), spacing)
    moves = np.diff(p, axis=0)
    tangent = np.unwrap(np.arctan2(moves[:, 1], moves[:, 0]))
    length = np.linalg.norm(moves, axis=1)
    if pivot_distance <= 0:
        heading = _pivot_headings(tangent, drift, closed=path.closed)
    else:
        start = tangent[0] - _slip(float(tangent[0]), drift)
        for _ in range(_LAPS if path.closed else 1):
            heading = _drag(tangent, length, pivot_distance, start, drift)
            start = heading[-1] - _turning(tangent) if path.closed else start
    q = p - pivot_distance * np.stack([np.cos(heading), np.sin(heading)], 1)
    return Reference(p, q, heading, arc_length(q), path.closed)


def _pivot_headings(tangent: Floats, drift: Drift, *, closed: bool) -> Floats:
    """Compute the headings at the points of the pivot's own path: between those of its steps."""
    before = tangent[:1] if not closed else tangent[-1:] - _turning(tangent)
    wrap = tangent[-1:] if not closed else tangent[:1] + _turning(tangent)
    ends = np.concatenate([before, tangent, wrap])
    heading = (ends[1:] + ends[:-1]) / 2
    return np.asarray(heading - [_slip(angle, drift) for angle in heading.tolist()])


def _turning(tangent: Floats) -> float:
    """Compute the total turn of a closed path: a multiple of 2π."""
    closing = (tangent[0] - tangent[-1] + math.pi) % (2 * math.pi) - math.pi
    return float(tangent[-1] - tangent[0] + closing)


def _slip(direction: float, drift: Drift) -> float:
    """Compute the angle from the heading to a straight path in `direction`."""
    if drift.none:
        return 0.0
    slip = 0.0
    for _ in range(50):
        slip = math.atan(_ratio(direction - slip, drift))
    return slip


def slips(direction: Floats, drift: Drift) -> Floats:
    """Compute the angles (...) from the heading to straight paths in these directions (...)."""
    slip = np.zeros_like(direction)
    if drift.none:
        return slip
    cx, cy = drift.current
    for _ in range(30):
        c, s = np.cos(direction - slip), np.sin(direction - slip)
        slip = np.arctan2(drift.sideways - cx * s + cy * c, 1 + cx * c + cy * s)
    return slip


def slips_at_heading(heading: Floats, drift: Drift) -> Floats:
    """Compute the angles (...) from headings (...) to the direction of motion."""
    course = heading
    for _ in range(30):
        course = heading + slips(course, drift)
    return np.asarray(course - heading)


def _ratio(heading: float, drift: Drift) -> float:
    """Compute the ratio of sideways to forward motion, (u + c·n)/(V + c·e)."""
    cx, cy = drift.current
    ahead = 1 + cx * math.cos(heading) + cy * math.sin(heading)
    aside = drift.sideways - cx * math.sin(heading) + cy * math.cos(heading)
    if ahead <= 0 or abs(aside) > _MOST_SLIP * ahead:
        raise InputError("the current, or the difference of left and right turns, is as fast as the robot's net "
                         "motion; use a longer dwell or a faster motor")  # fmt: skip
    return aside / ahead


def _drag(tangent: Floats, length: Floats, pivot_distance: float, start: float, drift: Drift) -> Floats:
    """Compute the heading along straight steps; exact without drift, where tan(δ/2) decays as exp(−s/a)."""
    heading = np.empty(len(tangent) + 1)
    heading[0] = now = float(start)
    decay = np.exp(-length / pivot_distance)
    still, turn = drift.none, 2 * math.pi
    for i, (direction, factor, step) in enumerate(
        zip(tangent.tolist(), decay.tolist(), length.tolist(), strict=True)
    ):
        gap = (direction - now + math.pi) % turn - math.pi
        now += gap - 2 * math.atan(math.tan(gap / 2) * factor)
        if not still:
            now -= _ratio(now, drift) * max(math.cos(gap), 0.0) * step / pivot_distance
        heading[i + 1] = now
    return heading
