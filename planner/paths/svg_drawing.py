"""Paths from SVG drawings: the shapes that a drawing shows, each where it is seen.

svgelements reads data of paths and transforms, and makes outlines. What it would pass over in silence, or read in
another way than a browser, is refused by its name, if it moves, scales or hides a shape. Paint does not matter. A
few lines of <use> can stand for millions of shapes, so elements and numbers are counted on the way.

In SVG y points down; here it points up. Every shape that is seen, and every subpath of a shape, is a separate
path. Curves become polylines.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from svgelements import Circle, Close, Ellipse, Line, Matrix, Move, Polygon, Polyline, Rect, SimpleLine, Viewbox
from svgelements import Path as SvgPath

from common.arrays import Floats
from common.errors import InputError
from common.reading import read_bytes
from planner.paths.named_paths import NamedPaths
from planner.paths.path import Path2D, steps_of

METRES_PER_PIXEL = 0.0254 / 96  # of SVG
_TURN = math.radians(2.0)  # largest turn of a curve between two points
_PROBES = 64  # places on a curve where its direction is measured
_MOST_POINTS = 200_000
_MOST_NUMBERS, _DEEPEST = 50_000, 100
_BROKEN = (ValueError, ArithmeticError, LookupError)  # XML or its encoding, or data of a path

# What readers of drawings know, the page's too
_LENGTHS = {  # of each shape
    "path": [], "line": ["x1", "y1", "x2", "y2"], "polyline": [], "polygon": [], "circle": ["cx", "cy", "r"],
    "rect": ["x", "y", "width", "height", "rx", "ry"], "ellipse": ["cx", "cy", "rx", "ry"],
}  # fmt: skip
_SIZES = ["width", "height", "r", "rx", "ry"]  # lengths that are not below 0
_PIXELS = {"": 1, "px": 1, "pt": 4 / 3, "pc": 16, "in": 96, "cm": 96 / 2.54, "mm": 9.6 / 2.54, "q": 2.4 / 2.54}
_GROUPS = ["svg", "g", "a", "use"]
_UNDRAWN = ["defs", "symbol", "clipPath", "mask", "marker", "pattern", "linearGradient", "radialGradient",
            "filter", "text", "image", "foreignObject", "flowRoot"]  # fmt: skip
_MOVING = ["animate", "animateTransform", "animateMotion", "set"]
_READ = ["display", "visibility", "opacity", "transform", "d"]
_UNREAD = ["transform-origin", "transform-box", "-webkit-transform", "translate", "rotate", "scale", "zoom",
           "perspective", "offset", "offset-path", "animation", "animation-name", "mask", "mask-image",
           "-webkit-mask", "-webkit-mask-image", "clip-path", "-webkit-clip-path", "clip", "filter",
           "content-visibility", "max-width", "max-height", "min-width", "min-height", "aspect-ratio",
           "systemLanguage", "requiredExtensions"]  # attributes and properties  # fmt: skip
_HARMLESS = ["", "none", "auto", "normal", "visible", "0", "0 0", "0px 0px", "1", "100%"]  # values of these
_TRANSFORMS = {  # and their arguments: numbers 1, lengths x, angles a
    "matrix": ["111111"], "translate": ["x", "xx"], "translatex": ["x"], "translatey": ["x"], "scale": ["1", "11"],
    "scalex": ["1"], "scaley": ["1"], "rotate": ["a", "axx"], "skewx": ["a"], "skewy": ["a"],
}  # fmt: skip

_VISIBLE = {"visible": True, "hidden": False, "collapse": False}
_OUTLINES = {"line": SimpleLine, "polyline": Polyline, "polygon": Polygon, "circle": Circle, "rect": Rect,
             "ellipse": Ellipse}  # fmt: skip
_SVG = "{http://www.w3.org/2000/svg}"
_XLINK = "{http://www.w3.org/1999/xlink}href"
_N = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER = re.compile(_N)
_POINT = re.compile(r"(?<=\d)\.(?!\d)")  # of "5.", which svgelements does not read
_LENGTH = re.compile(rf"({_N})\s*([a-zA-Z]*)")
_NO_DATA = re.compile(r"[^MZLHVCSQTAE\d\s,.+-]|[MLHVCSQTA][\s,]*(?:[MZLHVCSQTA]|$)|^\s*[^M\s]", re.IGNORECASE)
_UNITS = {"1": "", "x": "(?:px)?", "a": "(?:deg|grad|rad|turn)?"}
_TRANSFORM = re.compile(
    "|".join(
        rf"\b{name}\s*\(\s*" + r"[\s,]+".join(_N + _UNITS[kind] for kind in kinds) + r"\s*\)"
        for name, forms in _TRANSFORMS.items()
        for kinds in forms
    ),
    re.IGNORECASE,
)
_ASPECT = re.compile(r"(?:none|x(Min|Mid|Max)Y(Min|Mid|Max))(?:\s+(?:meet|slice))?")
_TRANSPARENT = re.compile(r"(?:0+(?:\.0+)?|\.0+)%?|-.*")
_COMMENT = re.compile(r"/\*.*?(?:\*/|\Z)|<!--|-->", re.DOTALL)
_NO_RULE = re.compile(r"@(?:charset|namespace)[^;{}@]*;|@font-face\s*\{[^{}]*\}", re.IGNORECASE)
_RULE = re.compile(r"(?<![^{}])([^{}]*)\{([^{}]*)\}")
_SELECTOR = re.compile(r"[.#]?[\w-]+")
_IMPORTANT = re.compile(r"!\s*important$", re.IGNORECASE)


def read_svg(path: Path) -> NamedPaths:
    """Read the paths of a drawing, and the size of its unit if the drawing has physical units.

    Raises:
        InputError: the file has no path, or is larger than a drawing may be.
    """
    data = read_bytes(path)
    if b"<?xml-stylesheet" in data:
        raise InputError(f"{path}: <?xml-stylesheet> is not read; save the drawing with its style")
    try:
        with np.errstate(all="ignore"):  # `Path2D.of` refuses what is not finite
            drawing = _Drawing(ElementTree.fromstring(data))
            subpaths = _subpaths(drawing.shapes)
    except InputError:
        raise
    except (ElementTree.ParseError, *_BROKEN) as broken:
        reason = next(iter(str(broken).splitlines()), type(broken).__name__)
        raise InputError(f"{path} is not SVG: {reason}") from None
    if not subpaths:
        raise InputError(f"{path} has no path, line, polyline, polygon, rectangle, circle or ellipse; draw one")
    upright = {name: Path2D(path.points * [1.0, -1.0] + 0.0, path.closed) for name, path in subpaths.items()}
    return NamedPaths(upright, METRES_PER_PIXEL if drawing.physical else None)


class _Shape(NamedTuple):
    """A shape that is seen."""

    kind: str
    id: str | None
    outline: SvgPath  # before the transform
    matrix: Matrix  # to pixels


def _subpaths(shapes: list[_Shape]) -> dict[str, Path2D]:
    """Find every subpath by name."""
    subpaths: dict[str, Path2D] = {}
    counts: dict[str, int] = {}
    for kind, identity, outline, matrix in shapes:
        counts[kind] = counts.get(kind, 0) + 1
        name = identity or f"{kind}{counts[kind]}"
        parts = [polyline_of(SvgPath(part), matrix) for part in outline.as_subpaths()]
        parts = [part for part in parts if len(part.points) > 1]
        for i, part in enumerate(parts):
            part_name = name if len(parts) == 1 else f"{name}/{i + 1}"
            subpaths[part_name if part_name not in subpaths else f"{part_name}-{kind}{counts[kind]}"] = part
    return subpaths


def polyline_of(subpath: Any, matrix: Matrix) -> Path2D:
    """Sample the points of one subpath in pixels, curves as polylines.

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
    return Path2D(_moved(np.array(points, dtype=float).reshape(-1, 2), matrix), closed)


def _moved(points: Floats, matrix: Matrix) -> Floats:
    return points @ np.array([[matrix.a, matrix.b], [matrix.c, matrix.d]]) + [matrix.e, matrix.f]


def _enough(curve: Any, matrix: Matrix) -> int:
    """Return the number of segments of a curve such that none turns by more than _TURN, once it is transformed."""
    probes = np.asarray(curve.npoint(np.linspace(0, 1, _PROBES + 1)), dtype=float)
    moves = np.diff(_moved(probes, matrix), axis=0)
    moves = moves[np.hypot(moves[:, 0], moves[:, 1]) > 0]
    turns = np.diff(np.unwrap(np.arctan2(moves[:, 1], moves[:, 0])))
    return max(_PROBES, steps_of(_PROBES * float(np.abs(turns).max(initial=0.0)), _TURN))


class _Drawing:
    """The shapes of a drawing, and whether its pixels have a size."""

    def __init__(self, root: Element):
        """Find the shapes.

        Raises:
            ValueError: the root is no drawing.
            InputError: something moves, scales or hides a shape, and is not read.
        """
        if _kind(root) != "svg":
            raise ValueError(f"it begins with <{_kind(root)}>")
        self.physical = False  # a length was given in mm or another unit of the laboratory
        self._sized = True  # the drawing says how large its pixels are
        self._named = {f"#{element.get('id')}": element for element in root.iter() if element.get("id")}
        styles = ["".join(element.itertext()) for element in root.iter() if _kind(element) == "style"]
        self._rules = _style_rules("\n".join(styles))
        self._count = 0
        self._open: list[Element] = []
        self.shapes = list(self._walk(root, Matrix(), True, ""))

    def _walk(self, element: Element, matrix: Matrix, visible: bool, unread: str) -> Iterator[_Shape]:
        """Find the shapes of an element; `unread`: what around it moves, scales or hides, and is not read."""
        kind = _kind(element)
        if kind.startswith("{") or kind in _UNDRAWN:
            return
        if kind in _MOVING:
            raise InputError(f"<{kind}> is not read; remove it")
        self._enter(element)
        own = self._properties(element)
        if own.get("display", "").lower() != "none" and not _TRANSPARENT.fullmatch(own.get("opacity", "")):
            visible = _VISIBLE.get(own.get("visibility", "").lower(), visible)
            unread = unread or self._unread(kind, own)
            matrix = _matrix(own.get("transform", "")) * matrix
            if len(self._open) == 1:
                matrix = self._frame(own) * matrix
            if kind in _LENGTHS and visible:
                outline = self._outline(kind, own)
                if unread and len(outline):
                    raise InputError(f"{unread} is not read; apply it in the drawing, or remove it")
                yield _Shape(kind, own.get("id"), outline, matrix)
            if kind == "use":
                there = Matrix(1, 0, 0, 1, self._length(own, "x"), self._length(own, "y"))
                yield from self._walk(self._shown(own), there * matrix, visible, unread)
            for part in element:
                yield from self._walk(part, matrix, visible, unread)
        self._open.pop()

    def _enter(self, element: Element) -> None:
        """Count an element and its numbers, and remember that it is open."""
        if element in self._open:
            raise InputError("a <use> shows a group that it belongs to; remove it")
        self._open.append(element)
        self._count += 1 + sum(len(_NUMBER.findall(element.get(key, ""))) for key in ("d", "points"))
        if self._count > _MOST_NUMBERS or len(self._open) > _DEEPEST:
            raise InputError(
                f"the drawing has more than {_MOST_NUMBERS} shapes and coordinates, or groups in more than "
                f"{_DEEPEST} levels; simplify it"
            )

    def _properties(self, element: Element) -> dict[str, str]:
        """Return an element's attributes; style sheets are stronger, and the attribute style is strongest."""
        own = {key: value.strip() for key, value in element.attrib.items()}
        selectors = {_kind(element), f"#{own.get('id')}", *(f".{name}" for name in own.get("class", "").split())}
        given = [properties for selector, properties in self._rules if selector in selectors]
        for properties in [*given, _declarations(own.get("style", ""))]:
            own |= properties
        return own

    def _unread(self, kind: str, own: Mapping[str, str]) -> str:
        """Name what is not read of an element."""
        if kind == "svg" and len(self._open) > 1:
            return "an <svg> in another"
        if kind not in _LENGTHS and kind not in _GROUPS:
            return f"<{kind}>"
        turned = [name for name in _UNREAD if "transform" in own or not name.startswith("transform-")]
        return next((name for name in turned if own.get(name, "").lower() not in _HARMLESS), "")

    def _shown(self, own: Mapping[str, str]) -> Element:
        """Find what a <use> shows."""
        link = own.get("href", own.get(_XLINK, ""))
        if link not in self._named or _kind(self._named[link]) == "symbol":
            raise InputError(f"a <use> shows {link!r}, which is no shape or group of the drawing; remove it")
        return self._named[link]

    def _length(self, own: Mapping[str, str], name: str) -> float:
        """Read an attribute, in pixels; 0: it is not given.

        Raises:
            InputError: it is no length that is read.
        """
        text = own.get(name, "")
        found = _LENGTH.fullmatch(text or "0")
        unit = found[2].lower() if found else "?"
        if found is None or unit not in _PIXELS:
            raise InputError(
                f"{name}={text[:40]!r} is not read; give a number, with mm, cm, in, pt, pc, px or without"
            )
        if unit not in ("", "px"):
            if not self._sized:
                raise InputError(f"{name}={text!r} in a drawing without a size; give its <svg> a width in {unit}")
            self.physical = True
        value = float(found[1]) * _PIXELS[unit]
        if value < 0 and name in _SIZES:
            raise InputError(f"{name}={text!r} is below 0; correct it")
        return value

    def _outline(self, kind: str, own: Mapping[str, str]) -> SvgPath:
        """Return the path of a shape before its transform; it is empty where the shape shows nothing."""
        if kind == "path":
            return _path(own.get("d", ""))
        given = {name: self._length(own, name) for name in _LENGTHS[kind] if own.get(name, "auto") != "auto"}
        values = _numbers(own, "points") if kind in ("polyline", "polygon") else []
        if len(values) % 2:
            raise InputError(f"a {kind} has an odd number of coordinates; correct its points")
        missing = {"width": 0.0, "height": 0.0, "rx": given.get("ry", 0.0), "ry": given.get("rx", 0.0)}
        points = list(zip(values[::2], values[1::2], strict=True))
        shape = _OUTLINES[kind]({**missing, **given, "points": points})  # of what is missing it would take 1
        return SvgPath() if shape.is_degenerate() else SvgPath(shape)

    def _frame(self, own: Mapping[str, str]) -> Matrix:
        """Fit the viewBox into the drawing's size; a side that is missing, or in per cent, follows from it."""
        width, height = (
            None if own.get(name, "auto").endswith(("auto", "%")) else self._length(own, name)
            for name in ("width", "height")
        )
        if 0 in (width, height):
            raise InputError("the width or height of the <svg> is 0; correct it")
        box = _numbers(own, "viewBox")
        if not box:
            return Matrix()
        aspect = own.get("preserveAspectRatio") or "xMidYMid"
        if not _ASPECT.fullmatch(aspect):
            raise InputError(f"preserveAspectRatio={aspect!r} is not read; give none, or xMidYMid, meet or slice")
        if len(box) != 4 or min(box[2:]) <= 0:
            raise InputError(f"viewBox={own['viewBox'][:40]!r} is not read; give left, top, and sizes above 0")
        self._sized = (width, height) != (None, None)
        scale = width / box[2] if width else height / box[3] if height else 1.0
        sides = (width / scale if width else box[2], height / scale if height else box[3])
        fit = Viewbox.viewbox_transform(0, 0, *sides, *box, aspect)  # in text of 12 decimals, so near 1
        return Matrix(fit) * Matrix(scale, 0, 0, scale, 0, 0)


def _kind(element: Element) -> str:
    """Return the name of an element, with its namespace if that is another than SVG's."""
    return element.tag.removeprefix(_SVG)


def _numbers(own: Mapping[str, str], name: str) -> list[float]:
    """Read an attribute that is numbers between blanks and commas.

    Raises:
        InputError: there is something else.
    """
    text = own.get(name, "")
    if _NUMBER.sub("", text).strip(", \t\n\r"):
        raise InputError(f"{name}={text[:40]!r} is not read; give numbers")
    return [float(number) for number in _NUMBER.findall(text)]


def _matrix(transform: str) -> Matrix:
    """Read a transform.

    Raises:
        InputError: a part of it is not known.
    """
    if transform.lower() == "none":
        return Matrix()
    if _TRANSFORM.sub("", transform).strip(", \t\n\r"):
        raise InputError(
            f"transform={transform[:40]!r} is not read; give matrix, translate, scale, rotate or skewX, in px, deg"
        )
    return Matrix(_POINT.sub("", transform))


def _path(data: str) -> SvgPath:
    """Read the data of a path, all of them."""
    try:
        if _NO_DATA.search(data):
            raise ValueError
        return SvgPath(_POINT.sub(".0", data))
    except (*_BROKEN, AttributeError, TypeError):
        raise InputError(f"the data of a path are not read, {data[:40]!r}; correct them") from None


def _style_rules(text: str) -> list[tuple[str, dict[str, str]]]:
    """Read selectors and what they declare of the properties that matter, the weakest first.

    Raises:
        InputError: such a selector is no kind, class or id, or a declaration is marked as important.
    """
    text = _NO_RULE.sub("", _COMMENT.sub("", text))
    rest = _RULE.sub("", text).strip()
    if rest:
        raise InputError(f"<style> is not read from {rest[:30]!r} on; write attributes instead")
    known = {*_READ, *_UNREAD, *(name for names in _LENGTHS.values() for name in names)}
    rules = []
    for selectors, body in _RULE.findall(text):
        given = {name: value for name, value in _declarations(body).items() if name in known}
        for selector in map(str.strip, selectors.split(",") if given else ()):
            if not _SELECTOR.fullmatch(selector) or "!" in body:
                raise InputError(
                    f"<style> sets {', '.join(given)} of {selector!r}; read are a kind, a class or an id, "
                    "without !important; write attributes instead"
                )
            rules.append((selector, given))
    return sorted(rules, key=lambda rule: ".#".find(rule[0][0]))


def _declarations(text: str) -> dict[str, str]:
    """Read the declarations of a rule, or of the attribute style."""
    parts = (part.partition(":") for part in _COMMENT.sub("", text).split(";"))
    given = {name.strip().lower(): value.strip() for name, colon, value in parts if colon}
    return {name: _IMPORTANT.sub("", value).rstrip() for name, value in given.items()}
