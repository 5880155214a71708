"""Shapes in words mean the same in the core."""

from __future__ import annotations

from planner.paths.shapes import like_a_shape, nearest_shape, shape_of
from tests.planner.page.page_core import answers, check_near, refusal_of

NONE = ["hexagon:3", "circle", "path.csv", "square.svg", "Circle:2", ""]
GOOD = ["circle:2", "square:3.5", "triangle:1e1", "polygon:6:2", "polygon:5.0: 2 "]
BAD = ["circle:", "circle:x", "circle:-1", "square:inf", "square:nan", "polygon:6", "polygon:2:1", "polygon:2.5:1",
       "polygon:1001:1", "circle:2:3", "circle:it's"]  # fmt: skip


def test_shapes_in_words() -> None:
    assert answers([("shapes.js", "shapeOf", words) for words in NONE]) == [shape_of(words) for words in NONE]
    for found, words in zip(answers([("shapes.js", "shapeOf", words) for words in GOOD]), GOOD, strict=True):
        wanted = shape_of(words)
        assert wanted is not None
        assert found["closed"]
        check_near(found["points"], wanted.points, 1e-13)


def test_bad_shapes_are_refused_in_the_same_words() -> None:
    found = answers([("shapes.js", "shapeOf", words) for words in BAD])
    assert list(map(str, found)) == [refusal_of(shape_of, words) for words in BAD]


def test_what_looks_like_a_shape() -> None:
    every = [*NONE, *GOOD, *BAD, "a/b:c", "x:y/z"]
    assert answers([("shapes.js", "likeAShape", words) for words in every]) == list(map(like_a_shape, every))


def test_the_nearest_shape_is_suggested() -> None:
    every = [*NONE, "squre:3", "Circel", "trianlge:", "polygn:6:2", "square:3", "sqare", "cirle:2:1", "xyz:1"]
    assert answers([("shapes.js", "nearestShape", words) for words in every]) == list(map(nearest_shape, every))
