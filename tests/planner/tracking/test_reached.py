"""The place that a track has reached: on loops, lanes, after gaps, and where the robot was carried away."""

from __future__ import annotations

import math

import numpy as np
import pytest

from planner.paths.path import Path2D, circle
from planner.paths.tractrix import Reference, reference
from planner.tracking.reached import reached
from sim.arrays import Floats

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


def test_a_gap_of_the_camera_is_bridged() -> None:
    along = reference(LANES, 0.0, 0.02)
    times, poses = followed(along, 0, len(along.q) // 2)
    kept = np.r_[:40, 160:200]
    place = reached(along, times[kept], poses[kept], SPEED)
    assert place == pytest.approx(len(along.q) // 2, abs=5)


def test_a_robot_that_is_faster_than_its_model_is_followed() -> None:
    along = reference(LANES, 0.0, 0.02)
    end = round(0.9 * len(along.q))
    times, poses = followed(along, 0, end, 50)
    place = reached(along, times / 2.8, poses, SPEED)  # at 1.4 of its speed
    assert place == pytest.approx(end, abs=5)
