"""The way back: a shortest Dubins track of the pivot from where it is to a pose of the remaining path.

The cost of a target is the length of the track, and LEFT_OUT times the length of the path that is left out before
it. Targets are tried at equal strides along the path, then one by one about the best. `planner/c/way_back.h` does
the same in C. Lengths in l.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planner.goal.dubins import TURNS, words
from sim.arrays import Floats, Integers

LEFT_OUT = 0.1  # of a length of the path: what it costs to leave it out
STRIDE = 0.5  # between two targets, in radii
ROOM = 0.95  # the share of its largest curvature that the robot uses on the way
SEGMENTS = 3


class Segment(NamedTuple):
    """An arc or a straight line: where it starts, its curvature and its length."""

    x: float
    y: float
    course: float
    curvature: float
    length: float

    def project(self, x: float, y: float, near: float) -> tuple[float, float]:
        """Return the progress along the segment, and the distance to its left; on an arc, nearest to `near`."""
        if self.curvature == 0:
            c, s = math.cos(self.course), math.sin(self.course)
            ahead, aside = x - self.x, y - self.y
            return c * ahead + s * aside, c * aside - s * ahead
        side = 1.0 if self.curvature > 0 else -1.0
        ahead = x - (self.x - math.sin(self.course) / self.curvature)
        aside = y - (self.y + math.cos(self.course) / self.curvature)
        turned = math.atan2(aside, ahead) + side * math.pi / 2 - self.course - self.curvature * near
        turned -= 2 * math.pi * math.floor((turned + math.pi) / (2 * math.pi))
        error = 1 / self.curvature - side * math.sqrt(ahead * ahead + aside * aside)
        return near + turned / self.curvature, error

    def poses(self, spacing: float) -> Floats:
        """Sample places and courses (m, 3) at most `spacing` apart, both ends included."""
        along = np.linspace(0.0, self.length, max(math.ceil(self.length / spacing), 1) + 1)
        course = self.course + self.curvature * along
        if self.curvature == 0:
            x, y = along * math.cos(self.course), along * math.sin(self.course)
        else:
            x = (np.sin(course) - math.sin(self.course)) / self.curvature
            y = (math.cos(self.course) - np.cos(course)) / self.curvature
        return np.stack([self.x + x, self.y + y, course], 1)


class Way(NamedTuple):
    """A track of three segments, and the step of the path at which it ends."""

    segments: tuple[Segment, Segment, Segment]
    target: int

    @property
    def course(self) -> float:
        """The course at the end."""
        last = self.segments[2]
        return last.course + last.curvature * last.length

    @property
    def length(self) -> float:
        return sum(segment.length for segment in self.segments)

    def poses(self, spacing: float) -> Floats:
        """Sample places and courses (m, 3) at most `spacing` apart, from the start to the end."""
        parts = [segment.poses(spacing) for segment in self.segments if segment.length > 0]
        return np.concatenate([parts[0][:1], *(part[1:] for part in parts)]) if parts else np.empty((0, 3))


def shortest_way(
    start: tuple[float, float, float],
    targets: Floats,
    left_out: Floats,
    stride: int,
    radius: float,
    worth: float = LEFT_OUT,
) -> Way:
    """Find the cheapest way.

    Args:
        start: place and course of the pivot.
        targets: its poses (m, 3) on the remaining path.
        left_out: length (m,) of the path before each.
        stride: targets between two that are tried first.
        radius: of the arcs.
        worth: what a length that is left out costs.
    """

    def best(rows: Integers) -> tuple[int, Floats, int]:
        lengths = words(np.array(start), targets[rows], radius)
        total = lengths.sum(-1)
        word = total.argmin(-1)
        row = int((total.min(-1) + worth * left_out[rows]).argmin())
        return int(rows[row]), lengths[row, word[row]], int(word[row])

    coarse = best(np.arange(0, len(targets), stride))[0]
    target, lengths, word = best(np.arange(max(coarse - stride + 1, 0), min(coarse + stride, len(targets))))
    return Way(_segments(start, TURNS[word].tolist(), lengths.tolist(), radius), target)


def _segments(
    start: tuple[float, float, float], turns: list[int], lengths: list[float], radius: float
) -> tuple[Segment, Segment, Segment]:
    """Put the segments of a word one after the other."""
    x, y, course = start
    segments = []
    for turn, length in zip(turns, lengths, strict=True):
        segments.append(Segment(x, y, course, turn / radius, length))
        if turn:
            end = course + turn * length / radius
            x += turn * radius * (math.sin(end) - math.sin(course))
            y -= turn * radius * (math.cos(end) - math.cos(course))
            course = end
        else:
            x, y = x + length * math.cos(course), y + length * math.sin(course)
    return segments[0], segments[1], segments[2]
