"""The way back: from anywhere to the remaining path, near the shortest time; moved robots and other robots."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from planner.goal.dubins import shortest_paths
from planner.paths.path import Path2D
from planner.planning.camera import POSE, Camera
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.tracking.swim import Swim, swim
from planner.tracking.tracker import Tracker
from planner.tracking.way_back import Segment, shortest_way
from sim.model.presets import PRESETS
from tests.planner.vehicles import PROMPT

ON_PATH = 0.08  # l


@cache
def eight() -> Plan:
    t = np.linspace(0, 2 * math.pi, 401)[:-1]
    path = Path2D.of(np.stack([2.05 * np.sin(t), 1.13 * np.sin(2 * t)], 1), closed=True)
    return plan(path, PRESETS["paper-control"], minimum_dwell=0.7)


def swim_from(start: Any, camera: Camera, *, told: bool = False) -> Swim:
    tracker = Tracker(eight(), start=start if told else None)
    return swim(tracker, eight(), eight().tracked.vehicle, camera, start=start, longest=10)


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


@pytest.mark.parametrize("side", [1, -1])
def test_a_robot_beside_the_start_arrives(side: int) -> None:
    """From one side it never did."""
    x, y, heading = eight().start
    start = x - side * math.sin(heading), y + side * math.cos(heading), heading
    result = swim_from(start, replace(PROMPT, wrong=0.1))
    assert result.finished
    assert result.distance[len(result.distance) // 2 :].max() < ON_PATH


def test_from_anywhere_it_is_back_in_little_more_than_the_least_time() -> None:
    rng, ratios = np.random.default_rng(8), []
    for seed in range(5):
        r, angle = 5 * math.sqrt(rng.random()), rng.uniform(0, 2 * math.pi)
        x, y, _ = eight().start
        start = x + r * math.cos(angle), y + r * math.sin(angle), rng.uniform(-math.pi, math.pi)
        result = swim_from(start, replace(PROMPT, seed=seed), told=seed % 2 == 0)
        assert result.finished
        assert result.distance[-1] < ON_PATH
        ratios.append(time_back(result) / best_time(start))
    assert np.median(ratios) < 1.1


def test_an_arc_is_followed_through_more_than_half_a_turn() -> None:
    arc = Segment(1.0, 2.0, 0.3, -2.0, 3.0)
    for along in np.linspace(0, 3.0, 13):
        end = 0.3 - 2 * along
        x = 1.0 + (math.sin(end) - math.sin(0.3)) / -2
        y = 2.0 - (math.cos(end) - math.cos(0.3)) / -2
        # 0.1 to the left, which is outside on an arc to the right
        progress, error = arc.project(x - 0.1 * math.sin(end), y + 0.1 * math.cos(end), along - 0.4)
        assert (progress, error) == pytest.approx((along, 0.1))


def test_the_way_leads_to_the_target_and_is_short() -> None:
    targets = np.stack([np.linspace(0, 9, 901), np.zeros(901), np.zeros(901)], 1)
    way = shortest_way((4.0, 1.5, math.pi / 2), targets, np.linspace(0, 9, 901), 18, 0.4)
    last = way.segments[-1]
    x, y, _ = targets[way.target]
    ends = [last.project(x, y, last.length)]
    assert ends[0] == pytest.approx((last.length, 0.0), abs=1e-9)
    assert math.remainder(way.course, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert sum(segment.length for segment in way.segments) < 1.5 + math.pi * 0.4 + 0.5


@dataclass(frozen=True)
class Mistaken(Camera):
    """It takes another robot, on the same path forty flips behind, for this one, at random or from a time on."""

    share: float = 0.0
    after: float = math.inf

    def sees(self, pose: POSE, time: float, rng: np.random.Generator) -> POSE | None:
        if rng.random() < self.share or time > self.after:
            times = np.concatenate([[0.0], np.cumsum(eight().dwells)])
            pose = tuple(eight().poses[max(int(np.searchsorted(times, time)) - 41, 0)].tolist())
        return super().sees(pose, time, rng)


def test_now_and_then_another_robot_does_no_harm() -> None:
    result = swim_from(eight().start, Mistaken(delay_s=0.0, lost=0.0, share=0.1, seed=5))
    assert result.finished
    assert result.distance.max() < ON_PATH


def test_the_poses_of_another_robot_are_an_alarm_and_no_path() -> None:
    """The motor flips by the plan, and does not steer the other robot."""
    result = swim_from(eight().start, Mistaken(delay_s=0.0, lost=0.0, after=200.0))
    assert 200 < result.alarms[0] < 215
    straight = result.times < 230
    assert result.distance[straight].max() < ON_PATH
