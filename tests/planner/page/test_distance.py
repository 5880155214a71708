"""Distances, segments and shares of the core are Python's, ties included."""

from __future__ import annotations

import numpy as np
import pytest

from planner.paths.distance import distance_to, nearest, two_sided
from planner.paths.path import Path2D, polygon
from tests.planner.page.cases import PATHS, random_stroke
from tests.planner.page.page_core import answer, answers, check_near

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("name", PATHS)
def test_nearest_places(name: str) -> None:
    line = PATHS[name].polyline()
    points = np.concatenate([line, line + 0.05 * RNG.normal(size=line.shape), 5 * RNG.normal(size=(500, 2))])
    found = answer("distance.js", "nearest", line, points)
    distance, segment, share = nearest(line, points)
    check_near(found["distance"], distance, 1e-13)
    assert found["segment"] == segment.tolist()
    check_near(found["share"], share, 1e-11)


def test_of_equally_near_segments_the_lowest_number_counts() -> None:
    line = polygon(4, 2.0).polyline()
    points = np.array([[0.0, 0.0], [2.0, 2.0], [1.0, 1.0], [-1.0, -1.0], [3.0, -3.0], [1e-13, 0.0]])
    found = answer("distance.js", "nearest", line, points)
    assert found["segment"] == nearest(line, points)[1].tolist()


def test_many_segments_and_points() -> None:
    line = np.cumsum(RNG.normal(size=(20_000, 2)), axis=0)
    points = line[::7] + RNG.normal(size=(len(line[::7]), 2))
    check_near(answer("distance.js", "distanceTo", line, points), distance_to(line, points), 1e-11)


def test_steps_of_no_length_and_a_single_segment() -> None:
    points = RNG.normal(size=(20, 2))
    for line in (np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 2.0]])):
        found = answer("distance.js", "nearest", line, points)
        distance, segment, _ = nearest(line, points)
        check_near(found["distance"], distance, 1e-14)
        assert found["segment"] == segment.tolist()


@pytest.mark.parametrize("away", [1e4, 1e5, 1e7])
def test_points_far_away(away: float) -> None:
    line = away * np.array([1.0, 0.7]) + np.cumsum(RNG.normal(size=(30, 2)), axis=0)
    found = answer("distance.js", "nearest", line, away * RNG.normal(size=(40, 2)))
    assert min(found["segment"]) >= 0
    assert np.isfinite(found["distance"]).all()


def test_two_sided_distances() -> None:
    pairs = [(random_stroke(k).polyline(), random_stroke(k + 1).polyline()) for k in range(6)]
    pairs.append((polygon(4, 3.0).polyline(), Path2D.of([[0, 0], [1, 0], [1, 1e-7]]).polyline()))
    found = answers([("distance.js", "twoSided", *pair) for pair in pairs])
    check_near(found, [two_sided(*pair) for pair in pairs], 1e-12)
