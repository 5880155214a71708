"""Shapes that are given in words: circle:RADIUS, square:SIDE, triangle:SIDE, polygon:CORNERS:SIDE; square:24cm."""

from __future__ import annotations

import difflib
import math
import re

from planner.paths.path import Path2D, circle, polygon
from planner.paths.units import number_and_unit
from sim.io.errors import InputError

SHAPES = "circle:RADIUS, square:SIDE, triangle:SIDE, polygon:CORNERS:SIDE"
_MOST_CORNERS = 1000
_CORNERS = {"triangle": 3, "square": 4}
_ALIKE = 0.75  # least likeness of a misspelt name, see `difflib`
_LIKE_A_SHAPE = re.compile(r"[A-Za-z]+(:[^/\\]*)?")


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
