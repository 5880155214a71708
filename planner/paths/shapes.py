"""Shapes that are given in words: circle:RADIUS, square:SIDE, triangle:SIDE, polygon:CORNERS:SIDE."""

from __future__ import annotations

import difflib
import math
import re

from planner.paths.path import Path2D, circle, polygon
from sim.io.errors import InputError

SHAPES = "circle:RADIUS, square:SIDE, triangle:SIDE, polygon:CORNERS:SIDE"
_MOST_CORNERS = 1000
_CORNERS = {"triangle": 3, "square": 4}
_ALIKE = 0.75  # least likeness of a misspelt name, see `difflib`
_LIKE_A_SHAPE = re.compile(r"[A-Za-z]+(:[^/\\]*)?")


def shape_of(words: str) -> Path2D | None:
    """Make the shape that is given in words; None: the words name no shape.

    Raises:
        InputError: a size or a number of corners is missing, or is no number that makes sense.
    """
    name, *sizes = words.split(":")
    if not sizes or name not in ("circle", "polygon", *_CORNERS):
        return None
    try:
        numbers = [float(size) for size in sizes]
    except ValueError:
        numbers = []
    if len(numbers) != (2 if name == "polygon" else 1):
        raise InputError(f"{words!r}; write for example circle:2, square:3 or polygon:6:2")
    size = numbers[-1]
    if not 0 < size < math.inf:
        raise InputError(f"{words!r}; its size must be above 0")
    if name == "circle":
        return circle(size)
    corners = numbers[0] if name == "polygon" else _CORNERS[name]
    if not 3 <= corners <= _MOST_CORNERS or corners != int(corners):
        raise InputError(f"{words!r}; give 3 to {_MOST_CORNERS} corners, as in polygon:6:2")
    return polygon(int(corners), size)


def like_a_shape(words: str) -> bool:
    """Tell whether words look like a shape, known or not: hexagon:3, or circle without a size."""
    return _LIKE_A_SHAPE.fullmatch(words) is not None


def nearest_shape(words: str) -> str:
    """Correct the name of a misspelt shape: square:3 for squre:3; empty where no shape has such a name."""
    name, colon, sizes = words.partition(":")
    names = {shape.partition(":")[0]: shape for shape in SHAPES.split(", ")}
    near = difflib.get_close_matches(name.lower(), names, 1, _ALIKE)
    if not near or near[0] == name:
        return ""
    return f"{near[0]}:{sizes}" if colon else names[near[0]]
