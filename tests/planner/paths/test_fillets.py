"""Rounded corners keep edges and radius."""

from __future__ import annotations

import math

import pytest

from planner.paths.distance import distance_to
from planner.paths.fillets import fillet
from planner.paths.path import polygon


def test_fillet_keeps_edges_and_radius() -> None:
    square = polygon(4, 3.0)
    rounded = fillet(square, 0.5)
    assert rounded.length == pytest.approx(12 - 8 * 0.5 + math.pi, rel=1e-3)
    assert distance_to(square.polyline(), rounded.points).max() == pytest.approx(
        0.5 * (1 - math.sqrt(0.5)), rel=1e-2
    )
