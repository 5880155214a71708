"""Paths: reading, rounding corners, resampling, and the tractrix that the robot's pivot follows.

The robot's tracked point p runs ahead of its pivot q by the rod length a along the heading e(φ). When p
moves along a path, q is dragged behind it like the end of a rod (tractrix):

    δ = angle from heading to the path's tangent,   dφ/ds = sin δ / a,   dq/ds = cos δ e(φ),

so q's curvature is tan δ / a. A kink of angle α in the path jumps δ by α; rounding it by an arc lets δ
relax meanwhile. A closed path is dragged for a few laps until the motion repeats.

Lengths in tail lengths l (any one unit works). Left out: curves in SVG files.
Source: the slip-free reduction is ours; tractrix as in any text on the planar trailer.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.io.errors import InputError
from sim.io.tables import read_table

Points = NDArray[np.float64]

CORNER = math.radians(15.0)  # kinks above this are corners; below, samples of a curve
_LAPS = 6
_CIRCLE_POINTS = 720


@dataclass(frozen=True)
class Path2D:
    """A polyline (n, 2); `closed` joins its last point to the first."""

    points: Points
    closed: bool = False

    @staticmethod
    def of(points: ArrayLike, *, closed: bool | None = None) -> Path2D:
        """A path from points (n, 2); closed if it ends where it begins, unless told.

        Raises:
            InputError: empty, not a list of finite pairs, or without length.
        """
        try:
            table = np.asarray(points, dtype=float)
        except (TypeError, ValueError):
            raise InputError("the path has an entry that is no number; give pairs x, y") from None
        if table.size == 0:
            raise InputError("the path is empty; give at least two points")
        if table.ndim != 2 or table.shape[1] != 2:
            raise InputError(f"the path has shape {table.shape}; give (n, 2): one x, y a point")
        bad = np.flatnonzero(~np.isfinite(table).all(1))
        if len(bad):
            raise InputError(f"point {bad[0] + 1} of the path is {table[bad[0]].tolist()}; give finite numbers")
        moves = np.linalg.norm(np.diff(table, axis=0), axis=1)
        size = float(np.abs(table - table[0]).max())
        table = table[np.concatenate([[True], moves > 1e-12 * max(size, 1e-300)])]
        if len(table) < 2 or size == 0:
            raise InputError("all points of the path are the same; give at least two that differ")
        meets = bool(np.linalg.norm(table[0] - table[-1]) <= 1e-9 * size)
        if meets:
            table = table[:-1]
        return Path2D(table, meets if closed is None else closed)

    def scaled(self, factor: float) -> Path2D:
        return Path2D(self.points * factor, self.closed)

    def polyline(self) -> Points:
        """Points with the first repeated at the end if closed."""
        return np.concatenate([self.points, self.points[:1]]) if self.closed else self.points

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.diff(self.polyline(), axis=0), axis=1).sum())


def circle(radius: float) -> Path2D:
    """A circle about the origin, counter-clockwise from (radius, 0)."""
    angle = 2 * math.pi * np.arange(_CIRCLE_POINTS) / _CIRCLE_POINTS
    return Path2D.of(radius * np.stack([np.cos(angle), np.sin(angle)], 1), closed=True)


def polygon(corners: int, side: float) -> Path2D:
    """A regular polygon, counter-clockwise; it starts in the middle of its lower side."""
    reach = side / 2 / math.sin(math.pi / corners)
    angle = 2 * math.pi * (np.arange(corners) + 0.5) / corners - math.pi / 2
    ring = reach * np.stack([np.cos(angle), np.sin(angle)], 1)
    middle = (ring[0] + ring[-1]) / 2
    return Path2D.of(np.concatenate([[middle], ring]), closed=True)


def read_path(source: str | Path, *, closed: bool | None = None) -> Path2D:
    """A path from a CSV with columns x, y or an SVG file (path without curves, polyline, polygon, circle).

    Raises:
        InputError: the file holds no path that can be read.
    """
    if Path(source).suffix.lower() == ".svg":
        return _read_svg(Path(source), closed)
    table = read_table(source)
    if "x" not in table or "y" not in table:
        raise InputError(f"{source} has columns {', '.join(map(str, table))}; give x and y")
    return Path2D.of(table[["x", "y"]].to_numpy(), closed=closed)


def _read_svg(path: Path, closed: bool | None) -> Path2D:
    """The first shape of an SVG file; SVG's y points down and is turned up."""
    try:
        root = ElementTree.fromstring(path.read_text())
    except (ElementTree.ParseError, UnicodeDecodeError) as broken:
        raise InputError(f"{path} is not SVG: {broken}") from None
    for element in root.iter():
        tag = element.tag.rsplit("}", 1)[-1]
        if tag in ("polyline", "polygon"):
            numbers = [float(v) for v in re.findall(_NUMBER, element.get("points", ""))]
            points = np.array(numbers[: len(numbers) // 2 * 2]).reshape(-1, 2)
            loop = True if tag == "polygon" and closed is None else closed
            return Path2D.of(points * [1, -1], closed=loop)
        if tag == "circle":
            ring = circle(float(element.get("r", "0")))
            centre = np.array([float(element.get("cx", "0")), -float(element.get("cy", "0"))])
            return Path2D.of(ring.points + centre, closed=True)
        if tag == "path":
            corners, ends = _svg_commands(path, element.get("d", ""))
            return Path2D.of(np.array(corners) * [1, -1] if corners else [], closed=ends or closed)
    raise InputError(f"{path} has no path, polyline, polygon or circle; draw one")


_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


def _svg_commands(path: Path, text: str) -> tuple[list[list[float]], bool]:
    points: list[list[float]] = []
    at = [0.0, 0.0]
    for command, body in re.findall(r"([A-Za-z])([^A-Za-df-z]*)", text):
        numbers = [float(v) for v in re.findall(_NUMBER, body)]
        kind = command.upper()
        if kind == "Z":
            return points, True
        if kind not in "MLHV":
            raise InputError(
                f"{path}: path command {command!r} is not read (M, L, H, V, Z are); "
                "flatten curves to lines in the drawing program"
            )
        origin = [0.0, 0.0] if command.isupper() else None
        pairs = (
            [[v, None] for v in numbers] if kind == "H"
            else [[None, v] for v in numbers] if kind == "V"
            else [numbers[i : i + 2] for i in range(0, len(numbers) - 1, 2)]
        )  # fmt: skip
        for pair in pairs:
            base = origin or at
            at = [at[i] if pair[i] is None else base[i] + pair[i] for i in (0, 1)]  # type: ignore[operator]
            points.append(at)
    return points, False


def resample(polyline: Points, spacing: float) -> Points:
    """Points at equal arc length, at most `spacing` apart, ends kept."""
    lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(polyline, axis=0), axis=1))])
    count = max(2, math.ceil(lengths[-1] / spacing) + 1)
    at = np.linspace(0, lengths[-1], count)
    return np.stack([np.interp(at, lengths, polyline[:, i]) for i in (0, 1)], 1)


def kinks(path: Path2D) -> NDArray[np.float64]:
    """Signed turning angle [rad] at every point; zero at the ends of an open path."""
    edges = np.diff(path.polyline(), axis=0)
    direction = np.arctan2(edges[:, 1], edges[:, 0])
    if path.closed:
        turn = direction - np.roll(direction, 1)
    else:
        turn = np.concatenate([[0.0], np.diff(direction), [0.0]])
    return np.asarray((turn + math.pi) % (2 * math.pi) - math.pi)


def largest_fillet(path: Path2D) -> float:
    """The largest radius that fits all corners; infinite without corners."""
    angle = np.abs(kinks(path))
    reach = np.where(angle > CORNER, np.tan(angle / 2), 0.0)
    edges = np.linalg.norm(np.diff(path.polyline(), axis=0), axis=1)
    both = reach[: len(edges)] + np.roll(reach, -1)[: len(edges)]
    fits = edges[both > 0] / both[both > 0]
    return float(fits.min()) if len(fits) else math.inf


def fillet(path: Path2D, radius: float) -> Path2D:
    """Corners replaced by arcs of `radius`, tangent to the edges; at most `largest_fillet`."""
    angle = kinks(path)
    corner = np.abs(angle) > CORNER
    if radius == 0 or not corner.any():
        return path
    points = path.points
    count = len(points)
    reach = np.where(corner, radius * np.tan(np.abs(angle) / 2), 0.0)
    edges = np.diff(path.polyline(), axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    rounded: list[Points] = []
    for i in range(count):
        if not corner[i]:
            rounded.append(points[i : i + 1])
            continue
        into = edges[i - 1] / lengths[i - 1]
        start = points[i] - reach[i] * into
        left = math.copysign(1.0, angle[i]) * np.array([-into[1], into[0]])
        centre = start + radius * left
        steps = np.linspace(0, angle[i], max(8, math.ceil(abs(angle[i]) / math.radians(2))))
        spoke = start - centre
        c, s = np.cos(steps), np.sin(steps)
        rounded.append(centre + np.stack([c * spoke[0] - s * spoke[1], s * spoke[0] + c * spoke[1]], 1))
    return Path2D(np.concatenate(rounded), path.closed)


@dataclass(frozen=True)
class Reference:
    """What must be followed: p (the declared path), and where the pivot and the heading are meanwhile."""

    p: Points  # (m, 2), closed paths end where they begin
    q: Points  # (m, 2)
    heading: NDArray[np.float64]  # (m,), unwrapped [rad]
    arc: NDArray[np.float64]  # (m,), arc length of q
    closed: bool

    @property
    def curvature(self) -> NDArray[np.float64]:
        """Curvature of q at the middle of its steps, (m − 1,)."""
        step = np.maximum(np.diff(self.arc), 1e-9)
        return np.diff(self.heading) / step


def reference(path: Path2D, rod: float, spacing: float) -> Reference:
    """Tractrix of a path with rod length `rod` (0: the pivot itself is tracked)."""
    p = resample(path.polyline(), spacing)
    moves = np.diff(p, axis=0)
    tangent = np.unwrap(np.arctan2(moves[:, 1], moves[:, 0]))
    length = np.linalg.norm(moves, axis=1)
    if rod <= 0:
        wrap = tangent[-1:] if not path.closed else tangent[:1] + _turning(tangent)
        before = tangent[:1] if not path.closed else tangent[-1:] - _turning(tangent)
        ends = np.concatenate([before, tangent, wrap])
        heading = (ends[1:] + ends[:-1]) / 2
    else:
        start = tangent[0]
        for _ in range(_LAPS if path.closed else 1):
            heading = _drag(tangent, length, rod, start)
            start = heading[-1] - _turning(tangent) if path.closed else start
    q = p - rod * np.stack([np.cos(heading), np.sin(heading)], 1)
    arc = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    return Reference(p, q, heading, arc, path.closed)


def _turning(tangent: NDArray[np.float64]) -> float:
    """Total turn of a closed path: a multiple of 2π."""
    closing = (tangent[0] - tangent[-1] + math.pi) % (2 * math.pi) - math.pi
    return float(tangent[-1] - tangent[0] + closing)


def _drag(
    tangent: NDArray[np.float64], length: NDArray[np.float64], rod: float, start: float
) -> NDArray[np.float64]:
    """Heading along straight steps: exact, tan(δ/2) decays as exp(−s/a)."""
    heading = np.empty(len(tangent) + 1)
    heading[0] = start
    decay = np.exp(-length / rod)
    for i, (direction, factor) in enumerate(zip(tangent.tolist(), decay.tolist(), strict=True)):
        gap = direction - heading[i]
        gap = (gap + math.pi) % (2 * math.pi) - math.pi
        heading[i + 1] = heading[i] + gap - 2 * math.atan(math.tan(gap / 2) * factor)
    return heading
