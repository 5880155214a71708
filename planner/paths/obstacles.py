"""Obstacles (circles, polygons and the tank's walls), and the clearance of the robot's body from them.

The body of the robot is a row of discs along its axis: head and straight tails. Its clearance is the smallest
distance of any disc from any region, negative inside. Lengths in l.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from common.arrays import Floats, Integers
from common.errors import InputError
from planner.paths.path import Path2D, axis_at
from planner.paths.units import Scales

_SIDES = 180  # of a circle as a polygon
_TILE = 128  # points of a map, in each direction, that are computed at once
_BLOCK = 2_000_000  # distances computed at once


@dataclass(frozen=True)
class Circle:
    """A round region: its centre and its radius, in l.

    Example:
        >>> import numpy as np
        >>> from softflagella import Circle
        >>> Circle(1.0, 0.0, 0.5).distance(np.array([[0.0, 0.0]])).tolist()
        [0.5]
    """

    x: float  # of the centre [l]
    y: float  # of the centre [l]
    radius: float  # [l]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.x) and math.isfinite(self.y) and 0 < self.radius < math.inf):
            raise InputError(
                f"circle {self.x:g}, {self.y:g}, {self.radius:g}; give a finite centre and a radius above 0"
            )

    def distance(self, points: Floats) -> Floats:
        """Compute the distance (M,) of points (M, 2), negative inside."""
        return np.asarray(np.hypot(points[:, 0] - self.x, points[:, 1] - self.y) - self.radius)

    @property
    def corners(self) -> Floats:
        """Corners (n, 2) of a polygon with many sides, for pictures and lanes."""
        angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
        return np.array([self.x, self.y]) + self.radius * axis_at(angle)

    @property
    def box(self) -> Floats:
        """Corners (2, 2): lowest and highest x, y."""
        centre = np.array([self.x, self.y])
        return np.stack([centre - self.radius, centre + self.radius])


@dataclass(frozen=True)
class Polygon:
    """A region with straight edges, (n, 2) corners in order."""

    corners: Floats  # (n, 2), in order [l]

    @staticmethod
    def of(points: Path2D | ArrayLike, size: float = 1.0, unit: str = "l") -> Polygon:
        """Make a polygon from points (n, 2): three or more that are not on one line.

        Args:
            points: in l.
            size: of l in the unit that a message has.
            unit: its name.

        Raises:
            InputError: the points enclose nothing, or the outline crosses, touches or repeats itself.
        """
        from shapely import MultiPoint
        from shapely import Polygon as Outline
        from shapely.validation import explain_validity

        path = points if isinstance(points, Path2D) else Path2D.of(points)
        if MultiPoint(path.points).convex_hull.area <= 1e-12 * path.length**2:
            raise InputError("a region needs three or more points that are not on one line")
        reason, _, place = explain_validity(Outline(path.points)).partition("[")
        if place:
            x, y = (format(size * float(number), ".4g") for number in place.rstrip("]").split()[:2])
            words = "draw it so that it neither crosses, touches nor repeats itself"
            raise InputError(f"{reason} of an outline at ({x}, {y}) {unit}; {words}")
        return Polygon(path.points)

    def distance(self, points: Floats) -> Floats:
        """Compute the distance (M,) of points (M, 2) from the edges, negative inside."""
        block = max(1, _BLOCK // len(self.corners))
        parts = [self._distance(points[i : i + block]) for i in range(0, len(points), block)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def _distance(self, points: Floats) -> Floats:
        start, end = self.corners, np.roll(self.corners, -1, 0)
        edge = end - start
        dx, dy = points[:, 0, None] - start[:, 0], points[:, 1, None] - start[:, 1]
        share = np.clip((dx * edge[:, 0] + dy * edge[:, 1]) / (edge**2).sum(1), 0, 1)
        square = (dx - share * edge[:, 0]) ** 2 + (dy - share * edge[:, 1]) ** 2
        y = points[:, 1, None]
        crosses = (start[:, 1] <= y) != (end[:, 1] <= y)
        rise = np.where(edge[:, 1] == 0, 1.0, edge[:, 1])
        inside = (crosses & (dx < dy * edge[:, 0] / rise)).sum(1) % 2 == 1
        return np.where(inside, -1.0, 1.0) * np.sqrt(square.min(1))

    @property
    def box(self) -> Floats:
        """Corners (2, 2): lowest and highest x, y."""
        return np.stack([self.corners.min(0), self.corners.max(0)])


Region = Circle | Polygon


@dataclass(frozen=True)
class FreeSpace:
    """Free space: inside the walls, outside all regions."""

    regions: tuple[Region, ...] = ()  # that the body must not touch
    walls: Polygon | None = None  # that it must stay within; None: there are none

    @staticmethod
    def from_dict(content: Mapping[str, Any]) -> FreeSpace:
        """Read the content that `to_dict` returns.

        Raises:
            InputError: a region is none.
            KeyError, TypeError, ValueError: the content is another one.
        """
        regions = [
            Circle(*map(float, region["circle"])) if "circle" in region else Polygon.of(region["polygon"])
            for region in content["keep_out"]
        ]
        return FreeSpace(tuple(regions), None if content["walls"] is None else Polygon.of(content["walls"]))

    @property
    def empty(self) -> bool:
        return not self.regions and self.walls is None

    def distance(self, points: Floats) -> Floats:
        """Compute the distance (M,) of points (M, 2) from the nearest region or wall, negative inside."""
        distances = np.full(len(points), np.inf)
        for region in self.near(points).regions if len(points) > 1 else self.regions:
            distances = np.minimum(distances, region.distance(points))
        if self.walls is not None:
            distances = np.minimum(distances, -self.walls.distance(points))
        return distances

    def near(self, points: Floats) -> FreeSpace:
        """Leave out the regions that are nearest to none of the points (M, 2)."""
        middle = points.mean(0, keepdims=True)
        apart = np.array([region.distance(middle)[0] for region in self.regions])
        most = apart.min(initial=np.inf) + 2.001 * float(np.hypot(*(points - middle).T).max())
        return FreeSpace(tuple(r for r, away in zip(self.regions, apart, strict=True) if away <= most), self.walls)

    def boxes(self) -> list[Floats]:
        """List the corners (2, 2) of the boxes around the regions and walls."""
        return [region.box for region in (*self.regions, *([self.walls] if self.walls else []))]

    def to_dict(self) -> dict[str, Any]:
        """Return the content for a JSON file: `keep_out` and `walls`, in l."""
        return {
            "keep_out": [
                {"circle": [region.x, region.y, region.radius]}
                if isinstance(region, Circle)
                else {"polygon": region.corners.tolist()}
                for region in self.regions
            ],
            "walls": None if self.walls is None else self.walls.corners.tolist(),
        }


@dataclass(frozen=True)
class Footprint:
    """Discs along the robot's axis."""

    places: Floats  # (K,), of their centres, forward from a point of the axis
    radius: float  # of all

    @staticmethod
    def of(swimmer: Scales, origin: float) -> Footprint:
        """Cover the body; `origin` is the distance from its pose's point forward to the point of the axis."""
        front, back, width = swimmer.outline
        count = max(2, math.ceil((front - back) / width))
        step = (front - back) / count
        places = np.asarray(back + step * (np.arange(count) + 0.5) - origin, dtype=np.float64)
        return Footprint(places, math.hypot(width, step / 2))

    @property
    def reach(self) -> float:
        """Largest distance of a point of the body from its origin."""
        return float(np.abs(self.places).max()) + self.radius

    def centres(self, poses: Floats) -> Floats:
        """Compute the centres (..., K, 2) of the discs at poses (..., 3): origin and heading."""
        axis = axis_at(poses[..., 2])
        return np.asarray(poses[..., None, :2] + self.places[:, None] * axis[..., None, :])

    def clearance(self, poses: Floats, space: FreeSpace | Map) -> Floats:
        """Compute the distance (...) between the body at poses (..., 3) and what is not free."""
        centres = self.centres(poses)
        distances = space.distance(centres.reshape(-1, 2)).reshape(centres.shape[:-1])
        return np.asarray(distances.min(-1) - self.radius)


class Map:
    """Distances from regions and walls on a grid, never larger than the true ones: fast for many points."""

    def __init__(self, space: FreeSpace, low: Floats, high: Floats, step: float):
        size = high - low
        self._low, self.step = low, step
        count = np.ceil(size / step).astype(int) + 1
        x, y = (low[i] + step * np.arange(count[i]) for i in (0, 1))
        self.table = np.empty((len(x), len(y)))
        for i, j in product(range(0, len(x), _TILE), range(0, len(y), _TILE)):
            tile = self.table[i : i + _TILE, j : j + _TILE]
            points = np.stack(np.meshgrid(x[i : i + _TILE], y[j : j + _TILE], indexing="ij"), -1).reshape(-1, 2)
            tile[:] = space.distance(points).reshape(tile.shape)
        self.slack = step / math.sqrt(2)  # distances change by at most the way to the nearest grid point

    def distance(self, points: Floats) -> Floats:
        """Bound the distance of points (M, 2) from below, (M,); outside the map nothing is free."""
        index = np.rint((points - self._low) / self.step).astype(int)
        last: Integers = np.array([len(self.table) - 1, len(self.table.T) - 1])
        inside = ((index >= 0) & (index <= last)).all(1)
        i, j = np.clip(index, 0, last).T
        return np.where(inside, self.table[i, j] - self.slack, -np.inf)
