"""Distances between points and polylines: a tree finds the segments that may be the nearest."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from common.arrays import Floats, Integers
from planner.paths.path import arc_length, points_at, steps_of

TIE = 1e-12  # difference of distances that are equal
_FINE = 4  # candidates a point
_LEAST_POINTS = 1_000  # of the refined polyline
_MOST_POINTS = 400_000
_BLOCK = 16_384  # points at a time, which bounds the memory


def distance_to(polyline: Floats, points: Floats) -> Floats:
    """Compute the distance (M,) of points (M, 2) from a polyline (m, 2), exact to rounding."""
    return nearest(polyline, points)[0]


def nearest(polyline: Floats, points: Floats) -> tuple[Floats, Integers, Floats]:
    """Find the place on a polyline (m, 2) that is nearest to each point: distance, segment and share of it (M,).

    Of segments whose distances differ by less than TIE the lowest number counts. At a vertex two are equally near:
    without a rule, rounding and the order of the points in the tree would choose the side of the path.

    The tree holds the polyline's points, and points between them at most s apart. The nearest place is one
    of the former, or it is within s/2 of one of the latter, along its segment: so that point's distance
    is at most √(d² + s²/4). All segments with points that near are tried.
    """
    start, direction = polyline[:-1], np.diff(polyline, axis=0)
    length = np.hypot(direction[:, 0], direction[:, 1])
    total = float(length.sum())
    step = max(min(float(np.median(length)), total / _LEAST_POINTS), total / _MOST_POINTS, 1e-300)
    pieces = np.maximum(1, np.ceil(length / step)).astype(int)
    owner = np.repeat(np.arange(len(start)), pieces)
    part = np.arange(len(owner)) - (np.cumsum(pieces) - pieces)[owner]
    places = start[owner] + (part / pieces[owner])[:, None] * direction[owner]
    owner = np.append(owner, len(start) - 1)
    previous = np.maximum(owner - np.append(part == 0, False), 0)  # the segment that ends here
    tree = cKDTree(np.concatenate([places, polyline[-1:]]))
    half = float((length / pieces).max()) / 2
    count = min(_FINE, len(owner))
    distance, segment, place = np.empty(len(points)), np.empty(len(points), dtype=int), np.empty(len(points))
    for first in range(0, len(points), _BLOCK):
        block = slice(first, first + _BLOCK)
        some = points[block]
        neighbours = tree.query(some, k=count)
        gap, near = (np.reshape(part, (len(some), count)) for part in neighbours)
        candidates = np.concatenate([owner[near], previous[near]], 1)
        distance[block], segment[block], place[block] = closest_segment(start, direction, some, candidates)
        reach = np.hypot(distance[block] + TIE, half) * (1 + 1e-9)
        unsure = np.flatnonzero((gap[:, -1] <= reach) & (count < len(owner)))
        for i in unsure.tolist():
            near = tree.query_ball_point(some[i], reach[i])
            close = np.unique(np.concatenate([owner[near], previous[near]]))
            closest = closest_segment(start, direction, some[i : i + 1], close[None])
            distance[first + i], segment[first + i], place[first + i] = (part[0] for part in closest)
    return distance, segment, place


def closest_segment(
    start: Floats, direction: Floats, points: Floats, candidates: Integers
) -> tuple[Floats, Integers, Floats]:
    """Choose the nearest of the candidate segments (M, k) of each point; of equally near ones the first."""
    (x, y), (dx, dy) = start.T[:, candidates], direction.T[:, candidates]
    away_x, away_y = points[:, :1] - x, points[:, 1:] - y
    share = np.clip((away_x * dx + away_y * dy) / np.maximum(dx * dx + dy * dy, 1e-300), 0, 1)
    gap = np.hypot(away_x - share * dx, away_y - share * dy)
    tied = gap <= gap.min(1, keepdims=True) + TIE
    best = np.where(tied, candidates, len(start)).argmin(1)
    rows = np.arange(len(points))
    return gap[rows, best], candidates[rows, best], share[rows, best]


def two_sided(first: Floats, second: Floats) -> tuple[float, float]:
    """Compute the largest distance of any point of the first polyline from the second, and the reverse."""
    return farthest(first, second), farthest(second, first)


def farthest(polyline: Floats, other: Floats) -> float:
    """Compute the largest distance of any point of a polyline, longer than 0, from another."""
    return float(distance_to(other, _filled(polyline)).max())


def _filled(polyline: Floats) -> Floats:
    """Add points to a polyline, so that all steps are short compared with its length."""
    length = arc_length(polyline)
    count = max(2, min(4000, steps_of(length[-1], max(float(np.diff(length).min()), length[-1] / 4000))))
    at = np.union1d(np.linspace(0, length[-1], count), length)
    return points_at(at, length, polyline)
