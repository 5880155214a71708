"""Paths of the core are Python's."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from planner.paths.path import Path2D, arc_length, circle, polygon, resample, smoothed
from sim.io.errors import InputError
from tests.planner.page.page_core import answer, answers, check_near, refusal_of

RNG = np.random.default_rng(0)
STROKE = np.cumsum(RNG.normal(size=(300, 2)), axis=0)
PATHS = [
    Path2D.of([[0, 0], [3, 0], [3, 4]]), circle(2.0), polygon(3, 2.0), polygon(4, 3.0), Path2D.of(STROKE),
    Path2D.of(STROKE, closed=True), Path2D.of([[0, 0], [0, 0], [1, 1], [2, 0], [0, 1e-12]]),
]  # fmt: skip


def check_path(found: Any, wanted: Path2D, allowed: float = 1e-13) -> None:
    assert found["closed"] == wanted.closed
    check_near(found["points"], wanted.points, allowed)


def test_points_become_paths() -> None:
    tables = [path.polyline().tolist() for path in PATHS]
    for found, table in zip(answers([("path.js", "pathOf", table) for table in tables]), tables, strict=True):
        check_path(found, Path2D.of(table), 0.0)
    for found, table in zip(
        answers([("path.js", "pathOf", table, True) for table in tables]), tables, strict=True
    ):
        check_path(found, Path2D.of(table, closed=True), 0.0)


@pytest.mark.parametrize(
    "points",
    [[], [[0, 0]], [[1, 2], [1, 2]], [[0, 0], [1]], [[0, 0, 0], [1, 1, 1]], [1, 2, 3], [[0, 0], [1e101, 0]],
     [[0, "x"], [1, 1]]],
    ids=str,
)  # fmt: skip
def test_bad_points_are_refused_in_the_same_words(points: Any) -> None:
    assert str(answer("path.js", "pathOf", points)) == refusal_of(Path2D.of, points)


def test_shapes_lengths_and_points_at_equal_distances() -> None:
    check_path(answer("path.js", "circle", 1.7), circle(1.7))
    for corners in (3, 4, 7):
        check_path(answer("path.js", "polygon", corners, 2.2), polygon(corners, 2.2))
    lengths = answers([("path.js", "pathLength", path) for path in PATHS])
    assert lengths == [path.length for path in PATHS]
    for path in PATHS:
        line = path.polyline()
        spacings = (0.02, 0.1, path.length / 7, math.pi * path.length)
        lengths, *found = answers(
            [("path.js", "arcLength", line), *(("path.js", "resample", line, spacing) for spacing in spacings)]
        )
        assert lengths == arc_length(line).tolist()
        assert found == [resample(line, spacing).tolist() for spacing in spacings]
    assert answer("path.js", "scaled", PATHS[0], 1.1)["points"] == PATHS[0].scaled(1.1).points.tolist()


def test_smoothing() -> None:
    cases = [(path, path.length / share) for path in PATHS for share in (200, 11, 2.1)]
    for found, case in zip(answers([("path.js", "smoothed", *case) for case in cases]), cases, strict=True):
        wanted, moved = smoothed(*case)
        check_path(found["path"], wanted, 1e-12)
        assert found["moved"] == pytest.approx(moved, abs=1e-12)
    for length in (-1.0, 0.0, 3.6):
        refusal = answer("path.js", "smoothed", PATHS[0], length)
        assert isinstance(refusal, InputError)
        assert str(refusal) == refusal_of(smoothed, PATHS[0], length)
