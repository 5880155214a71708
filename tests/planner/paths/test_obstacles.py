"""Distances from regions and walls."""

from __future__ import annotations

import numpy as np
import pytest

from planner.paths.obstacles import Circle, FreeSpace, Polygon
from sim.io.errors import InputError


def box(left: float, low: float, right: float, high: float) -> Polygon:
    return Polygon.of([[left, low], [right, low], [right, high], [left, high]])


def test_distances_of_regions() -> None:
    room = FreeSpace((Circle(0, 0, 1),), box(-3, -2, 3, 2))
    found = room.distance(np.array([[0, 0], [2, 0], [0, 1.75], [0, 3.0], [-2.9, 0]]))
    assert found == pytest.approx([-1, 1, 0.25, -1, 0.1])
    notch = Polygon.of([[0, 0], [4, 0], [4, 3], [2, 1], [0, 3]])
    assert notch.distance(np.array([[2.0, 2.0], [2.0, 0.5]])) == pytest.approx([np.sqrt(0.5), -0.5])
    with pytest.raises(InputError, match="not on one line"):
        Polygon.of([[0, 0], [1, 1], [2, 2]])
