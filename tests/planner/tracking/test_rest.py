"""The rest of a plan: it begins where the robot is, joins the path, and ends where the path ends."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from planner.jobs.clear_plan import plan_clear
from planner.paths.distance import distance_to
from planner.paths.obstacles import Circle, Footprint, FreeSpace
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.tracking.rest import Rest, rest_of
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from planner.vehicle.rollout import predicted_poses
from planner.vehicle.tracked_point import tracked_vehicle
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.motion.replay import replay
from tests.planner.vehicles import PROMPT, root_mean_square

ROBOT = PRESETS["paper-control"]
ROCK = FreeSpace((Circle(3.0, 0.2, 0.5),))


@cache
def made(name: str) -> Plan:
    if name == "rock":
        line = Path2D.of([[0.0, 0.0], [6.0, 0.0]])
        return plan_clear(line, tracked_vehicle(ROBOT, None, "head_centre", None), PlanRequest(dwell=1.6), ROCK)
    if name == "head tip":
        return plan([[0, 0], [4, 0], [4, 4]], ROBOT, minimum_dwell=0.8, point="head_tip")
    return plan(circle(2.0) if name == "circle" else polygon(4, 3.0), ROBOT, minimum_dwell=0.8)


def rest(name: str, share: float, *moved: float) -> Rest:
    """Follow a share of the dwells; then move the robot, within 10 time units."""
    result = made(name)
    count = round(share * len(result.dwells))
    times = np.concatenate([[0.0], np.cumsum(result.dwells[:count])])
    poses = result.poses[: count + 1]
    if moved:
        times, poses = np.append(times, times[-1] + 10.0), np.vstack([poses, poses[-1] + moved])
    return rest_of(result, times, poses)


def end_error(name: str, after: Plan) -> float:
    """Compute the distance of the predicted track's end from that of the path."""
    return float(np.hypot(*(after.track[-1] - made(name).reference[-1])))


@pytest.mark.parametrize("name", ["circle", "square", "head tip"])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_robot_on_its_path_goes_on(name: str, share: float) -> None:
    result, after = made(name), rest(name, share)
    assert after.way == 0
    count = len(result.dwells) - round(share * len(result.dwells))
    assert len(after.plan.dwells) == pytest.approx(count, abs=3)
    assert after.plan.predicted_max < 1.5 * result.predicted_max + 0.01
    assert end_error(name, after.plan) < 0.04
    assert distance_to(result.reference, after.plan.reference).max() < 1e-9


@pytest.mark.parametrize("name", ["circle", "square", "head tip"])
@pytest.mark.parametrize("moved", [(0.3, -0.5, 0.8), (-2.0, 1.0, 3.0), (0.0, 0.0, 3.1), (6.0, 6.0, 100.0)])
def test_a_robot_that_was_moved_finds_back(name: str, moved: tuple[float, float, float]) -> None:
    result, after = made(name), rest(name, 0.3, *moved)
    count = round(0.3 * len(result.dwells))
    expected = result.poses[count] + moved
    assert after.plan.poses[0, :2] == pytest.approx(expected[:2])
    assert np.cos(after.plan.poses[0, 2] - expected[2]) == pytest.approx(1.0)
    assert after.way > 0.1
    assert after.left_out < 3.0
    assert after.plan.predicted_max < 1.5 * result.predicted_max + 0.015
    assert end_error(name, after.plan) < 1.5 * result.predicted_max + 0.015
    joined = after.plan.reference[-(len(after.plan.reference) // 4) :]
    assert distance_to(result.reference, joined).max() < 1e-9
    assert after.plan.declared.missed < result.declared.missed + 0.02


def test_the_rest_in_the_simulator_ends_where_the_path_ends() -> None:
    after = rest("square", 0.8, 0.3, -0.5, 0.8).plan
    track = replay([after.schedule()])[0]
    end = track[["x_over_l", "y_over_l"]].iloc[-1].to_numpy()
    assert np.hypot(*(end - made("square").reference[-1])) < after.stated_error + 0.02


def test_the_rest_is_tracked_like_any_plan() -> None:
    after = rest("square", 0.5, -2.0, 1.0, 3.0).plan
    distance = swim(Tracker(after), after, after.tracked.vehicle, PROMPT).distance
    assert root_mean_square(distance) < 0.03


@pytest.mark.parametrize("moved", [(), (-0.3, 0.6, 0.5)])
def test_the_way_back_keeps_clear_of_obstacles(moved: tuple[float, ...]) -> None:
    after = rest("rock", 0.3, *moved).plan
    body = Footprint.of(ROBOT, 0.0)
    clearance = body.clearance(predicted_poses(after.tracked.vehicle, after.switches), ROCK).min()
    assert after.kept_clear is not None
    assert 0 < after.kept_clear.clearance == pytest.approx(clearance)
    assert end_error("rock", after) < 0.1


def test_a_robot_inside_of_an_obstacle_is_told() -> None:
    with pytest.raises(InputError, match="at the start") as caught:
        rest("rock", 0.0, 3.0, 0.2, 0.0)
    assert "\n" not in str(caught.value)


def test_nothing_is_left_at_the_end() -> None:
    with pytest.raises(InputError, match="followed the path to its end"):
        rest("square", 1.0)
