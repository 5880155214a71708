"""Transforms are those of SVG; `tests.planner.page.test_svg_drawing` compares shapes with Python's."""

from __future__ import annotations

import math

import pytest

from tests.planner.page.page_core import answers

CASES = {
    "": (1, 0, 0, 1, 0, 0),
    "translate(3)": (1, 0, 0, 1, 3, 0),
    "translate(3, 4) scale(2)": (2, 0, 0, 2, 3, 4),
    "scale(2 3)": (2, 0, 0, 3, 0, 0),
    "rotate(90)": (0, 1, -1, 0, 0, 0),
    "rotate(0.25turn 1 0)": (0, 1, -1, 0, 1, -1),
    "skewX(45)": (1, 0, 1, 1, 0, 0),
    "skewY(45)": (1, 1, 0, 1, 0, 0),
    "matrix(1 2 3 4 5 6)": (1, 2, 3, 4, 5, 6),
    f"rotate({math.pi}rad)": (-1, 0, 0, -1, 0, 0),
    "none": (1, 0, 0, 1, 0, 0),
}


def test_transforms() -> None:
    found = answers([("svg_shapes.js", "transformOf", text) for text in CASES])
    for matrix, (text, wanted) in zip(found, CASES.items(), strict=True):
        assert matrix == pytest.approx(wanted, abs=1e-12), text
