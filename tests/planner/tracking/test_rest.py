"""The rest of a plan: what a track has reached; it begins where the robot is, and ends where the path ends."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from planner.paths.distance import distance_to
from planner.paths.obstacles import Footprint
from planner.paths.path import Path2D, circle
from planner.paths.tractrix import Reference, reference
from planner.planning.plan import Plan
from planner.tracking.rest import Remainder, reached, rest_of
from planner.vehicle.vehicle import roll_out
from sim.arrays import Floats, Integers
from sim.io.errors import InputError
from sim.motion.replay import replay
from tests.planner.plans import CONTROL, CORNER, ROCK, around, planned

PLANS: dict[str, Callable[[], Plan]] = {
    "circle": lambda: planned("circle:2l", minimum_dwell=0.8),
    "square": lambda: planned("square:3l", minimum_dwell=0.8),
    "head tip": lambda: planned(CORNER, point="head_tip", minimum_dwell=0.8),
    "around": around,
    "rock": lambda: around(dwell=1.6),
}


def rest(name: str, share: float, *moved: float) -> Plan[Remainder]:
    """Follow a share of the dwells; then move the robot, within 10 time units."""
    result = PLANS[name]()
    count = round(share * len(result.dwells))
    times = np.concatenate([[0.0], np.cumsum(result.dwells[:count])])
    poses = result.poses[: count + 1]
    if moved:
        times, poses = np.append(times, times[-1] + 10.0), np.vstack([poses, poses[-1] + moved])
    return rest_of(result, times, poses)


def end_error(name: str, after: Plan) -> float:
    """Compute the distance of the predicted track's end from that of the path."""
    return float(np.hypot(*(after.track[-1] - PLANS[name]().reference[-1])))


@pytest.mark.parametrize(("name", "share"), [("circle", 0.0), ("circle", 0.9), ("square", 0.3), ("head tip", 0.3)])
def test_a_robot_on_its_path_goes_on(name: str, share: float) -> None:
    result, after = PLANS[name](), rest(name, share)
    assert after.job.way == 0
    count = len(result.dwells) - round(share * len(result.dwells))
    assert len(after.dwells) == pytest.approx(count, abs=3)
    assert after.predicted_max < 1.5 * result.predicted_max + 0.01
    assert end_error(name, after) < 0.04
    assert distance_to(result.reference, after.reference).max() < 1e-9


@pytest.mark.parametrize(
    ("name", "moved"),
    [
        ("circle", (-2.0, 1.0, 3.0)), ("square", (0.3, -0.5, 0.8)), ("square", (6.0, 6.0, 100.0)),
        ("head tip", (0.0, 0.0, 3.1)),
    ],
)  # fmt: skip
def test_a_robot_that_was_moved_finds_back(name: str, moved: tuple[float, float, float]) -> None:
    result, after = PLANS[name](), rest(name, 0.3, *moved)
    count = round(0.3 * len(result.dwells))
    expected = result.poses[count] + moved
    assert after.poses[0, :2] == pytest.approx(expected[:2])
    assert np.cos(after.poses[0, 2] - expected[2]) == pytest.approx(1.0)
    assert after.job.way > 0.1
    assert after.job.left_out < 3.0
    assert after.predicted_max < 1.5 * result.predicted_max + 0.015
    assert end_error(name, after) < 1.5 * result.predicted_max + 0.015
    joined = after.reference[-(len(after.reference) // 4) :]
    assert distance_to(result.reference, joined).max() < 1e-9
    assert after.declared.missed < result.declared.missed + 0.02


def test_the_rest_in_the_simulator_ends_where_the_path_ends() -> None:
    after = rest("square", 0.92, 0.3, -0.5, 0.8)
    track = replay(after.schedule())
    end = track[["x_over_l", "y_over_l"]].iloc[-1].to_numpy()
    assert np.hypot(*(end - PLANS["square"]().reference[-1])) < after.stated_error + 0.02


@pytest.mark.parametrize(
    ("name", "moved"), [("around", ()), pytest.param("rock", (-0.3, 0.6, 0.5), marks=pytest.mark.rest)]
)
def test_the_way_back_keeps_clear_of_obstacles(name: str, moved: tuple[float, ...]) -> None:
    after = rest(name, 0.3, *moved)
    body = Footprint.of(CONTROL, 0.0)
    clearance = body.clearance(roll_out(after.tracked.vehicle, after.switches).poses, ROCK).min()
    assert after.kept_clear is not None
    assert 0 < after.kept_clear.clearance == pytest.approx(clearance)
    assert end_error(name, after) < 0.1


@pytest.mark.parametrize(
    ("name", "share", "moved", "expected"),
    [("around", 0.0, (2.5, 0.2, 0.0), "at the start"), ("square", 1.0, (), "followed the path to its end")],
)
def test_a_robot_inside_an_obstacle_or_at_the_end_is_told(
    name: str, share: float, moved: tuple[float, ...], expected: str
) -> None:
    with pytest.raises(InputError, match=expected) as caught:
        rest(name, share, *moved)
    assert "\n" not in str(caught.value)


SPEED = 0.1  # l per time unit


def followed(along: Reference, first: int, last: int, count: int = 200) -> tuple[Floats, Floats]:
    """Return times and poses of a pivot that follows a part of a reference, with the noise of a camera."""
    rows = np.linspace(first, last, count).round().astype(int)
    noise = np.random.default_rng(0).normal(0, 0.02, (count, 3))
    poses = np.column_stack([along.q[rows], along.heading[rows]]) + noise
    poses[:, 2] = (poses[:, 2] + math.pi) % (2 * math.pi) - math.pi
    return along.arc[rows] / (0.5 * SPEED), poses


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.97])
@pytest.mark.parametrize("first", [0.0, 0.4])
def test_a_closed_path_is_followed_from_its_start(share: float, first: float) -> None:
    """Start and end are one place, and the track may begin later."""
    along = reference(circle(2.0), 0.9, 0.02)
    count = len(along.q) - 1
    begin, end = round(first * count), round(max(share, first) * count)
    times, poses = followed(along, begin, end)
    assert reached(along, times, poses, SPEED) == pytest.approx(end, abs=5)


LANES = Path2D.of([[0, 0], [6, 0], [6, 0.5], [0, 0.5], [0, 1], [6, 1], [6, 1.5], [0, 1.5]])


def test_a_robot_that_was_carried_to_another_lane_has_not_followed_those_between() -> None:
    along = reference(LANES, 0.0, 0.02)
    end = round(0.3 * len(along.q))
    times, poses = followed(along, 0, end)
    target = round(0.9 * len(along.q))
    carried = np.append(along.q[target], along.heading[target])
    times = np.append(times, times[-1] + np.array([5.0, 5.1, 5.2]))
    place = reached(along, times, np.vstack([poses, carried, carried, carried]), SPEED)
    assert along.arc[place] - along.arc[end] < 5.2 * 1.5 * SPEED + 0.1


def test_one_pose_leads_to_the_nearest_part_of_the_path_that_is_worth_it() -> None:
    along = reference(LANES, 0.0, 0.02)
    place = reached(along, np.zeros(1), np.array([[3.0, 0.02, 0.0]]), SPEED)
    assert along.q[place] == pytest.approx([3.0, 0.0], abs=0.05)


@pytest.mark.parametrize(
    ("share", "count", "kept", "faster"),
    [(0.5, 200, np.r_[:40, 160:200], 1.0), (0.9, 50, np.arange(50), 2.8)],
    ids=["gap", "fast"],
)
def test_gaps_are_bridged_and_fast_robots_followed(
    share: float, count: int, kept: Integers, faster: float
) -> None:
    """A robot may be faster than its model: by 1.4 here, as its track is of half the speed."""
    along = reference(LANES, 0.0, 0.02)
    end = round(share * len(along.q))
    times, poses = followed(along, 0, end, count)
    assert reached(along, times[kept] / faster, poses[kept], SPEED) == pytest.approx(end, abs=5)
