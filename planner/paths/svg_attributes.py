"""Attributes of SVG drawings: numbers, lengths, transforms, views, outlines, and style sheets.

svgelements reads data of paths, makes outlines, and multiplies transforms; what it would leave out in silence is
refused here.

NAMES are what readers of drawings know, the page's too: names of elements, attributes, properties, transforms and
units. `unread` are attributes and properties that move, scale or hide, with the values that do nothing. `lengths`
belong to a view's width (0), height (1) or diagonal (2). `transforms` take numbers (1), lengths (x) and angles
(a); `units` are those of each, `pixels` the sizes of units.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from svgelements import Ellipse, Matrix, Polygon, Polyline, Rect, SimpleLine
from svgelements import Path as SvgPath

from sim.io.errors import InputError

_N = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
NUMBER = re.compile(_N)
_LENGTH = re.compile(rf"({_N})\s*([a-zA-Z]*|%)")
_FUNCTION = re.compile(r"(?<![a-zA-Z])([a-zA-Z]+)\s*\(([^()]*)\)")
_NO_DATA = re.compile(r"[^MZLHVCSQTAE\d\s,.+-]|[MLHVCSQTA][\s,]*(?:[MZLHVCSQTA]|$)|^\s*[^M\s]", re.IGNORECASE)
_POINT = re.compile(r"(?<=\d)\.(?!\d)")  # of "5.", which svgelements does not read
_ASPECT = re.compile(r"(?:none|x(Min|Mid|Max)Y(Min|Mid|Max))(?:\s+(?:meet|(slice)))?")
_SHARES = {None: 0.0, "Min": 0.0, "Mid": 0.5, "Max": 1.0}
_BROKEN = (AttributeError, TypeError, ValueError, ArithmeticError, LookupError)  # data of a path, to svgelements
View = tuple[float | None, float | None]  # width and height that percentages belong to
_COMMENT = re.compile(r"/\*.*?(?:\*/|\Z)|<!--|-->", re.DOTALL)
_NO_RULE = re.compile(r"@(?:charset|namespace)[^;{}@]*;|@font-face\s*\{[^{}]*\}", re.IGNORECASE)
_RULE = re.compile(r"(?<![^{}])([^{}]*)\{([^{}]*)\}")
_SELECTOR = re.compile(r"(\*|[\w-]*)((?:[.#][\w-]+)*)")
_IMPORTANT = re.compile(r"!\s*important$", re.IGNORECASE)
NAMES: dict[str, Any] = {
  "shapes": ["path", "line", "polyline", "polygon", "rect", "circle", "ellipse"],
  "groups": ["svg", "g", "a", "switch", "use", "symbol"],
  "undrawn": ["defs", "clipPath", "mask", "marker", "pattern", "linearGradient", "radialGradient", "meshgradient",
    "hatch", "solidcolor", "solidColor", "filter", "text", "image", "foreignObject", "style", "script", "metadata",
    "title", "desc", "view", "cursor", "color-profile", "font", "font-face", "flowRoot"],
  "lengths": {"x": 0, "y": 1, "width": 0, "height": 1, "cx": 0, "cy": 1, "r": 2, "rx": 0, "ry": 1, "x1": 0,
    "y1": 1, "x2": 0, "y2": 1},
  "read": ["display", "visibility", "opacity", "overflow", "transform", "clip-path", "d"],
  "unread": {
    "transform-origin": ["0", "0 0", "0px 0px", "left top", "top left"], "transform-box": ["view-box"],
    "-webkit-transform": ["none"], "translate": ["none"], "rotate": ["none"], "scale": ["none"],
    "zoom": ["1", "100%", "normal"], "perspective": ["none"], "offset": ["none"], "offset-path": ["none"],
    "animation": ["none"], "animation-name": ["none"], "vector-effect": ["none", "non-scaling-stroke"],
    "mask": ["none"], "mask-image": ["none"], "-webkit-mask": ["none"], "-webkit-mask-image": ["none"],
    "-webkit-clip-path": ["none"], "clip": ["auto"], "filter": ["none"], "content-visibility": ["visible", "auto"],
    "max-width": ["none", "100%"], "max-height": ["none", "100%"], "min-width": ["0", "auto"],
    "min-height": ["0", "auto"], "aspect-ratio": ["auto"], "systemLanguage": [], "refX": ["0"], "refY": ["0"]
  },
  "transforms": {
    "matrix": ["111111"], "translate": ["x", "xx"], "translatex": ["x"], "translatey": ["x"], "scale": ["1", "11"],
    "scalex": ["1"], "scaley": ["1"], "rotate": ["a", "axx"], "skew": ["a", "aa"], "skewx": ["a"], "skewy": ["a"]
  },
  "units": {
    "1": {"": 1}, "x": {"": 1, "px": 1},
    "a": {"": 1, "deg": 1, "grad": 0.9, "rad": 57.29577951308232, "turn": 360}
  },
  "pixels": {"": 1, "px": 1, "pt": 1.3333333333333333, "pc": 16, "in": 96, "cm": 37.79527559055118,
    "mm": 3.7795275590551185, "q": 0.9448818897637796}
}  # fmt: skip


class Lengths:
    """Lengths in pixels, and whether pixels have a size."""

    physical = False  # a length was given in mm or another unit of the laboratory
    sized = True  # the drawing says how large its pixels are

    def read(self, own: Mapping[str, str], name: str, view: View, missing: float | None = None) -> float | None:
        """Read an attribute, in pixels; `missing` where it is not given.

        Raises:
            InputError: it is no length that is read.
        """
        text = own.get(name, "")
        if text.lower() in ("", "auto"):
            return missing
        found = _LENGTH.fullmatch(text)
        unit = found[2].lower() if found else "?"
        if found and unit == "%" and view[0] is not None and view[1] is not None:
            bases = (view[0], view[1], math.hypot(view[0], view[1]) / math.sqrt(2))
            return float(found[1]) * bases[NAMES["lengths"][name]] / 100
        if found is None or unit not in NAMES["pixels"]:
            raise InputError(f"{name}={text!r} is not read; give a number, with mm, cm, in, pt, pc, px or without")
        if unit not in ("", "px"):
            if not self.sized:
                raise InputError(f"{name}={text!r} in a drawing without a size; give its <svg> a width in {unit}")
            self.physical = True
        return float(found[1]) * float(NAMES["pixels"][unit])


def numbers(own: Mapping[str, str], name: str) -> list[float]:
    """Read an attribute that is numbers between blanks and commas.

    Raises:
        InputError: there is something else.
    """
    text = own.get(name, "")
    if NUMBER.sub("", text).strip(", \t\n\r"):
        raise InputError(f"{name}={text[:40]!r} is not read; give numbers")
    return [float(number) for number in NUMBER.findall(text)]


def transform_of(text: str) -> Matrix:
    """Read a transform.

    Raises:
        InputError: a part of it is not known.
    """
    if text.lower() == "none":
        return Matrix()
    known = []
    for name, inside in _FUNCTION.findall(text):
        given = [_LENGTH.fullmatch(word) for word in re.split(r"[\s,]+", inside.strip())]
        kinds = next((k for k in NAMES["transforms"].get(name.lower(), ()) if len(k) == len(given)), "")
        units = [NAMES["units"][kind] for kind in kinds]
        if not kinds or not all(word and word[2].lower() in of for word, of in zip(given, units, strict=True)):
            break
        values = [float(word[1]) * of[word[2].lower()] for word, of in zip(given, units, strict=True) if word]
        known.append(f"{name}({', '.join(map(repr, values))})")
    else:
        if not _FUNCTION.sub("", text).strip(", \t\n\r"):
            return Matrix(" ".join(known))
    raise InputError(
        f"transform={text[:40]!r} is not read; give matrix, translate, scale, rotate or skew, in px and deg"
    )


def fitted(aspect: str, place: Sequence[float], size: Sequence[float], box: Sequence[float]) -> Matrix:
    """Fit the viewBox (left, top, width, height) of an <svg> into its place and size, by preserveAspectRatio.

    Raises:
        InputError: `aspect` is not known.
    """
    found = _ASPECT.fullmatch(aspect or "xMidYMid")
    if found is None:
        raise InputError(f"preserveAspectRatio={aspect!r} is not read; give none, or xMidYMid and meet or slice")
    scale = [size[i] / box[2 + i] for i in (0, 1)]
    if found[1]:
        scale = [max(scale) if found[3] else min(scale)] * 2
    spare = [_SHARES[found[1 + i]] * (size[i] - box[2 + i] * scale[i]) for i in (0, 1)]
    return Matrix(scale[0], 0, 0, scale[1], *(place[i] - box[i] * scale[i] + spare[i] for i in (0, 1)))


def outline(kind: str, own: Mapping[str, str], lengths: Lengths, view: View) -> Any:
    """Return the path of a shape before its transform; None: it shows nothing.

    Raises:
        InputError: an attribute is not read.
    """
    if kind == "path":
        return _path(own.get("d", ""))
    if kind in ("polyline", "polygon"):
        values = numbers(own, "points")
        if len(values) % 2:
            raise InputError(f"a {kind} has an odd number of coordinates; correct its points")
        return (Polyline if kind == "polyline" else Polygon)(*zip(values[::2], values[1::2], strict=True))
    given = {name: lengths.read(own, name, view) for name in NAMES["lengths"]}
    x, y, width, height, cx, cy, r, rx, ry, *ends = (value or 0.0 for value in given.values())
    if kind == "line":
        return SimpleLine(*ends)
    rx, ry = rx if given["rx"] is not None else ry, ry if given["ry"] is not None else rx
    if kind == "rect":
        return Rect(x, y, width, height, max(rx, 0.0), max(ry, 0.0)) if min(width, height) > 0 else None
    rx, ry = (r, r) if kind == "circle" else (rx, ry)
    return Ellipse(cx, cy, rx, ry) if min(rx, ry) > 0 else None


def _path(data: str) -> SvgPath:
    """Read the data of a path, all of them."""
    try:
        if _NO_DATA.search(data):
            raise ValueError
        return SvgPath(_POINT.sub(".0", data))
    except _BROKEN:
        raise InputError(f"the data of a path are not read, {data[:40]!r}; correct them") from None


@dataclass(frozen=True)
class Rule:
    """Declarations for elements of a kind, with classes and ids."""

    kind: str  # empty or *: any
    names: tuple[str, ...]  # .class and #id
    declared: dict[str, str]

    @property
    def weight(self) -> tuple[int, int, bool]:
        """What decides between rules: ids, classes, kind."""
        ids = sum(name.startswith("#") for name in self.names)
        return ids, len(self.names) - ids, self.kind not in ("", "*")


def read_style_sheet(text: str, known: Collection[str]) -> list[Rule]:
    """Read the rules that declare one of the `known` properties, the weakest first.

    Raises:
        InputError: such a rule has a selector of another kind, or is marked as important.
    """
    text = _NO_RULE.sub("", _COMMENT.sub("", text))
    rest = _RULE.sub("", text).strip()
    if rest:
        raise InputError(f"<style> is not read from {rest[:30]!r} on; write attributes instead")
    rules = []
    for selectors, body in _RULE.findall(text):
        given = {name: value for name, value in declarations(body).items() if name in known}
        for selector in map(str.strip, selectors.split(",")):
            found = _SELECTOR.fullmatch(selector)
            if given and (found is None or _IMPORTANT.search(body.strip().rstrip(";"))):
                raise InputError(
                    f"<style> sets {', '.join(given)} of {selector!r}; read are kinds, classes and ids, "
                    "without !important; write attributes instead"
                )
            if given and found:
                rules.append(Rule(found[1], tuple(re.findall(r"[.#][\w-]+", found[2])), given))
    return sorted(rules, key=lambda rule: rule.weight)


def declared(rules: list[Rule], kind: str, attributes: Mapping[str, str]) -> dict[str, str]:
    """Return what rules declare for an element."""
    names = {f".{name}" for name in attributes.get("class", "").split()} | {f"#{attributes.get('id')}"}
    found: dict[str, str] = {}
    for rule in rules:
        if rule.kind in ("", "*", kind) and names.issuperset(rule.names):
            found |= rule.declared
    return found


def declarations(text: str) -> dict[str, str]:
    """Read the declarations of a rule, or of the attribute style."""
    parts = (part.partition(":") for part in _COMMENT.sub("", text).split(";"))
    given = {name.strip().lower(): value.strip() for name, colon, value in parts if colon}
    return {name: _IMPORTANT.sub("", value).rstrip() for name, value in given.items()}
