"""Paths from SVG drawings.

In SVG y points down; here it points up. Every shape that is seen (`planner.paths.svg_tree`), and every subpath of
a shape, is a separate path. A file with several paths is rejected unless one is chosen by name. Curves become
polylines.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from planner.paths.path import Path2D, steps_of
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.reading import read_bytes

if TYPE_CHECKING:  # svgelements is loaded where a drawing is read
    from planner.paths.svg_tree import Shape

METRES_PER_PIXEL = 0.0254 / 96  # of SVG
_TURN = math.radians(2.0)  # largest turn of a curve between two points
_PROBES = 64  # places on a curve where its direction is measured
_MOST_POINTS = 200_000

_BROKEN = (ElementTree.ParseError, ValueError, ArithmeticError, LookupError)  # XML or its encoding; no <svg>


def read_svg(path: Path, closed: bool | None, shape: str | None) -> tuple[Path2D, float | None]:
    """Read one path of a drawing, and the size of its unit in metres if the drawing has physical units.

    Raises:
        InputError: the file has no path, or several and none is chosen, or is larger than a drawing may be.
    """
    from planner.paths.svg_tree import Drawing

    data = read_bytes(path)
    if b"<?xml-stylesheet" in data:
        raise InputError(f"{path}: <?xml-stylesheet> is not read; save the drawing with its style")
    try:
        with np.errstate(all="ignore"):  # `Path2D.of` refuses what is not finite
            drawing = Drawing(ElementTree.fromstring(data))
            subpaths = _subpaths(drawing.shapes)
    except InputError:
        raise
    except _BROKEN as broken:
        reason = next(iter(str(broken).splitlines()), type(broken).__name__)
        raise InputError(f"{path} is not SVG: {reason}") from None
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
    upright = points * [1.0, -1.0] + 0.0  # no negative zeros
    return Path2D.of(upright, closed=ends or closed), METRES_PER_PIXEL if drawing.physical else None


def _subpaths(shapes: list[Shape]) -> dict[str, tuple[Floats, bool]]:
    """Find the points (n, 2) of every subpath by name, and whether it is closed.

    Raises:
        InputError: a part of one is hidden.
    """
    from svgelements import Path as SvgPath

    subpaths: dict[str, tuple[Floats, bool]] = {}
    counts: dict[str, int] = {}
    for kind, identity, outline, matrix, clips in shapes:
        counts[kind] = counts.get(kind, 0) + 1
        name = identity or f"{kind}{counts[kind]}"
        parts = [_points(SvgPath(part)) for part in abs(SvgPath(outline) * matrix).as_subpaths()]
        parts = [part for part in parts if len(part[0]) > 1]
        for i, part in enumerate(parts):
            part_name = name if len(parts) == 1 else f"{name}/{i + 1}"
            hiding = [clip.name for clip in clips if clip.hides(part[0])]
            if hiding:
                raise InputError(
                    f"{hiding[0]} hides a part of {part_name}; cut it off in the drawing, or remove {hiding[0]}"
                )
            subpaths[part_name if part_name not in subpaths else f"{part_name}-{kind}{counts[kind]}"] = part
    return subpaths


def _points(subpath: Any) -> tuple[Floats, bool]:
    """Sample the points of one subpath, curves as polylines, and tell whether it is closed."""
    from svgelements import Close, Line, Move

    points: list[list[float]] = []
    closed = False
    for segment in subpath:
        closed |= isinstance(segment, Close)
        if isinstance(segment, Move):
            points = [[segment.end.x, segment.end.y]]
        elif isinstance(segment, Line | Close):
            if segment.end is not None:
                points.append([segment.end.x, segment.end.y])
        else:
            points += segment.npoint(np.linspace(0, 1, _enough(segment) + 1)[1:]).tolist()
        if len(points) > _MOST_POINTS:
            raise InputError(f"a curve of the drawing needs more than {_MOST_POINTS} points; simplify the drawing")
    return np.array(points, dtype=float).reshape(-1, 2), closed


def _enough(curve: Any) -> int:
    """Return the number of segments of a curve such that none turns by more than _TURN."""
    probes = np.asarray(curve.npoint(np.linspace(0, 1, _PROBES + 1)), dtype=float)
    moves = np.diff(probes, axis=0)
    moves = moves[np.hypot(moves[:, 0], moves[:, 1]) > 0]
    turns = np.diff(np.unwrap(np.arctan2(moves[:, 1], moves[:, 0])))
    return max(_PROBES, steps_of(_PROBES * float(np.abs(turns).max(initial=0.0)), _TURN))
