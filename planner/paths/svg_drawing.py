"""Paths from SVG drawings: the shapes that a drawing shows, each where it is seen.

Elements are walked with what those around them do: style sheets, transforms, views (width, height, viewBox) and
<use>. Whatever moves, scales or hides a shape is honoured, or refused by its name. Paint does not matter. A few
lines of <use> can stand for millions of shapes, so elements and numbers are counted on the way.

In SVG y points down; here it points up. Every shape that is seen, and every subpath of a shape, is a separate
path. A file with several paths is rejected unless one is chosen by name. Curves become polylines.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from svgelements import Close, Line, Matrix, Move
from svgelements import Path as SvgPath

from planner.paths.path import Path2D, steps_of
from planner.paths.svg_attributes import (
    NAMES,
    NUMBER,
    Lengths,
    View,
    declarations,
    declared,
    fitted,
    numbers,
    outline,
    read_style_sheet,
    transform_of,
)
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.reading import read_bytes

METRES_PER_PIXEL = 0.0254 / 96  # of SVG
_TURN = math.radians(2.0)  # largest turn of a curve between two points
_PROBES = 64  # places on a curve where its direction is measured
_MOST_POINTS = 200_000
_BROKEN = (ElementTree.ParseError, ValueError, ArithmeticError, LookupError)  # XML or its encoding; no <svg>
_MOST_NUMBERS, _DEEPEST = 50_000, 100
_SVG = "{http://www.w3.org/2000/svg}"
_XLINK = "{http://www.w3.org/1999/xlink}href"
_LINK = re.compile(r"url\(\s*[\"']?(#[^\"')\s]+)[\"']?\s*\)")
_VISIBLE = {"visible": True, "hidden": False, "collapse": False}
_SIZE = ("width", "height")


def read_svg(path: Path, closed: bool | None, shape: str | None) -> tuple[Path2D, float | None]:
    """Read one path of a drawing, and the size of its unit in metres if the drawing has physical units.

    Raises:
        InputError: the file has no path, or several and none is chosen, or is larger than a drawing may be.
    """
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
    subpaths: dict[str, tuple[Floats, bool]] = {}
    counts: dict[str, int] = {}
    for kind, identity, drawn, matrix, clips in shapes:
        counts[kind] = counts.get(kind, 0) + 1
        name = identity or f"{kind}{counts[kind]}"
        parts = [_points(SvgPath(part), matrix) for part in SvgPath(drawn).as_subpaths()]
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


def _points(subpath: Any, matrix: Matrix) -> tuple[Floats, bool]:
    """Sample the points of one subpath in pixels, curves as polylines, and tell whether it is closed.

    Points are sampled before the transform: svgelements takes the axes of a skewed ellipse for upright ones.
    """
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
            points += segment.npoint(np.linspace(0, 1, _enough(segment, matrix) + 1)[1:]).tolist()
        if len(points) > _MOST_POINTS:
            raise InputError(f"a curve of the drawing needs more than {_MOST_POINTS} points; simplify the drawing")
    return _moved(np.array(points, dtype=float).reshape(-1, 2), matrix), closed


def _moved(points: Floats, matrix: Matrix) -> Floats:
    return points @ np.array([[matrix.a, matrix.b], [matrix.c, matrix.d]]) + [matrix.e, matrix.f]


def _enough(curve: Any, matrix: Matrix) -> int:
    """Return the number of segments of a curve such that none turns by more than _TURN, once it is transformed."""
    probes = np.asarray(curve.npoint(np.linspace(0, 1, _PROBES + 1)), dtype=float)
    moves = np.diff(_moved(probes, matrix), axis=0)
    moves = moves[np.hypot(moves[:, 0], moves[:, 1]) > 0]
    turns = np.diff(np.unwrap(np.arctan2(moves[:, 1], moves[:, 0])))
    return max(_PROBES, steps_of(_PROBES * float(np.abs(turns).max(initial=0.0)), _TURN))


class Clip(NamedTuple):
    """A rectangle outside of which nothing is seen."""

    name: str  # of what clips
    matrix: Matrix  # from the rectangle's coordinates to pixels
    low: tuple[float, ...]
    high: tuple[float, ...]

    def hides(self, points: Floats) -> bool:
        """Tell whether one of some points (n, 2), in pixels, is outside."""
        own = _moved(points, ~self.matrix)
        low, high = np.array(self.low), np.array(self.high)
        slack = 1e-6 * float((high - low).max())
        return bool(((own < low - slack) | (own > high + slack)).any())


class Shape(NamedTuple):
    """A shape that is seen."""

    kind: str
    id: str | None
    outline: Any  # of svgelements, before the transform
    matrix: Matrix  # to pixels
    clips: tuple[Clip, ...]


@dataclass(frozen=True)
class _Around:
    """What the elements around an element do to it."""

    matrix: Matrix = field(default_factory=Matrix)
    view: View = (None, None)
    visible: bool = True
    unread: str = ""  # what moves, scales or hides, and is not read
    clips: tuple[Clip, ...] = ()


class Drawing:
    """The shapes of a drawing, and whether its pixels have a size."""

    def __init__(self, root: Element):
        """Find the shapes.

        Raises:
            ValueError: the root is no drawing.
            InputError: something moves, scales or hides a shape, and is not read.
        """
        if kind_of(root) != "svg":
            raise ValueError(f"it begins with <{kind_of(root)}>")
        self._lengths = Lengths()
        self._named = {f"#{element.get('id')}": element for element in root.iter() if element.get("id")}
        styles = ["".join(element.itertext()) for element in root.iter() if kind_of(element) == "style"]
        self._rules = read_style_sheet("\n".join(styles), {*NAMES["read"], *NAMES["lengths"], *NAMES["unread"]})
        self._count = 0
        self._open: list[Element] = []
        self.shapes = list(self._walk(root, _Around()))
        self.physical = self._lengths.physical

    def _walk(self, element: Element, around: _Around, used: Mapping[str, str] | None = None) -> Iterator[Shape]:
        """Find the shapes of an element; `used`: width and height of the <use> that shows it."""
        kind = kind_of(element)
        if kind.startswith("{") or kind in NAMES["undrawn"] or (kind == "symbol" and used is None):
            return
        if kind not in NAMES["shapes"] and kind not in NAMES["groups"]:
            raise InputError(f"<{kind}> is not read; remove it")
        self._enter(element)
        own = self._properties(element)
        if not _hidden(own):
            around = self._inside(own, around)
            if kind in NAMES["shapes"]:
                drawn = outline(kind, own, self._lengths, around.view)
                if drawn is not None and around.visible:
                    if around.unread:
                        raise InputError(f"{around.unread} is not read; apply it in the drawing, or remove it")
                    yield Shape(kind, own.get("id"), drawn, around.matrix, around.clips)
            elif kind in ("svg", "symbol"):
                around = self._in_view({**own, **(used or {})}, around)
            elif kind == "use":
                x, y = (self._lengths.read(own, name, around.view, 0.0) for name in ("x", "y"))
                there = replace(around, matrix=Matrix(1, 0, 0, 1, x, y) * around.matrix)
                yield from self._walk(self._shown(own), there, {name: own[name] for name in _SIZE if name in own})
            for part in _parts(element) if 0.0 not in around.view else ():
                yield from self._walk(part, around)
        self._open.pop()

    def _enter(self, element: Element) -> None:
        """Count an element and its numbers, and remember that it is open."""
        if element in self._open:
            raise InputError("a <use> shows a group that it belongs to; remove it")
        self._open.append(element)
        self._count += 1 + sum(len(NUMBER.findall(element.get(key, ""))) for key in ("d", "points"))
        if self._count > _MOST_NUMBERS or len(self._open) > _DEEPEST:
            raise InputError(
                f"the drawing has more than {_MOST_NUMBERS} shapes and coordinates, or groups in more than "
                f"{_DEEPEST} levels; simplify it"
            )

    def _properties(self, element: Element) -> dict[str, str]:
        """Return an element's attributes; style sheets are stronger, and the attribute style is strongest."""
        own = {key: value.strip() for key, value in element.attrib.items()}
        return {**own, **declared(self._rules, kind_of(element), own), **declarations(own.get("style", ""))}

    def _shown(self, own: Mapping[str, str]) -> Element:
        """Find what a <use> shows."""
        link = own.get("href", own.get(_XLINK, ""))
        if link not in self._named:
            raise InputError(f"a <use> shows {link!r}, which is not in the drawing; remove it")
        return self._named[link]

    def _inside(self, own: Mapping[str, str], around: _Around) -> _Around:
        """Apply an element's transform, visibility and clip path."""
        unread = [
            name
            for name, harmless in NAMES["unread"].items()
            if own.get(name, "").lower() not in ("", *harmless)
            and ("transform" in own or not name.startswith("transform-"))
        ]
        inner = replace(
            around,
            matrix=transform_of(own.get("transform", "none")) * around.matrix,
            visible=_VISIBLE.get(own.get("visibility", "").lower(), around.visible),
            unread=around.unread or next(iter(unread), ""),
        )
        if own.get("clip-path", "none") == "none":
            return inner
        clip = self._clip(own["clip-path"], inner)
        return replace(inner, clips=(*inner.clips, clip)) if clip else replace(inner, unread="clip-path")

    def _clip(self, words: str, around: _Around) -> Clip | None:
        """Read a clip path that is an upright rectangle; None: it is another."""
        link = _LINK.fullmatch(words)
        element = self._named.get(link[1]) if link else None
        if element is None or len(element) != 1 or kind_of(element[0]) not in NAMES["shapes"]:
            return None
        group, own = self._properties(element), self._properties(element[0])
        if {"clip-path", "clipPathUnits", "display", "visibility"} & {*group, *own}:
            return None
        inner = self._inside(own, self._inside(group, around))
        drawn = outline(kind_of(element[0]), own, self._lengths, around.view)
        segments = [] if drawn is None else list(SvgPath(drawn))
        corners = [(segment.end.x, segment.end.y) for segment in segments if segment.end is not None]
        upright = all(a[0] == b[0] or a[1] == b[1] for a, b in pairwise(corners))
        straight = all(isinstance(segment, Move | Line | Close) for segment in segments)
        axes = [sorted(set(axis)) for axis in zip(*corners, strict=True)]
        if len(set(corners)) != 4 or [len(axis) for axis in axes] != [2, 2] or not (upright and straight):
            return None
        flat = inner.unread or _flat(inner.matrix)
        return None if flat else Clip("clip-path", inner.matrix, *zip(*axes, strict=True))

    def _in_view(self, own: dict[str, str], around: _Around) -> _Around:
        """Enter an <svg> or a <symbol>: its place, its size, its viewBox."""
        box = numbers(own, "viewBox") or None
        if box is not None and (len(box) != 4 or min(box[2:]) < 0):
            raise InputError(f"viewBox={own['viewBox']!r} is not read; give left, top, width and height")
        x = y = 0.0
        if len(self._open) == 1:
            width, height = self._outer_size(own, box)
        else:
            x, y = (self._lengths.read(own, name, around.view) or 0.0 for name in ("x", "y"))
            width, height = (self._lengths.read(own, _SIZE[i], around.view, around.view[i]) for i in (0, 1))
        if min(width or 0.0, height or 0.0) < 0:
            raise InputError("the width or height of an <svg> is below 0; correct it")
        if width is None or height is None:
            if box is not None:
                raise InputError("an <svg> in another has no size; give it width and height")
            return replace(around, matrix=Matrix(1, 0, 0, 1, x, y) * around.matrix, view=(width, height))
        clips = around.clips
        if len(self._open) > 1 and own.get("overflow") not in ("visible", "auto") and not _flat(around.matrix):
            clips = (*clips, Clip("<svg>", around.matrix, (x, y), (x + width, y + height)))
        inner, view = Matrix(1, 0, 0, 1, x, y), (width, height)
        if box is not None:
            view = (box[2], box[3]) if width and height else (0.0, 0.0)
            inner = (
                fitted(own.get("preserveAspectRatio", ""), (x, y), (width, height), box) if all(view) else inner
            )
        return replace(around, matrix=inner * around.matrix, view=view, clips=clips)

    def _outer_size(self, own: dict[str, str], box: list[float] | None) -> View:
        """Return width and height of the drawing; what is missing, or in per cent, follows from the viewBox."""
        width, height = (
            None if own.get(name, "").endswith("%") else self._lengths.read(own, name, (None, None))
            for name in _SIZE
        )
        if box is None:
            return width, height
        self._lengths.sized = (width, height) != (None, None)
        scales = [size / whole for size, whole in zip((width, height), box[2:], strict=True) if size and whole]
        scale = next(iter(scales), 1.0)
        return scale * box[2] if width is None else width, scale * box[3] if height is None else height


def kind_of(element: Element) -> str:
    """Return the name of an element, with its namespace if that is another than SVG's."""
    return element.tag.removeprefix(_SVG)


def _parts(element: Element) -> list[Element]:
    """List the children that are shown; those of a <switch> are alternatives."""
    if kind_of(element) != "switch":
        return list(element)
    return [part for part in element if not part.get("requiredExtensions")][:1]


def _hidden(own: Mapping[str, str]) -> bool:
    """Tell whether an element is hidden with all that it holds."""
    try:
        transparent = float(own.get("opacity", "1").rstrip("%")) <= 0
    except ValueError:
        transparent = False
    return transparent or own.get("display", "").lower() == "none" or bool(own.get("requiredExtensions"))


def _flat(matrix: Matrix) -> bool:
    return bool(matrix.a * matrix.d == matrix.b * matrix.c)
