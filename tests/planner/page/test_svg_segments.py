"""Segments follow the data of a path; test_svg_drawing.py compares their points with those of Python."""

from __future__ import annotations

import pytest

from tests.planner.page.page_core import answer, answers


def test_kinds_of_segments() -> None:
    data = "M0 0 1 1 h2 v3 H4 V5 c1 2 3 4 5 6 s1 1 2 2 q1 1 2 0 t1 1 a1 1 0 0 1 1 1 z"
    kinds = [segment["kind"] for segment in answer("svg_segments.js", "pathSegments", data)]
    assert kinds == ["move", *["line"] * 5, *["curve"] * 4, "arc", "close"]


def test_a_matrix_moves_points_and_mirrors_arcs() -> None:
    product, point = answers(
        [
            ("svg_segments.js", "product", [1, 0, 0, 1, 5, 6], [2, 0, 0, -2, 0, 0]),
            ("svg_segments.js", "moved", [2, 0, 0, -2, 5, 6], [1, 1]),
        ]
    )
    assert product == [2, 0, 0, -2, 5, 6]
    assert point == [7, 4]
    arc = answer("svg_segments.js", "pathSegments", "M0 0A1 1 0 0 1 2 0")[1]
    mirrored = answer("svg_segments.js", "transformed", [1, 0, 0, -1, 0, 0], arc)
    assert mirrored["sweep"] == pytest.approx(-arc["sweep"])
