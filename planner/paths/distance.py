"""Distances between points and polylines: circles around runs of segments find the candidates, or a tree does.

The tree takes time linear in the numbers of points and segments. Up to a few million pairs of a point and a run of
segments, the circles take less time than importing the tree of scipy.
"""

from __future__ import annotations

import numpy as np

from planner.paths.path import steps_of
from sim.arrays import Floats, Integers

TIE = 1e-12  # difference of distances that are equal
_FINE = 4  # candidates a point
_LEAST_POINTS = 1_000  # of the refined polyline
_MOST_POINTS = 400_000
_BLOCK = 16_384  # points at a time, which bounds the memory
_RUN = 16  # segments in a circle
_FEW_PAIRS = 8_000_000  # of points and circles
_PAIRS = 20_000  # at a time, which bounds the memory


def distance_to(polyline: Floats, points: Floats) -> Floats:
    """Compute the distance (M,) of points (M, 2) from a polyline (m, 2), exact to rounding."""
    return nearest(polyline, points)[0]


def nearest(polyline: Floats, points: Floats) -> tuple[Floats, Integers, Floats]:
    """Find the place on a polyline (m, 2) that is nearest to each point: distance, segment and share of it (M,).

    Of segments whose distances differ by less than TIE the lowest number counts. At a vertex two are equally near:
    without a rule, rounding and the order of the points in the tree would choose the side of the path.
    """
    runs = -(-(len(polyline) - 1) // _RUN)
    find = _nearest_by_circles if runs * len(points) <= _FEW_PAIRS else _nearest_by_tree
    return find(polyline, points)


def _nearest_by_circles(polyline: Floats, points: Floats) -> tuple[Floats, Integers, Floats]:
    """Find what `nearest` finds with a circle around each run of segments.

    A run is at least as far away as its circle, and at most as far as the vertex in its middle. So the nearest
    segments are in the runs whose circles are no farther than the nearest of these vertices.
    """
    start, direction = polyline[:-1], np.diff(polyline, axis=0)
    runs = -(-len(start) // _RUN)
    members = np.minimum(_RUN * np.arange(runs)[:, None] + np.arange(_RUN + 1), len(start))
    middle = polyline[members[:, _RUN // 2]]
    radius = np.hypot(*np.moveaxis(polyline[members] - middle[:, None], -1, 0)).max(1)
    segments = np.minimum(members[:, :-1], len(start) - 1)
    distance, segment, place = np.empty(len(points)), np.empty(len(points), dtype=int), np.empty(len(points))
    rows = max(1, _PAIRS // runs)
    for first in range(0, len(points), rows):
        block = slice(first, first + rows)
        some = points[block]
        gap = np.hypot(some[:, None, 0] - middle[:, 0], some[:, None, 1] - middle[:, 1])
        reach = (gap.min(1) + TIE) * (1 + 1e-9)
        point, run = np.nonzero(gap - radius * (1 + 1e-9) <= reach[:, None])
        closest = _closest(start, direction, some[point], segments[run])
        firsts = np.flatnonzero(np.diff(point, prepend=-1))
        least = np.minimum.reduceat(closest[0], firsts)
        tied = closest[0] <= least[point] + TIE
        lowest = np.minimum.reduceat(np.where(tied, closest[1], len(start)), firsts)
        chosen = np.flatnonzero(closest[1] == lowest[point])
        chosen = chosen[np.unique(point[chosen], return_index=True)[1]]
        distance[block], segment[block], place[block] = (part[chosen] for part in closest)
    return distance, segment, place


def _nearest_by_tree(polyline: Floats, points: Floats) -> tuple[Floats, Integers, Floats]:
    """Find what `nearest` finds with a tree.

    The tree holds the polyline's points, and points between them at most s apart. The nearest place is one
    of the former, or it is within s/2 of one of the latter, along its segment: so that point's distance
    is at most √(d² + s²/4). All segments with points that near are tried.
    """
    from scipy.spatial import cKDTree

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
        distance[block], segment[block], place[block] = _closest(start, direction, some, candidates)
        reach = np.hypot(distance[block] + TIE, half) * (1 + 1e-9)
        unsure = np.flatnonzero((gap[:, -1] <= reach) & (count < len(owner)))
        for i in unsure.tolist():
            near = tree.query_ball_point(some[i], reach[i])
            close = np.unique(np.concatenate([owner[near], previous[near]]))
            closest = _closest(start, direction, some[i : i + 1], close[None])
            distance[first + i], segment[first + i], place[first + i] = (part[0] for part in closest)
    return distance, segment, place


def _closest(
    start: Floats, direction: Floats, points: Floats, candidates: Integers
) -> tuple[Floats, Integers, Floats]:
    """Choose the nearest of the candidate segments (M, k) of each point; of equally near ones the first."""
    chosen = direction[candidates]
    away = points[:, None] - start[candidates]
    square = np.maximum((chosen**2).sum(-1), 1e-300)
    share = np.clip((away * chosen).sum(-1) / square, 0, 1)
    gap = np.hypot(*np.moveaxis(away - share[..., None] * chosen, -1, 0))
    tied = gap <= gap.min(1, keepdims=True) + TIE
    best = np.where(tied, candidates, len(start)).argmin(1)
    rows = np.arange(len(points))
    return gap[rows, best], candidates[rows, best], share[rows, best]


def two_sided(first: Floats, second: Floats) -> tuple[float, float]:
    """Compute the largest distance of any point of the first polyline from the second, and the reverse."""
    return float(distance_to(second, _filled(first)).max()), float(distance_to(first, _filled(second)).max())


def _filled(polyline: Floats) -> Floats:
    """Add points to a polyline, so that all steps are short compared with its length."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(polyline, axis=0).T))])
    count = max(2, min(4000, steps_of(length[-1], max(float(np.diff(length).min()), length[-1] / 4000))))
    at = np.union1d(np.linspace(0, length[-1], count), length)
    return np.stack([np.interp(at, length, polyline[:, i]) for i in (0, 1)], 1)
