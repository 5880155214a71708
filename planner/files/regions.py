"""Places and regions as words of a command or as files."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from planner.paths.obstacles import Circle, Polygon, Region
from planner.paths.path import like_a_shape, shape_of
from planner.paths.path_files import Drawing, read_path
from planner.paths.units import Swimmer, in_tails, read_length
from sim.arrays import Floats
from sim.io.errors import InputError, naming

_SHAPES = {"circle": "circle:X,Y,RADIUS", "box": "box:LEFT,LOW,RIGHT,HIGH"}


def read_region(words: str, unit: str | None, robot: Swimmer) -> Region:
    """Read a region, in tail lengths.

    Args:
        words: circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a CSV or SVG with a closed outline.
        unit: of numbers without one; a drawing with a size has its own.
        robot: its tail length.

    Raises:
        InputError: the words are no region, or a length has no unit.
    """
    shape, _, numbers = words.partition(":")
    if shape in _SHAPES and numbers:
        values = [read_length(number, unit, robot, words) for number in numbers.split(",")]
        if shape == "circle" and len(values) == 3:
            return Circle(*values)
        if shape == "box" and len(values) == 4:
            left, low, right, high = values
            return Polygon.of([[left, low], [right, low], [right, high], [left, high]])
        raise InputError(f"{words!r}; write {_SHAPES[shape]}")
    drawing = read_outline(words)
    with naming(words):
        given = drawing.unit or unit
        named = given if isinstance(given, str) else {1.0: "m", 0.001: "mm"}.get(given or 0.0, "cm")
        path = drawing.in_tails(robot, unit if drawing.unit is None else None)
        return Polygon.of(path, 1.0 / in_tails(named, robot), named)


def read_outline(words: str) -> Drawing:
    """Read a closed outline from a CSV or SVG.

    Raises:
        InputError: there is no such file, or it has no outline; the words may be a misspelt region.
    """
    if like_a_shape(words) and shape_of(words) is None and not Path(words).exists():
        shape, _, numbers = words.partition(":")
        near = difflib.get_close_matches(shape.lower(), _SHAPES, 1)
        guess = f"is it {near[0]}:{numbers}? " if near else ""
        regions = f"{', '.join(_SHAPES.values())}, or a CSV or SVG outline"
        raise InputError(f"{words}: no such file or region; {guess}regions are {regions}")
    return read_path(words, closed=True)


def read_places(words: Sequence[str], unit: str | None, robot: Swimmer) -> Floats:
    """Read places (n, 2), in tail lengths.

    Args:
        words: X,Y of each, or one file with a point for each.
        unit: of numbers without one.
        robot: its tail length.

    Raises:
        InputError: a word is no pair of numbers, or the file cannot be read.
    """
    if len(words) == 1 and "," not in Path(words[0]).name:
        with naming(words[0]):
            return read_path(words[0], closed=False).in_tails(robot, unit).points
    for word in words:
        if word.count(",") != 1:
            raise InputError(f"place {word!r}; write X,Y, for example 30cm,15cm")
    return np.array(
        [[read_length(each, unit, robot, f"place {word}") for each in word.split(",")] for word in words]
    )


def refuse_other_unit(region: object, unit: str | None, robot: Swimmer) -> None:
    """Refuse a file with an outline that says another unit than `unit`; other regions have none of their own."""
    if isinstance(region, str) and region.partition(":")[0] not in _SHAPES:
        with naming(region):
            read_outline(region).in_tails(robot, unit)
