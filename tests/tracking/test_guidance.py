"""The tracker's guidance: a reference that changes with the learned drift, and the way back from anywhere."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from planner.guidance.law import REST, project
from planner.jobs.plan import plan
from planner.paths.dubins import shortest_paths
from planner.paths.tractrix import Drift
from planner.planning.plan import Plan
from planner.planning.request import Camera
from planner.vehicle.zigzag import Objective
from sim.mechanics.planar import POSE
from sim.model.presets import PRESETS
from tests.planner.plans import CONTROL, planned
from tests.planner.vehicles import PROMPT, root_mean_square
from tracking.guidance import MOST_LEFT_OUT, TrackerGuidance, shortest_way
from tracking.swim import Swim, swim
from tracking.tracker import Tracker
from tracking.tracks import check

pytestmark = pytest.mark.slow

CURRENT = (0.0, 0.0015)  # l per time unit, a tenth of the net speed
IN_LAB = (0.0, 0.0015 * CONTROL.tail_length / CONTROL.time_scale)
ON_PATH = 0.08  # l


def eight() -> Plan:
    return planned("eight", minimum_dwell=0.7)


def test_a_learned_current_is_used() -> None:
    """Soon the error is that of a plan that knows the current."""
    truth, known = replace(eight().tracked.vehicle, current=np.array(CURRENT)), in_current()
    learning = swim(Tracker(eight()), truth, PROMPT).distance
    knowing = swim(Tracker(known), truth, PROMPT).distance
    half = len(learning) // 2
    assert root_mean_square(knowing) < 0.015
    assert root_mean_square(learning[half:]) < 1.2 * root_mean_square(knowing)
    assert root_mean_square(learning) < 1.5 * root_mean_square(knowing)


def in_current() -> Plan:
    return planned("eight", current=IN_LAB, minimum_dwell=0.7)


def test_a_drift_that_the_plan_knows_does_not_turn_the_reference() -> None:
    guidance = TrackerGuidance(in_current())
    for place in (50, 200, 350):
        guidance.state = guidance.state._replace(step=place)
        guidance.integrate(in_current().start, 1)
    assert guidance._law.lean == pytest.approx(0.0, abs=1e-15)


def test_a_way_is_followed_in_the_current_that_the_plan_knows() -> None:
    """Before anything is learned; told of the same drift, the guidance steers the same."""
    x, y, heading = in_current().start
    away = x + 0.8, y, heading + 1.0
    guidance, told = TrackerGuidance(in_current()), TrackerGuidance(in_current())
    told.update_drift(told._planned)
    dwells = []
    for each in (guidance, told):
        each.plan_way(away)
        dwells.append(each.next_dwell(away, each.first_turn or 1, REST)[0])
    assert dwells[0] == dwells[1]


def test_on_a_straight_line_the_reference_turns_against_the_slip() -> None:
    """The other side: the robot heads into the current by the angle at which the two velocities add up."""
    guidance = TrackerGuidance(planned(((0.0, 0.0), (12.0, 0.0)), objective="flips"))
    guidance.update_drift(Drift(0.0, (0.0, 0.2)))
    for x in np.linspace(0, 11, 300):
        guidance.integrate((float(x), 0.0, 0.0), 1)
    assert math.sin(-guidance._law.lean) == pytest.approx(0.2, rel=1e-3)


def within(plan: Plan, tracker: Tracker, camera: Camera, rng: Any, current: float) -> np.ndarray:
    """Swim as a vehicle within the plan's uncertainty, in a current; tell when its error is the told one."""
    angle = rng.uniform(0, 2 * math.pi)
    car = plan.tracked.vehicle.drawn(rng)
    car = replace(car, current=current * np.array([math.cos(angle), math.sin(angle)]))
    result = swim(tracker, car, camera)
    return result.distance <= result.errors


@pytest.mark.parametrize(("current", "robots"), [(0.001, 2), pytest.param(0.0, 3, marks=pytest.mark.rest)])
def test_the_robot_is_as_near_to_its_path_as_the_tracker_says(current: float, robots: int) -> None:
    rng = np.random.default_rng(3)
    cameras = [replace(PROMPT, seed=seed) for seed in range(robots)]
    near = [within(eight(), Tracker(eight()), camera, rng, current) for camera in cameras]
    assert 0.9 < np.concatenate(near).mean() < 0.98


@pytest.mark.rest
@pytest.mark.parametrize(("robot", "objective"), [("paper-control", "flips"), ("paper-triangle", "error")])
def test_the_same_where_the_swings_are_large(robot: str, objective: Objective) -> None:
    share = np.linspace(0, 1, 200)
    wave = np.stack([6 * share, 0.8 * np.sin(7.5 * share)], 1)
    result, rng, near = plan(wave, PRESETS[robot], objective=objective), np.random.default_rng(4), []
    for current in (0.0, 0.001) * 4:
        near.append(within(result, Tracker(result), replace(PROMPT, seed=rng), rng, current))
    assert 0.9 < np.concatenate(near).mean() < 0.98


def swim_from(start: Any, camera: Camera, *, told: bool = False) -> Swim:
    tracker = Tracker(eight(), start=start if told else None)
    return swim(tracker, eight().tracked.vehicle, camera, start=start, longest=10)


def time_back(result: Swim) -> float:
    """Return when the robot was on the path for good."""
    return float(result.times[np.flatnonzero(result.distance > ON_PATH)[-1] + 1])


def best_time(start: Any) -> float:
    """Return the time of the best of the shortest Dubins tracks to all poses of the path."""
    planned, reference = eight(), eight().declared.reference
    vehicle, (x, y, heading) = planned.tracked.vehicle, start
    a = vehicle.pivot_distance
    goals = np.column_stack([reference.q, reference.heading])
    pivot = np.array([x - a * math.cos(heading), y - a * math.sin(heading), heading])
    ways = shortest_paths(np.repeat(pivot[None], len(goals), 0), goals, vehicle.pivot_radius)
    speed = np.where(ways.turns == 0, planned.straight.net_speed, np.abs(vehicle.twist[:, 0]).max())
    return float((ways.lengths / speed).sum(1).min())


@pytest.mark.parametrize("side", [1, pytest.param(-1, marks=pytest.mark.rest)])
def test_a_robot_beside_the_start_arrives(side: int) -> None:
    x, y, heading = eight().start
    start = x - side * math.sin(heading), y + side * math.cos(heading), heading
    result = swim_from(start, replace(PROMPT, wrong=0.1))
    assert result.finished
    assert result.distance[len(result.distance) // 2 :].max() < ON_PATH


@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(5), marks=pytest.mark.rest)], ids=["one", "five"])
def test_from_anywhere_it_is_back_in_little_more_than_the_least_time(seeds: range) -> None:
    rng, ratios = np.random.default_rng(8), []
    for seed in seeds:
        r, angle = 5 * math.sqrt(rng.random()), rng.uniform(0, 2 * math.pi)
        x, y, _ = eight().start
        start = x + r * math.cos(angle), y + r * math.sin(angle), rng.uniform(-math.pi, math.pi)
        result = swim_from(start, replace(PROMPT, seed=seed), told=seed % 2 == 0)
        assert result.finished
        assert result.distance[-1] < ON_PATH
        ratios.append(time_back(result) / best_time(start))
    assert np.median(ratios) < 1.1


def test_the_way_leads_to_the_target_and_is_short() -> None:
    targets = np.stack([np.linspace(0, 9, 901), np.zeros(901), np.zeros(901)], 1)
    track, target = shortest_way((4.0, 1.5, math.pi / 2), targets, np.linspace(0, 9, 901), 18, 0.4)
    way = TrackerGuidance(eight())._way_of(track)
    last = way[-1]
    x, y, _ = targets[target]
    assert project(last, x, y, last.length) == pytest.approx((last.length, 0.0), abs=1e-9)
    assert math.remainder(last.course + last.curvature * last.length, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert sum(segment.length for segment in way) < 1.5 + math.pi * 0.4 + 0.5


@dataclass(frozen=True)
class Mistaken(Camera):
    """It takes another robot, on the same path forty flips behind, for this one, from a time on."""

    after: float = math.inf

    def sees(self, pose: POSE, time: float, rng: np.random.Generator) -> POSE | None:
        if time > self.after:
            times = np.concatenate([[0.0], np.cumsum(eight().dwells)])
            pose = tuple(eight().poses[max(int(np.searchsorted(times, time)) - 41, 0)].tolist())
        return super().sees(pose, time, rng)


def test_the_poses_of_another_robot_are_an_alarm_and_no_path() -> None:
    """The motor flips by the plan, and does not steer the other robot."""
    result = swim_from(eight().start, Mistaken(delay_s=0.0, lost=0.0, after=200.0))
    assert 200 < result.alarms[0] < 215
    straight = result.times < 230
    assert result.distance[straight].max() < ON_PATH


@pytest.mark.parametrize("turns", [1.0, 1.05])
def test_the_tracker_ends_a_lap_near_the_own_turn_circle_at_its_end(turns: float) -> None:
    """A robot that turns a little more tightly than planned has its lap ended after a lap, too."""
    result = planned("circle:0.95l", objective="flips")
    vehicle = result.tracked.vehicle
    swum = swim(result, replace(vehicle, twist=vehicle.twist * np.array([1.0, 1.0, turns])))
    angle = np.unwrap(np.arctan2(*swum.poses[:, 1::-1].T))
    assert swum.finished
    assert angle[-1] - angle[0] == pytest.approx(2 * math.pi, rel=0.1)
    assert swum.missed < 0.1


def test_what_was_not_swum_is_said_first() -> None:
    result = planned("circle:1.2l", objective="flips")
    swum = swim(result, longest=0.5)
    assert "under a tracker: MISSED a part of the declared path: it is up to" in repr(swum)
    assert check(result, swum.to_frame()).line.startswith("MISSED a part of the declared path")
    assert check(result, swim(result).to_frame()).line.startswith("tracking error")


def test_ways_back_leave_out_a_tenth_of_a_lap_at_most() -> None:
    """The end of a closed path is near its beginning, but not the way to take from there."""
    result = planned("circle:1.2l", objective="flips")
    guidance, arc, (x, y, heading) = TrackerGuidance(result), result.declared.reference.arc, result.start
    for _ in range(4):
        guidance.plan_way((x + 0.5, y, heading + math.pi))
    assert arc[guidance.state.step] <= MOST_LEFT_OUT * arc[-1]
