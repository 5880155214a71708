"""Paths from files: CSV tables and SVG drawings.

SVG is read by svgelements, with transforms, viewBox, curves, basic shapes and <use>; <defs> is ignored. In SVG y
points down; here it points up. Every shape, and every subpath of a shape, is a separate path. A file with several
paths is rejected unless one is chosen by name. Curves become polylines.
"""

from __future__ import annotations

import io
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

import numpy as np

from planner.paths.path import Path2D
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.tables import read_table

METRES_PER_PIXEL = 0.0254 / 96  # of SVG
_PHYSICAL = re.compile(r"\s*[0-9.eE+-]+\s*(mm|cm|in|pt|pc)\s*$")
_TURN = math.radians(2.0)  # largest turn of a curve between two points
_PROBES = 64  # places on a curve where its direction is measured


@dataclass(frozen=True)
class Drawing:
    """A path, and the size of its unit in metres if the file has physical units."""

    path: Path2D
    unit: float | None


def read_path(source: str | Path, *, closed: bool | None = None, shape: str | None = None) -> Drawing:
    """Read a path from a table with columns x, y, or from an SVG file.

    Args:
        source: the file.
        closed: join the end to the start; by default as in the file.
        shape: name of the path, for an SVG with several; without it the error message lists the names.

    Raises:
        InputError: the file has no path, or several and none is chosen.

    Example:
        >>> import tempfile
        >>> from softflagella import read_path
        >>> with tempfile.NamedTemporaryFile("w", suffix=".svg") as file:
        ...     _ = file.write('<svg><path d="M 0 0 h 3 v -4" transform="scale(2)"/></svg>')
        ...     file.flush()
        ...     read_path(file.name).path.points.tolist()
        [[0.0, 0.0], [6.0, 0.0], [6.0, 8.0]]
    """
    if Path(source).suffix.lower() == ".svg":
        return _read_svg(Path(source), closed, shape)
    if shape is not None:
        raise InputError(f"{source} is no SVG, so it has no shape {shape!r}; leave --shape out")
    return Drawing(Path2D.of(_read_columns(Path(source)), closed=closed), None)


def _read_columns(path: Path) -> Any:
    """Read columns x and y (n, 2), split at commas, semicolons, tabs or spaces; without a header the first two."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError):
        lines = []
    first = next((line for line in lines if line.strip()), "")
    mark = next((mark for mark in ";\t," if mark in first), None)
    names = [word.strip().strip('"').lower() for word in first.split(mark)]
    if not first:
        read_table(path)  # says what is wrong with the file
    rows = [line.split(mark) for line in lines if line.strip()]
    header = not all(map(_is_number, names))
    if header and not {"x", "y"} <= set(names):
        raise InputError(f"{path} has columns {', '.join(names)}; give x and y")
    places = (names.index("x"), names.index("y")) if header else (0, 1)
    rows = rows[1:] if header else rows
    if not rows:
        raise InputError(f"{path} has no rows; give at least two points")
    decimal = mark == ";" and not any("." in word for row in rows for word in row)
    try:
        return [[float(row[i].strip().replace(",", ".") if decimal else row[i]) for i in places] for row in rows]
    except (ValueError, IndexError):
        raise InputError(f"{path} has a row whose x or y is no number; correct the file") from None


def _is_number(word: str) -> bool:
    try:
        float(word.replace(",", "."))
    except ValueError:
        return False
    return True


# Raised by svgelements for invalid drawings: a transform without numbers, a path that begins with a curve
_BROKEN = (
    ParseError, AttributeError, TypeError, UnicodeDecodeError, ValueError, ArithmeticError, LookupError,
)  # fmt: skip


def _read_svg(path: Path, closed: bool | None, shape: str | None) -> Drawing:
    from svgelements import SVG

    try:
        text = path.read_text()
        drawing = SVG.parse(io.StringIO(text), reify=True)
        elements = list(drawing.elements())
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; give a CSV or SVG file") from None
    except _BROKEN as broken:
        reason = next(iter(str(broken).splitlines()), type(broken).__name__)
        raise InputError(f"{path} is not SVG: {reason}") from None
    subpaths = _subpaths(elements)
    if not subpaths:
        raise InputError(f"{path} has no path, line, polyline, polygon, rectangle, circle or ellipse; draw one")
    if shape is None and len(subpaths) > 1:
        names = ", ".join(subpaths)
        raise InputError(
            f"{path} has {len(subpaths)} paths ({names}); choose one with --shape, or remove the others"
        )
    name = next(iter(subpaths)) if shape is None else shape
    if name not in subpaths:
        raise InputError(f"{path} has no shape {name!r}; there are {', '.join(subpaths)}")
    points, ends = subpaths[name]
    physical = bool(_PHYSICAL.match(str(drawing.values.get("width", ""))))
    unit = METRES_PER_PIXEL if physical else None
    upright = points * [1.0, -1.0] + 0.0  # no negative zeros
    return Drawing(Path2D.of(upright, closed=ends or closed), unit)


def _subpaths(elements: list[Any]) -> dict[str, tuple[Floats, bool]]:
    """Find the points (n, 2) of every subpath by name, and whether it is closed."""
    from svgelements import Path as SvgPath
    from svgelements import Shape

    subpaths: dict[str, tuple[Floats, bool]] = {}
    counts: dict[str, int] = {}
    for element in elements:
        if not isinstance(element, Shape):
            continue
        kind = str(element.values.get("tag", type(element).__name__)).lower()
        counts[kind] = counts.get(kind, 0) + 1
        name = str(element.id) if element.id else f"{kind}{counts[kind]}"
        parts = [_points(SvgPath(part)) for part in SvgPath(element).as_subpaths()]
        parts = [part for part in parts if len(part[0]) > 1]
        for i, part in enumerate(parts):
            part_name = name if len(parts) == 1 else f"{name}/{i + 1}"
            subpaths[part_name if part_name not in subpaths else f"{part_name}-{kind}{counts[kind]}"] = part
    return subpaths


def _points(subpath: Any) -> tuple[Floats, bool]:
    """Sample the points of one subpath, curves as polylines, and tell whether it is closed."""
    from svgelements import Close, Line, Move

    points: list[tuple[float, float]] = []
    closed = False
    for segment in subpath:
        closed |= isinstance(segment, Close)
        if isinstance(segment, Move):
            points = [(segment.end.x, segment.end.y)]
        elif isinstance(segment, Line | Close):
            if segment.end is not None:
                points.append((segment.end.x, segment.end.y))
        else:
            places = np.linspace(0, 1, _enough(segment) + 1)[1:]
            points += [(segment.point(t).x, segment.point(t).y) for t in places.tolist()]
    return np.array(points, dtype=float).reshape(-1, 2), closed


def _enough(curve: Any) -> int:
    """Return the number of segments of a curve such that none turns by more than _TURN."""
    probes = np.array([[p.x, p.y] for p in (curve.point(t) for t in np.linspace(0, 1, _PROBES + 1).tolist())])
    moves = np.diff(probes, axis=0)
    moves = moves[np.hypot(moves[:, 0], moves[:, 1]) > 0]
    turns = np.diff(np.unwrap(np.arctan2(moves[:, 1], moves[:, 0])))
    return max(_PROBES, math.ceil(_PROBES * float(np.abs(turns).max(initial=0.0)) / _TURN))
