"""Regions, lanes and shares: areas of known figures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from planner.jobs.region import Field, lanes, share_covered
from planner.paths.distance import distance_to
from planner.paths.obstacles import Circle, Polygon
from sim.io.errors import InputError

SQUARE = Polygon.of([[0, 0], [4, 0], [4, 3], [0, 3]])


def test_the_raster_has_the_area_of_the_region() -> None:
    field = Field(SQUARE, (Circle(2, 1.5, 0.7),))
    points, cell = field.raster(0.01)
    assert len(points) * cell == pytest.approx(12 - math.pi * 0.49, rel=0.003)
    with pytest.raises(InputError, match="empty"):
        Field(SQUARE, (Circle(2, 1.5, 4),)).raster(0.1)


def test_the_share_is_that_of_a_stadium() -> None:
    """A straight track covers its rectangle and two half discs."""
    share = share_covered(Field(SQUARE), np.array([[1.0, 1.5], [3.0, 1.5]]), 0.6)
    assert share == pytest.approx((2 * 0.6 + math.pi * 0.09) / 12, rel=0.01)


@pytest.mark.parametrize("angle", np.linspace(0, math.pi, 12, endpoint=False))
def test_a_footprint_wider_than_the_region_needs_one_lane(angle: float) -> None:
    """A camera that sees the whole region used to end in a traceback."""
    for width in (5.0, 40.0):
        (lane,) = lanes(Field(SQUARE), width, angle, apart=0.2)
        assert np.hypot(*(lane.mean(0) - [2, 1.5])) < 0.6
        assert share_covered(Field(SQUARE), lane, 2 * width) == 1.0


@pytest.mark.parametrize("angle", [0.0, 0.4, math.pi / 2])
def test_lanes_cover_the_region_and_leave_holes_out(angle: float) -> None:
    field = Field(SQUARE, (Circle(2, 1.5, 0.7),))
    cut = lanes(field, 0.3, angle, apart=0.2)
    along = cut[:, 1] - cut[:, 0]
    assert np.abs(np.sin(np.arctan2(along[:, 1], along[:, 0]) - angle)).max() < 1e-9
    points, _ = field.raster(0.02)
    near = np.min([distance_to(lane, points) for lane in cut], axis=0)
    assert near.max() <= 0.15 + 0.02
    middles = cut.mean(1)
    assert (np.hypot(*(middles - [2, 1.5]).T) > 0.5).all()
    crossed = lanes(field, 0.3, angle, apart=3.0)
    assert len(crossed) < len(cut)
