"""Paths in the plane: polylines, circles, polygons, points at equal distances, and shapes that are given in words.

Lengths are in tail lengths l, but any unit works. Words for a shape are circle:RADIUS, square:SIDE, triangle:SIDE
or polygon:CORNERS:SIDE, with the unit of the size: square:24cm.
"""

from __future__ import annotations

import difflib
import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from common.arrays import Flags, Floats
from common.errors import InputError
from common.keywords import checks_keywords
from common.units import number_and_unit

_CIRCLE_POINTS = 720
_LARGEST = 1e100  # coordinate: squares of larger ones overflow
_MOST_SMOOTHED = 200_000
_EVEN = 1e-9  # of a step, that rounding may add to a length
SHAPES = "circle:RADIUS, square:SIDE, triangle:SIDE, polygon:CORNERS:SIDE"
_MOST_CORNERS = 1000
_CORNERS = {"triangle": 3, "square": 4}
_ALIKE = 0.75  # least likeness of a misspelt name, see `difflib`
_LIKE_A_SHAPE = re.compile(r"[A-Za-z]+(:[^/\\]*)?")


@dataclass(frozen=True)
class Path2D:
    """A polyline (n, 2); `closed` joins its last point to the first. Any unit of length.

    Example:
        >>> from softflagella import Path2D
        >>> Path2D.of([[0, 0], [3, 0], [3, 4]]).length
        7.0
    """

    points: Floats  # (n, 2)
    closed: bool = False  # the last point is joined to the first

    @staticmethod
    def of(points: ArrayLike, *, closed: bool | None = None) -> Path2D:
        """Make a path from points (n, 2). By default it is closed if it ends where it begins.

        Raises:
            InputError: the points are none, no finite pairs, or all the same.
        """
        try:
            table = np.asarray(points, dtype=float)
        except (TypeError, ValueError):
            raise InputError("the path has an entry that is no number; give pairs x, y") from None
        if table.size == 0:
            raise InputError("the path is empty; give at least two points")
        if table.ndim != 2 or table.shape[1] != 2:
            raise InputError(f"the path has shape {table.shape}; give (n, 2): x and y of each point")
        bad = np.flatnonzero(~(np.abs(table) < _LARGEST).all(1))
        if len(bad):
            point = table[bad[0]].tolist()
            raise InputError(
                f"point {bad[0] + 1} of the path is {point}; give finite numbers, smaller than {_LARGEST:g}"
            )
        moves = np.linalg.norm(np.diff(table, axis=0), axis=1)
        size = float(np.abs(table - table[0]).max())
        table = table[np.concatenate([[True], moves > 1e-12 * max(size, 1e-300)])]
        if len(table) < 2 or size == 0:
            raise InputError("all points of the path are the same; give at least two that differ")
        meets = bool(np.linalg.norm(table[0] - table[-1]) <= 1e-9 * size)
        if meets:
            table = table[:-1]
        return Path2D(table, meets if closed is None else closed)

    @property
    def looks_closed(self) -> bool:
        """Whether it is open, and ends about as near to its start as its points are to each other."""
        steps, gap = np.linalg.norm(np.diff(self.points, axis=0), axis=1), self.points[-1] - self.points[0]
        return not self.closed and len(steps) > 2 and bool(np.linalg.norm(gap) <= 1.5 * np.median(steps))

    def scaled(self, factor: float) -> Path2D:
        """Multiply the coordinates."""
        return Path2D(self.points * factor, self.closed)

    def polyline(self) -> Floats:
        """Return the points; those of a closed path with the first one repeated at the end."""
        return np.concatenate([self.points, self.points[:1]]) if self.closed else self.points

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.diff(self.polyline(), axis=0), axis=1).sum())


@checks_keywords
def circle(radius: float) -> Path2D:
    """Make a circle about the origin, counter-clockwise from (radius, 0).

    Example:
        >>> from softflagella import circle
        >>> round(circle(2.0).length, 2)
        12.57
    """
    angle = 2 * math.pi * np.arange(_CIRCLE_POINTS) / _CIRCLE_POINTS
    return Path2D.of(radius * axis_at(angle), closed=True)


@checks_keywords
def polygon(corners: int, side: float) -> Path2D:
    """Make a regular polygon about the origin, counter-clockwise; it starts in the middle of its lower side.

    Args:
        corners: their number, 3 or more.
        side: length of a side.

    Example:
        >>> from softflagella import polygon
        >>> polygon(4, side=2.0).points.round(9).tolist()
        [[0.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]
    """
    reach = side / 2 / math.sin(math.pi / corners)
    angle = 2 * math.pi * (np.arange(corners) + 0.5) / corners - math.pi / 2
    ring = reach * axis_at(angle)
    middle = (ring[0] + ring[-1]) / 2
    return Path2D.of(np.concatenate([[middle], ring]), closed=True)


def axis_at(heading: Floats) -> Floats:
    """Return unit vectors (..., 2) along headings (...) [rad]."""
    return np.stack([np.cos(heading), np.sin(heading)], -1)


def arc_length(polyline: Floats) -> Floats:
    """Compute the length (m,) of a polyline (m, 2) from its start to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(polyline, axis=0), axis=1))])


def points_at(at: Floats, known: Floats, points: Floats) -> Floats:
    """Interpolate points (m, c), known at increasing lengths (m,), at others (K,), (K, c)."""
    return np.stack([np.interp(at, known, column) for column in points.T], -1)


def runs_of(flags: Flags, arc: Floats, apart: float) -> list[tuple[int, int]]:
    """List first and last index of each run of true flags; those less than `apart` along the arc are one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    runs: list[tuple[int, int]] = []
    for first, last in zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True):
        if runs and arc[first] - arc[runs[-1][1]] < apart:
            runs[-1] = (runs[-1][0], last)
        else:
            runs.append((first, last))
    return runs


def resample(polyline: Floats, spacing: float) -> Floats:
    """Place points at equal arc length, at most `spacing` apart; the ends are kept."""
    lengths = arc_length(polyline)
    count = max(2, steps_of(lengths[-1], spacing) + 1)
    at = np.linspace(0, lengths[-1], count)
    return points_at(at, lengths, polyline)


def steps_of(length: float, most: float) -> int:
    """Return the number of equal steps of a length, at most `most` each, whatever the last bits of both are."""
    return math.ceil(length / most - _EVEN)


def smoothed(path: Path2D, length: float) -> tuple[Path2D, float]:
    """Smooth a path over a length, and return how far that moves it.

    Each point becomes a Gaussian mean over its neighbours, with a standard deviation of half the length along the
    path. This removes the noise of a camera and rounds corners. The ends of an open path stay.

    Raises:
        InputError: the length is no number above 0, or as long as the path.
    """
    if not 0 < length < path.length / 2:
        raise InputError(f"smoothing over {length:g} l; give a length above 0 and below half the path's")
    spacing = max(length / 20, path.length / _MOST_SMOOTHED)
    points = resample(path.polyline(), spacing)
    spacing = path.length / (len(points) - 1)
    sigma = length / 2 / spacing
    reach = math.ceil(4 * sigma)
    if path.closed:
        ring = points[:-1]
        around = np.take(ring, np.arange(-reach, len(ring) + reach), axis=0, mode="wrap")
    else:  # turned about the ends, which therefore stay
        inside = np.minimum(np.arange(1, reach + 1), len(points) - 1)
        around = np.concatenate(
            [2 * points[0] - points[inside][::-1], points, 2 * points[-1] - points[-1 - inside]]
        )
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    mean = np.stack([np.convolve(around[:, i], kernel, mode="valid") for i in (0, 1)], 1)
    moved = float(np.hypot(*(mean - points[: len(mean)]).T).max())
    return Path2D.of(mean, closed=path.closed), moved


def shape_of(words: str) -> tuple[Path2D, str | None] | None:
    """Make the shape that is given in words, and return it with its unit; None: the words name no shape.

    Raises:
        InputError: a size or a number of corners is missing, or is no number that makes sense.
    """
    name, *sizes = words.split(":")
    if not sizes or name not in ("circle", "polygon", *_CORNERS):
        return None
    size, unit = number_and_unit(sizes[-1])
    if len(sizes) != (2 if name == "polygon" else 1) or math.isnan(size):
        raise InputError(f"{words!r}; write for example circle:20cm, square:3l or polygon:6:2l")
    if not 0 < size < math.inf:
        raise InputError(f"{words!r}; its size must be above 0")
    if name == "circle":
        return circle(size), unit
    corners = sizes[0].strip() if name == "polygon" else _CORNERS[name]
    if not re.fullmatch("[0-9]{1,4}", str(corners)) or not 3 <= int(corners) <= _MOST_CORNERS:
        raise InputError(f"{words!r}; give 3 to {_MOST_CORNERS} corners, as in polygon:6:2l")
    return polygon(int(corners), size), unit


def like_a_shape(words: str) -> bool:
    """Tell whether words look like a shape, known or not: hexagon:3, or circle without a size."""
    return _LIKE_A_SHAPE.fullmatch(words) is not None


def nearest_shape(words: str) -> str:
    """Correct the name of a misspelt shape: square:3l for squre:3l; empty where no shape has such a name."""
    name, colon, sizes = words.partition(":")
    names = {shape.partition(":")[0]: shape for shape in SHAPES.split(", ")}
    near = difflib.get_close_matches(name.lower(), names, 1, _ALIKE)
    if not near or near[0] == name:
        return ""
    return f"{near[0]}:{sizes}" if colon else names[near[0]]
