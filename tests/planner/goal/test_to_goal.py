"""From a pose to a pose: it ends at the goal, in nearly the least time, and keeps out of what it must."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.files.plan_json import load_plan
from planner.goal.goal_plan import GoalPlan
from planner.goal.route import NoWayError
from planner.goal.to_goal import to_goal
from planner.paths.obstacles import Circle, Polygon
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.rollout import Switches, poses_at_flips
from sim.io.errors import InputError
from sim.mechanics import planar
from sim.model.presets import PRESETS
from surrogate.one_robot.tabulate import tabulate
from tests.oracles.quickest import brute_force
from tests.oracles.random_tasks import goal_behind_circles, random_goal, replayed_clearance

CONTROL = PRESETS["paper-control"]


BOX = [[-2, -4], [9, -4], [9, 4], [-2, 4]]


def final_pose(goal_plan: GoalPlan) -> np.ndarray:
    """Compute the end of the schedule from the start that was asked for, anew."""
    plan = goal_plan.plan
    return poses_at_flips(
        plan.tracked.vehicle, Switches(plan.first_direction, plan.dwells, np.array([plan.start]))
    )[-1]


@pytest.mark.parametrize("seed", range(6))
def test_the_motion_begins_and_ends_as_asked(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, goal = (rng.uniform([-2, -2, -3], [2, 2, 3]).tolist() for _ in range(2))
    goal_plan = to_goal(start, goal, CONTROL, objective=("time", "error")[seed % 2])
    assert goal_plan.plan.start == pytest.approx(tuple(start))
    end = final_pose(goal_plan)
    assert end[:2] == pytest.approx(goal[:2], abs=1e-3)
    assert math.cos(end[2] - goal[2]) > 1 - 1e-6
    assert max(goal_plan.end_error) < 1e-3
    assert goal_plan.plan.dwells.min() >= goal_plan.plan.minimum_dwell * (1 - 1e-9)


@pytest.mark.rest
@pytest.mark.parametrize("seed", [2, *(pytest.param(seed, marks=pytest.mark.rest) for seed in (1, 6))])
def test_time_is_within_5_percent_of_brute_force(seed: int) -> None:
    goal = random_goal(np.random.default_rng(seed))
    goal_plan = to_goal((0, 0, 0), goal, CONTROL)
    assert goal_plan.plan.duration < 1.05 * brute_force(goal_plan.plan.tracked.vehicle, goal)


def test_a_plan_to_a_goal_gives_no_guarantee_and_is_read_again(tmp_path: Path) -> None:
    """The guaranteed bound is for paths with wider turns."""
    plan = to_goal((0, 0, 0), (2, 1.5, 2.0), CONTROL).plan
    assert plan.errors.guaranteed is None
    (tmp_path / "plan.json").write_text(json.dumps(plan.to_dict()))
    assert load_plan(tmp_path / "plan.json")["guaranteed_error_over_l"] is None


def test_moved_and_mirrored_tasks_give_moved_and_mirrored_plans() -> None:
    one = to_goal((0, 0, 0), (2, 1.5, 2.0), CONTROL)
    mirrored = to_goal((0, 0, 0), (2, -1.5, -2.0), CONTROL)
    assert mirrored.plan.dwells == pytest.approx(one.plan.dwells, rel=1e-4)
    assert mirrored.plan.first_direction == -one.plan.first_direction
    frame = np.array([3.0, -1.0, 0.7])
    moved = to_goal(frame.tolist(), planar.compose(frame, np.array([2, 1.5, 2.0])).tolist(), CONTROL)
    assert moved.plan.duration == pytest.approx(one.plan.duration, rel=1e-3)


def test_a_robot_that_turns_unequally_in_a_current_arrives() -> None:
    robot = replace(CONTROL, effects={"left_right_bias": 0.2})
    drifting = CalibrationKnowledge(current=(2e-5, -1e-5))
    goal_plan = to_goal((0, 0, 0.3), (3, 2, -1), robot, lookup=tabulate(robot), knowledge=drifting)
    assert np.abs(goal_plan.plan.tracked.vehicle.current).max() > 0
    assert final_pose(goal_plan)[:2] == pytest.approx([3, 2], abs=1e-3)


def test_a_shortest_dwell_in_seconds_holds_to_the_end() -> None:
    goal_plan = to_goal((0, 0, 0), (2, 2, 1), CONTROL, minimum_seconds=4.0)
    assert goal_plan.plan.seconds.min() >= 4.0 * (1 - 1e-9)
    assert max(goal_plan.end_error) < 1e-3


def test_it_passes_places_on_the_way() -> None:
    goal_plan = to_goal((0, 0, 0), (0, 3, math.pi), CONTROL, via=[(2, 1), (2, 3)], objective="error")
    for place in goal_plan.via:
        assert np.hypot(*(goal_plan.plan.declared.reference.q - place).T).min() < 0.02


def test_the_margin_is_the_stated_error() -> None:
    goal_plan = to_goal((0, 0, 0), (6, 0, 0), CONTROL, keep_out=[Circle(3, 0, 0.8)], walls=BOX)
    assert goal_plan.plan.stated_error <= goal_plan.margin
    assert goal_plan.clearance > 0
    direct = to_goal((0, 0, 0), (6, 0, 0), CONTROL)
    assert goal_plan.length > direct.length * 1.02


@pytest.mark.rest
def test_a_narrow_gap_is_passed_with_shorter_dwells() -> None:
    """With four tails: with two, the phase of the disc makes the stated error wider than the gap."""
    robot = PRESETS["paper-triangle"]
    gate = [Polygon.of([[2, low], [2.5, low], [2.5, high], [2, high]]) for low, high in ((-4, -0.3), (0.3, 4))]
    goal_plan = to_goal((0, 0, 0), (6, 0, 0), robot, keep_out=gate, walls=BOX)
    wide = to_goal((0, 0, 0), (6, 0, 0), robot, walls=BOX)
    assert goal_plan.plan.stated_error < 0.6 * wide.plan.stated_error
    assert len(goal_plan.plan.dwells) > len(wide.plan.dwells)


@pytest.mark.rest
@pytest.mark.parametrize("seed", [3, pytest.param(0, marks=pytest.mark.rest)])
def test_a_replay_in_the_simulator_stays_out(seed: int) -> None:
    goal_plan = to_goal(robot=CONTROL, **goal_behind_circles(np.random.default_rng(seed)))
    clearance, off, turned = replayed_clearance(goal_plan)
    assert clearance > 0
    assert off < goal_plan.plan.stated_error
    assert turned < 0.1


def test_refusals() -> None:
    with pytest.raises(NoWayError, match=r"at the start, .* what it must keep out of"):
        to_goal((0, 0, 0), (5, 0, 0), CONTROL, keep_out=[Circle(0.2, 0, 0.5)])
    with pytest.raises(InputError, match="goal: give x, y and heading"):
        to_goal((0, 0, 0), (5, 0), CONTROL)
    with pytest.raises(InputError, match="as finite numbers"):
        to_goal((0, math.nan, 0), (5, 0, 0), CONTROL)
    with pytest.raises(InputError, match="start and goal are the same"):
        to_goal((1, 1, 0.5), (1, 1, 0.5), CONTROL)
    with pytest.raises(InputError, match=r"tolerance 0.11 mm \(0.001 l\) cannot be kept"):
        to_goal((0, 0, 0), (3, 0, 0), CONTROL, tolerance=0.001)
    with pytest.raises(InputError, match="radius above 0"):
        Circle(0, 0, -1)


def test_a_heading_in_degrees_is_not_taken_as_radians() -> None:
    """90 used to be taken as 90 rad, which is 117 degrees, without a word."""
    with pytest.raises(InputError, match=r"goal: a heading of 90 is more than one turn; .* math\.radians\(90\)"):
        to_goal((0, 0, 0), (4, 1, 90), CONTROL)
    with pytest.raises(InputError, match="start: a heading of -30"):
        to_goal((0, 0, -30), (4, 1, 0), CONTROL)


@pytest.mark.parametrize("share", [pytest.param(1.2, marks=pytest.mark.rest)])
def test_a_plan_to_a_goal_arrives_when_it_is_asked_to(share: float) -> None:
    fastest = to_goal((0, 0, 0), (2.5, 1, 0), CONTROL, minimum_dwell=2.0)
    seconds = share * float(fastest.plan.seconds.sum())
    goal_plan = to_goal((0, 0, 0), (2.5, 1, 0), CONTROL, minimum_dwell=2.0, arrive_seconds=seconds)
    dwell = min(goal_plan.plan.straight.dwells) * CONTROL.time_scale
    assert float(goal_plan.plan.seconds.sum()) == pytest.approx(seconds, abs=dwell)
    assert goal_plan.plan.declared.swing is not None
    assert max(goal_plan.end_error) < 1e-3
    assert final_pose(goal_plan)[:2] == pytest.approx((2.5, 1.0), abs=1e-3)


def test_no_plan_to_a_goal_is_faster_than_the_fastest() -> None:
    with pytest.raises(InputError, match="the fastest plan takes"):
        to_goal((0, 0, 0), (2.5, 1, 0), CONTROL, minimum_dwell=2.0, arrive_seconds=30.0)
