"""Paths from SVG drawings.

SVG is read by svgelements, with transforms, viewBox, curves, basic shapes and <use>; <defs> is ignored. In SVG y
points down; here it points up. Every shape, and every subpath of a shape, is a separate path. A file with several
paths is rejected unless one is chosen by name. Curves become polylines. A few lines of <use> can stand for
millions of shapes, so the size of a drawing is computed first.
"""

from __future__ import annotations

import io
import math
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from planner.paths.path import Path2D, steps_of
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.reading import read_bytes

METRES_PER_PIXEL = 0.0254 / 96  # of SVG
_PHYSICAL = re.compile(r"\s*[0-9.eE+-]+\s*(mm|cm|in|pt|pc)\s*$")
_TURN = math.radians(2.0)  # largest turn of a curve between two points
_PROBES = 64  # places on a curve where its direction is measured
_MOST_NUMBERS, _MOST_POINTS, _DEEPEST = 50_000, 200_000, 100
_NUMBER = re.compile(r"[0-9.eE+-]+")
_XLINK = "{http://www.w3.org/1999/xlink}href"


# Raised by svgelements for invalid drawings: a transform without numbers, a path that begins with a curve
_BROKEN = (
    ElementTree.ParseError, AttributeError, TypeError, UnicodeDecodeError, ValueError, ArithmeticError,
    LookupError,
)  # fmt: skip


def read_svg(path: Path, closed: bool | None, shape: str | None) -> tuple[Path2D, float | None]:
    """Read one path of a drawing, and the size of its unit in metres if the drawing has physical units.

    Raises:
        InputError: the file has no path, or several and none is chosen, or is larger than a drawing may be.
    """
    from svgelements import SVG

    data = read_bytes(path)
    try:
        _check_size(path, ElementTree.fromstring(data))
        drawing = SVG.parse(io.BytesIO(data), reify=True)
        elements = list(drawing.elements())
    except InputError:
        raise
    except _BROKEN as broken:
        reason = next(iter(str(broken).splitlines()), type(broken).__name__)
        raise InputError(f"{path} is not SVG: {reason}") from None
    with np.errstate(all="ignore"):  # `Path2D.of` refuses what is not finite
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
    return Path2D.of(upright, closed=ends or closed), unit


def _check_size(path: Path, root: ElementTree.Element) -> None:
    """Count what a drawing holds when every <use> has been replaced by what it shows, without replacing it.

    Raises:
        InputError: it holds more than a drawing may, or a <use> shows a group that holds it.
    """
    named = {f"#{element.get('id')}": element for element in root.iter() if element.get("id")}
    sizes: dict[ElementTree.Element, tuple[int, int]] = {}  # numbers and elements, depth
    open_elements: set[ElementTree.Element] = set()
    stack = [root]
    while stack:
        element = stack[-1]
        parts = list(element)
        shown = named.get(element.get("href") or element.get(_XLINK) or "")
        if element.tag.rpartition("}")[2] == "use" and shown is not None:
            parts.append(shown)
        if element in open_elements or element in sizes:
            stack.pop()
            if element not in sizes:
                open_elements.discard(element)
                numbers = sum(len(_NUMBER.findall(element.get(key, ""))) for key in ("d", "points"))
                size = 1 + numbers + sum(sizes[part][0] for part in parts)
                depth = 1 + max((sizes[part][1] for part in parts), default=0)
                if size > _MOST_NUMBERS or depth > _DEEPEST:
                    raise InputError(
                        f"{path} has more than {_MOST_NUMBERS} shapes and coordinates, or groups in more than "
                        f"{_DEEPEST} levels; simplify the drawing"
                    )
                sizes[element] = size, depth
            continue
        open_elements.add(element)
        for part in parts:
            if part in open_elements:
                raise InputError(f"{path}: a <use> shows a group that it belongs to; remove it")
            if part not in sizes:
                stack.append(part)


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
        outline = SvgPath(element).reify()  # a turned circle or rectangle still has its transform
        parts = [_points(SvgPath(part)) for part in outline.as_subpaths()]
        parts = [part for part in parts if len(part[0]) > 1]
        for i, part in enumerate(parts):
            part_name = name if len(parts) == 1 else f"{name}/{i + 1}"
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
