"""Regions to be covered: outlines with holes, lanes across them, and the share of them that a track covers.

Lengths in l.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.paths.distance import distance_to
from planner.paths.obstacles import Circle, Polygon, Region
from sim.arrays import Flags, Floats
from sim.io.errors import InputError

_ACROSS = 7  # places across a lane where the region is sampled
_CELLS = 400  # of the raster, along the longer side


@dataclass(frozen=True)
class Field:
    """A region with holes."""

    outline: Region  # what is to be covered
    holes: tuple[Region, ...] = ()  # but for these

    def contains(self, points: Floats) -> Flags:
        """Tell which points (M, 2) are to be covered."""
        inside = self.outline.distance(points) <= 0
        for hole in self.holes:
            inside &= hole.distance(points) > 0
        return np.asarray(inside)

    def raster(self, cell: float) -> tuple[Floats, float]:
        """Return points (M, 2) of a square raster that are to be covered, and the area of a cell."""
        low, high = self.outline.box
        cell = max(min(cell, float((high - low).max()) / 50), float((high - low).max()) / _CELLS)
        x, y = (np.arange(low[i] + cell / 2, high[i], cell) for i in (0, 1))
        points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
        points = points[self.contains(points)]
        if not len(points):
            raise InputError("the region is empty: its holes cover it")
        return points, cell**2


def across(field: Field, angle: float) -> float:
    """Compute the extent of a region across a direction."""
    return float(np.ptp(corners(field.outline) @ np.array([-np.sin(angle), np.cos(angle)])))


def lanes(field: Field, width: float, angle: float, *, apart: float) -> Floats:
    """Cut a region into lanes (k, 2, 2): start and end of the middle of each.

    Args:
        field: the region.
        width: of the swath around a lane.
        angle: direction of the lanes.
        apart: shorter gaps within a lane are crossed.
    """
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])  # to the frame of the lanes
    outline = corners(field.outline) @ turn.T
    low, high = outline.min(0), outline.max(0)
    count = max(1, int(np.ceil((high[1] - low[1]) / width)))
    spacing = (high[1] - low[1]) / count
    step = min(width, high[0] - low[0]) / 10
    x = np.arange(low[0], high[0] + step, step)
    found = []
    for k in range(count):
        middle = low[1] + (k + 0.5) * spacing
        y = middle + spacing * (np.arange(_ACROSS) / (_ACROSS - 1) - 0.5) * 0.999
        points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2) @ turn
        wanted = field.contains(points).reshape(len(x), _ACROSS).any(1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], wanted, [False]]).astype(int)))
        runs: list[list[float]] = []
        for first, last in zip(x[edges[::2]].tolist(), x[edges[1::2] - 1].tolist(), strict=True):
            if runs and first - runs[-1][1] < apart:
                runs[-1][1] = last
            else:
                runs.append([first, last])
        found += [[[first, middle], [max(last, first + step), middle]] for first, last in runs]
    return np.array(found).reshape(-1, 2, 2) @ turn


def share_covered(field: Field, track: Floats, width: float) -> float:
    """Compute the share of a region's area within half a width of a track (S, 2)."""
    points, _ = field.raster(width / 20)
    return float((distance_to(track, points) <= width / 2).mean())


def corners(region: Region) -> Floats:
    """Return the corners (n, 2) of a region; those of a polygon of many sides for a circle."""
    if isinstance(region, Polygon):
        return region.corners
    assert isinstance(region, Circle)
    angle = 2 * np.pi * np.arange(180) / 180
    return np.array([region.x, region.y]) + region.radius * np.stack([np.cos(angle), np.sin(angle)], 1)
