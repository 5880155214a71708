"""Distances against a comparison of all with all, and that they take time linear in the length."""

from __future__ import annotations

import tracemalloc
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.paths import distance
from planner.paths.distance import distance_to, nearest, two_sided


def all_with_all(polyline: np.ndarray, points: np.ndarray) -> np.ndarray:
    start, along = polyline[:-1], np.diff(polyline, axis=0)
    away = points[:, None] - start
    share = np.clip((away * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-300), 0, 1)
    return np.asarray(np.hypot(*np.moveaxis(away - share[..., None] * along, -1, 0)).min(1))


@given(st.integers(0, 10_000), st.integers(2, 60), st.floats(0.01, 30.0), st.booleans())
@settings(max_examples=150, deadline=None)
def test_distances_are_exact(seed: int, count: int, spread: float, tree: bool) -> None:
    """Any polyline: short and long steps, crossings, hairpins, points near and far; with a tree and without."""
    rng = np.random.default_rng(seed)
    polyline = np.cumsum(rng.normal(size=(count, 2)) * 10 ** rng.uniform(-2, 1, (count, 1)), 0)
    if seed % 3 == 0:
        polyline = np.concatenate([polyline, polyline[::-1]])
    points = polyline[rng.integers(count, size=30)] + spread * rng.normal(size=(30, 2))
    with patch.object(distance, "_FEW_PAIRS", 0 if tree else 10**9):
        found = distance_to(polyline, points)
    assert found == pytest.approx(all_with_all(polyline, points), rel=1e-9, abs=1e-9)


def test_the_nearest_place_is_on_the_polyline() -> None:
    polyline = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 3.0]])
    gap, segment, share = nearest(polyline, np.array([[0.5, 0.4], [2.5, 1.5]]))
    assert gap == pytest.approx([0.4, 0.5])
    assert segment.tolist() == [0, 1]
    assert share == pytest.approx([0.25, 0.5])


def test_a_missed_corner_is_seen_from_the_other_side() -> None:
    square = np.array([[0, 0], [2, 0], [2, 2], [0, 2], [0, 0]], dtype=float)
    angle = np.linspace(0, 2 * np.pi, 400)
    inscribed = 1 + np.stack([np.cos(angle), np.sin(angle)], 1)
    off, missed = two_sided(inscribed, square)
    assert off == pytest.approx(1 - np.sqrt(0.5), rel=1e-2)
    assert missed == pytest.approx(np.sqrt(2) - 1, rel=1e-2)


def test_of_equally_near_segments_the_first_counts() -> None:
    """Outside a corner both sides are equally near; the sides of a hairpin are, too."""
    angle = np.linspace(0, 2 * np.pi, 13)
    ring = np.stack([np.cos(angle), np.sin(angle)], 1)
    _, segment, share = nearest(ring, 2 * ring[1:-1])
    assert segment.tolist() == list(range(11))
    assert share == pytest.approx(np.ones(11))
    hairpin = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    assert nearest(hairpin, np.array([[0.3, 1.0], [1.5, -0.2]]))[1].tolist() == [0, 1]


def test_more_points_than_a_block_holds() -> None:
    rng = np.random.default_rng(3)
    polyline, points = rng.normal(size=(8, 2)), rng.normal(size=(20_000, 2))
    assert distance_to(polyline, points) == pytest.approx(all_with_all(polyline, points), rel=1e-9, abs=1e-9)


def test_memory_does_not_grow_with_all_candidates() -> None:
    """Points are handled in blocks: only what is returned grows, 24 bytes a point."""
    angle = np.linspace(0, 2 * np.pi, 200_001)
    points = np.stack([np.cos(angle), np.sin(angle)], 1)
    polyline = 1.01 * points[::2_000]
    tracemalloc.start()
    nearest(polyline, points)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 24 * len(points) + 40e6


@pytest.mark.parametrize("away", [1e4, 1e5, 1e7])
def test_points_far_away(away: float) -> None:
    """Where distances are so large that TIE is less than their last bit."""
    rng = np.random.default_rng(3)
    line = away * np.array([1.0, 0.7]) + np.cumsum(rng.normal(size=(30, 2)), axis=0)
    points = away * rng.normal(size=(40, 2))
    distance, _, _ = nearest(line, points)
    assert distance == pytest.approx(all_with_all(line, points), rel=1e-12)
