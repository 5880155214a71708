"""Coverage: what is swept, in what time, by lanes in a good order, also in the simulator and among obstacles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from planner.jobs.cover import cover
from planner.jobs.region import Field, lanes, share_covered
from planner.paths.distance import distance_to
from planner.paths.obstacles import Circle, FreeSpace, Polygon
from planner.planning.declared_path import TIGHTEST
from planner.planning.request import PlanRequest
from sim.io.errors import InputError
from sim.motion.replay import replay
from tests.planner.plans import tracked

FIELD = Field(Polygon.of([[0, 0], [3, 0], [3, 1.5], [0, 1.5]]))
SMALL = Field(Polygon.of([[0, 0], [1, 0], [1, 0.5], [0, 0.5]]))
SQUARE = Polygon.of([[0, 0], [4, 0], [4, 3], [0, 3]])
HOLE = Field(SQUARE, (Circle(2, 1.5, 0.7),))
QUICK = PlanRequest(objective="time")


def test_areas_and_shares_are_those_of_known_figures() -> None:
    """A straight track covers its rectangle and two half discs."""
    points, cell = HOLE.raster(0.01)
    assert len(points) * cell == pytest.approx(12 - math.pi * 0.49, rel=0.003)
    with pytest.raises(InputError, match="empty"):
        Field(SQUARE, (Circle(2, 1.5, 4),)).raster(0.1)
    share = share_covered(Field(SQUARE), np.array([[1.0, 1.5], [3.0, 1.5]]), 0.6)
    assert share == pytest.approx((2 * 0.6 + math.pi * 0.09) / 12, rel=0.01)


@pytest.mark.parametrize("angle", [0.0, 0.7, math.pi / 2, 2.0])
def test_a_footprint_wider_than_the_region_needs_one_lane(angle: float) -> None:
    for width in (5.0, 40.0):
        (lane,) = lanes(Field(SQUARE), width, angle, apart=0.2)
        assert np.hypot(*(lane.mean(0) - [2, 1.5])) < 0.6
        assert share_covered(Field(SQUARE), lane, 2 * width) == 1.0


@pytest.mark.parametrize("angle", [0.0, 0.4, math.pi / 2])
def test_lanes_cover_the_region_and_leave_holes_out(angle: float) -> None:
    cut = lanes(HOLE, 0.3, angle, apart=0.2)
    along = cut[:, 1] - cut[:, 0]
    assert np.abs(np.sin(np.arctan2(along[:, 1], along[:, 0]) - angle)).max() < 1e-9
    points, _ = HOLE.raster(0.04)
    near = np.min([distance_to(lane, points) for lane in cut], axis=0)
    assert near.max() <= 0.15 + 0.02
    assert (np.hypot(*(cut.mean(1) - [2, 1.5]).T) > 0.5).all()
    assert len(lanes(HOLE, 0.3, angle, apart=3.0)) < len(cut)


def test_it_covers_the_region_by_turns_that_the_robot_can_make() -> None:
    """Neither another order of the lanes nor another direction is quicker; the bound is that of its area."""
    swept = cover(FIELD, 0.5, tracked(), QUICK)
    assert swept.share > 0.995
    assert swept.share == share_covered(FIELD, swept.plan.track, 0.5)
    assert 0.5 < swept.sure <= swept.share
    assert swept.plan.declared.curvature * tracked().vehicle.pivot_radius < TIGHTEST
    assert swept.exact
    assert len(swept.lanes) == 5
    assert swept.bound == pytest.approx(4.5 / (0.5 * swept.plan.straight.net_speed), rel=0.01)
    assert swept.plan.duration > swept.bound
    across = cover(FIELD, 0.5, tracked(), QUICK, angle=np.pi / 2)
    assert swept.plan.duration < across.plan.duration
    assert np.ptp(swept.lanes[:, :, 1], axis=1).max() < 1e-9


@pytest.mark.parametrize(("share", "proposed"), [(0.8, "80.0 % if a camera"), (0.0, "give more than")])
def test_what_is_not_certain_without_a_camera_proposes_one(share: float, proposed: str) -> None:
    swept = cover(SMALL, 0.5, tracked(), QUICK)
    assert swept.sure <= swept.sure_tracked <= swept.share
    said = replace(swept, sure=0.0, sure_tracked=share).lines()[1]
    assert "0.0 % wherever the robot is within the stated error" in said
    assert proposed in said
    assert "--feedback" in said
    assert "--feedback" not in replace(swept, sure=0.9, sure_tracked=0.9).lines()[1]


def test_lanes_are_in_the_quickest_order() -> None:
    """Neighbouring lanes one after another would need wider loops than this robot's turns."""
    swept = cover(Field(Polygon.of([[0, 0], [4, 0], [4, 3], [0, 3]])), 0.4, tracked(), QUICK)
    steps = np.abs(np.diff(swept.lanes[:, 0, 1]))
    assert np.median(steps) > 0.6


@pytest.mark.rest
def test_keep_outs_are_not_touched() -> None:
    rock = Circle(1.5, 0.8, 0.2)
    swept = cover(replace(FIELD, holes=(rock,)), 0.5, tracked(), PlanRequest(), FreeSpace((rock,)))
    kept = swept.plan.kept_clear
    assert kept is not None
    assert kept.clearance > 0
    assert kept.margin >= swept.plan.stated_error
    assert swept.share > 0.85


@pytest.mark.rest
def test_the_simulator_covers_the_same() -> None:
    swept = cover(FIELD, 0.5, tracked(), QUICK)
    track = replay([swept.plan.schedule()])[0][["x_over_l", "y_over_l"]].to_numpy(float)
    assert share_covered(FIELD, track, 0.5) == pytest.approx(swept.share, abs=0.02)
    assert share_covered(FIELD, track, 0.5) >= swept.sure


def test_refusals() -> None:
    with pytest.raises(InputError, match="zigzag alone"):
        cover(FIELD, 0.04, tracked(), PlanRequest())
    with pytest.raises(InputError, match="more than 80 lanes"):
        cover(Field(Polygon.of([[0, 0], [60, 0], [60, 60], [0, 60]])), 0.5, tracked(), PlanRequest())
    with pytest.raises(InputError, match="no lane of the region is clear"):
        cover(FIELD, 0.5, tracked(), PlanRequest(), FreeSpace((), FIELD.outline))
