"""Lengths in lab units, and refusals of paths whose size makes no sense, are Python's."""

from __future__ import annotations

from typing import Any

from planner.paths.path import Path2D, circle, polygon
from planner.paths.units import check_size, describe, extent, in_lab, place_in_lab, time_in_lab
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from tests.planner.page.page_core import answers

ROBOT = PRESETS["paper-control"]
PAGE_ROBOT = {"tailLength": ROBOT.tail_length, "timeScale": ROBOT.time_scale}
LENGTHS = [0.0, 0.32, 1e-4, -2.5, 17.0, 999.6, 1000.0, 12_345.0]
PATHS = [circle(2.0), polygon(3, 40.0), circle(0.01), Path2D.of([[0, 0], [3, 4]]), circle(3000.0), circle(50.0)]


def outcome(function: Any, *given: Any) -> str:
    """Return the answer or the refusal as text."""
    try:
        return str(function(*given))
    except InputError as refusal:
        return str(refusal)


def test_lengths_times_and_places() -> None:
    assert answers([("units.js", "inLab", x, PAGE_ROBOT) for x in LENGTHS]) == [in_lab(x, ROBOT) for x in LENGTHS]
    times = answers([("units.js", "timeInLab", x, PAGE_ROBOT) for x in LENGTHS])
    assert times == [time_in_lab(x, ROBOT) for x in LENGTHS]
    places = [(x, -0.0001 * y) for x in LENGTHS for y in LENGTHS]
    found = answers([("units.js", "placeInLab", *place, PAGE_ROBOT) for place in places])
    assert found == [place_in_lab(*place, ROBOT) for place in places]


def test_paths_in_words() -> None:
    described = answers([("units.js", "describe", path, PAGE_ROBOT) for path in PATHS])
    assert described == [describe(path, ROBOT) for path in PATHS]
    assert answers([("units.js", "extent", path) for path in PATHS]) == [list(extent(path)) for path in PATHS]


def test_sizes_are_refused_in_the_same_words() -> None:
    found = answers([("units.js", "checkSize", path, PAGE_ROBOT, 1.3) for path in PATHS])
    wanted = [outcome(check_size, path, ROBOT, 1.3) for path in PATHS]
    assert list(map(str, found)) == wanted
    assert any(text != "None" for text in wanted)
