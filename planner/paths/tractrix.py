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
from functools import cached_property

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from planner.paths.path import Path2D, arc_length, axis_at, resample
from sim.mechanics import planar

_LAPS = 6
_MOST_SLIP = 3.0  # sideways by forward motion
_BACK = 1e-9  # l that a pivot may move back in a step, by rounding
_STRAIGHT = 1e-6  # rad; smaller turns are rounding
_POINTS_A_ROD = 8  # of an arc, within the length over which the pivot turns at a kink
_TOO_FAST = (
    "the current, or the difference of left and right turns, is as fast as the robot's net motion; use a longer "
    "dwell or a faster motor"
)


@dataclass(frozen=True)
class Drift:
    """What moves the pivot besides its net speed along the heading, as shares of that speed."""

    sideways: float = 0.0  # to the left of the heading
    current: tuple[float, float] = (0.0, 0.0)  # in the lab

    @property
    def none(self) -> bool:
        return self.sideways == 0.0 and self.current == (0.0, 0.0)

    def slip_at(self, heading: Floats | float) -> Floats:
        """Compute the angles (...) from headings (...) to the direction of motion."""
        return np.asarray(planar.slip(self.sideways, *self.current, heading))

    def slip_along(self, course: Floats | float) -> Floats:
        """Compute the angles δ (...) from the heading to courses (...): sin δ − u cos δ = c·n, n left of a course.

        Raises:
            InputError: a current across a course is as fast as the robot.
        """
        if self.none:  # searches for ways ask for many
            return np.zeros(np.shape(course))
        (x, y), forward = self.current, math.hypot(1.0, self.sideways)
        across = (y * np.cos(course) - x * np.sin(course)) / forward
        if not (np.abs(across) < 1).all():
            raise InputError(_TOO_FAST)
        return np.asarray(math.atan(self.sideways) + np.arcsin(across))


STILL = Drift()


@dataclass(frozen=True)
class Reference:
    """The declared path p, and the pivot q and heading that belong to each of its points."""

    p: Floats  # (m, 2), closed paths end where they begin
    q: Floats  # (m, 2)
    heading: Floats  # (m,), unwrapped [rad]
    closed: bool = False  # the path ends where it begins

    @staticmethod
    def of_path(p: Floats, heading: Floats, rod: float, *, closed: bool) -> Reference:
        """Place the pivot a rod behind the points (m, 2) of a path."""
        return Reference(p, p - rod * axis_at(heading), heading, closed)

    @staticmethod
    def of_pivot(poses: Floats, rod: float, drift: Drift, heading: float | None = None) -> Reference:
        """Place the path a rod ahead of a track of the pivot.

        Args:
            poses: (m, 3), places of the pivot and its courses, without jumps.
            rod: distance from the pivot to the tracked point.
            drift: what carries the robot off its heading.
            heading: the first one, whole turns included.
        """
        headings = poses[:, 2] - drift.slip_along(poses[:, 2])
        if heading is not None:
            headings = headings + _whole_turns(heading - headings[0])
        return Reference(poses[:, :2] + rod * axis_at(headings), poses[:, :2], headings)

    @staticmethod
    def joined(*parts: Reference, closed: bool = False) -> Reference:
        """Put parts one after the other, with headings that differ by whole turns from their own."""
        parts = tuple(part for part in parts if len(part.q))
        headings = [parts[0].heading]
        for part in parts[1:]:
            headings.append(part.heading + _whole_turns(headings[-1][-1] - part.heading[0]))
        p, q = (np.concatenate([getattr(part, name) for part in parts]) for name in ("p", "q"))
        return Reference(p, q, np.concatenate(headings), closed)

    def part(self, first: int, end: int | None = None) -> Reference:
        """Return the points first, …, end − 1."""
        rows = slice(first, end)
        return Reference(self.p[rows], self.q[rows], self.heading[rows])

    def begun_at(self, index: int) -> Reference:
        """Begin a closed reference at another point."""
        return Reference.joined(self.part(index, -1), self.part(0, index + 1), closed=True)

    def laps(self, count: int, further: float) -> Reference:
        """Repeat a closed reference, and go on by a length, at most a lap more."""
        last = int(np.searchsorted(self.arc, min(further, float(self.arc[-1])), side="right"))
        return Reference.joined(self, *[self.part(1)] * (count - 1), self.part(1, max(last, 2)))

    @cached_property
    def arc(self) -> Floats:
        """Arc length of q, (m,)."""
        return arc_length(self.q)

    @property
    def curvature(self) -> Floats:
        """Turn of the heading per length of q at the middle of its steps, (m − 1,)."""
        step = np.maximum(np.diff(self.arc), 1e-9)
        return np.diff(self.heading) / step

    @property
    def sharpness(self) -> Floats:
        """Size of the curvature, (m − 1,), infinite where the pivot goes back."""
        ahead = (np.diff(self.q, axis=0) * axis_at((self.heading[1:] + self.heading[:-1]) / 2)).sum(1)
        return np.where(ahead < -_BACK, np.inf, np.abs(self.curvature))

    @property
    def poses(self) -> Floats:
        """Places of the pivot, and headings, (m, 3)."""
        return np.column_stack([self.q, self.heading])

    def courses(self, drift: Drift) -> Floats:
        """Return places and courses of the pivot (m, 3): the directions in which it moves."""
        return np.column_stack([self.q, self.heading + drift.slip_at(self.heading)])

    @property
    def turn(self) -> float:
        """Turn of the heading in a lap, a multiple of 2π."""
        return _whole_turns(self.heading[-1] - self.heading[0])

    @property
    def first_turn(self) -> int:
        """Side to which the heading turns first: 1 to the left, or straight on; −1 to the right."""
        turned = self.heading - self.heading[0]
        turning = np.flatnonzero(np.abs(turned) > _STRAIGHT)
        return 1 if not len(turning) or turned[turning[0]] > 0 else -1


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
        start = tangent[0] - drift.slip_along(tangent[0])
        for _ in range(_LAPS if path.closed else 1):
            heading = _drag(tangent, length, pivot_distance, start, drift)
            start = heading[-1] - _turning(tangent) if path.closed else start
    return Reference.of_path(p, heading, pivot_distance, closed=path.closed)


def closest(pivot_distance: float, spacing: float) -> float:
    """Say how close the points of an arc must be for a reference to turn as the arc does, not as its kinks do.

    At a kink the pivot turns within the length of the rod, or of a step of the reference where that is longer.
    """
    return max(pivot_distance, spacing) / _POINTS_A_ROD


def _whole_turns(angle: float) -> float:
    return 2 * math.pi * round(angle / (2 * math.pi))


def _pivot_headings(tangent: Floats, drift: Drift, *, closed: bool) -> Floats:
    """Compute the headings at the points of the pivot's own path: between those of its steps."""
    before = tangent[:1] if not closed else tangent[-1:] - _turning(tangent)
    wrap = tangent[-1:] if not closed else tangent[:1] + _turning(tangent)
    ends = np.concatenate([before, tangent, wrap])
    heading = (ends[1:] + ends[:-1]) / 2
    heading = heading - drift.slip_along(heading)
    for angle in heading.tolist():
        _ratio(angle, drift)  # refuses a drift that is too fast
    return heading


def _turning(tangent: Floats) -> float:
    """Compute the total turn of a closed path: a multiple of 2π."""
    closing = (tangent[0] - tangent[-1] + math.pi) % (2 * math.pi) - math.pi
    return float(tangent[-1] - tangent[0] + closing)


def _ratio(heading: float, drift: Drift) -> float:
    """Compute the ratio of sideways to forward motion, (u + c·n)/(V + c·e)."""
    cx, cy = drift.current
    ahead = 1 + cx * math.cos(heading) + cy * math.sin(heading)
    aside = drift.sideways - cx * math.sin(heading) + cy * math.cos(heading)
    if ahead <= 0 or abs(aside) > _MOST_SLIP * ahead:
        raise InputError(_TOO_FAST)
    return aside / ahead


def _drag(tangent: Floats, length: Floats, pivot_distance: float, start: float, drift: Drift) -> Floats:
    """Compute the heading along straight steps; exact without drift, where tan(δ/2) decays as exp(−s/a)."""
    heading = np.empty(len(tangent) + 1)
    heading[0] = now = float(start)
    decay = np.exp(-length / pivot_distance)
    still, turn = drift.none, 2 * math.pi
    for i, (direction, factor) in enumerate(zip(tangent.tolist(), decay.tolist(), strict=True)):
        gap = (direction - now + math.pi) % turn - math.pi
        now += gap - 2 * math.atan(math.tan(gap / 2) * factor)
        if not still:
            now -= _ratio(now, drift) * max(math.cos(gap), 0.0) * (1 - factor)
        heading[i + 1] = now
    return heading
