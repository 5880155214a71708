"""Distances of bodies: straight lines with a width."""

from __future__ import annotations

import numpy as np
import pytest

from planner.jobs.separation import Places, distances, line_distance, too_near
from planner.jobs.timed_motion import Body
from planner.paths.obstacles import Footprint
from sim.model.presets import PRESETS

BODY = Body(0.02, -0.13, 0.02)


def random_places(rng: np.random.Generator, count: int) -> Places:
    poses = np.stack([*rng.uniform(-0.4, 0.4, (2, count)), rng.uniform(-4, 4, count)], 1)
    return Places(BODY, poses, rng.uniform(0, 0.02, count))


def test_distances_of_lines_are_those_of_their_points() -> None:
    rng = np.random.default_rng(0)
    first, second = rng.normal(size=(2, 300, 2, 2))
    share = np.linspace(0, 1, 401)[:, None, None]
    points, others = (line[:, 0] + share * (line[:, 1] - line[:, 0]) for line in (first, second))
    sampled = [
        np.hypot(*np.moveaxis(points[:, None, k] - others[None, :, k], -1, 0)).min() for k in range(len(first))
    ]
    assert line_distance(first, second) == pytest.approx(sampled, abs=0.02)
    assert (line_distance(first, second) == 0).sum() > 10
    assert (line_distance(first, second) <= np.array(sampled) + 1e-12).all()


def test_the_table_of_pairs_agrees_with_the_distances() -> None:
    rng = np.random.default_rng(1)
    first, second = random_places(rng, 250), random_places(rng, 40)
    table = too_near(first, second, 0.05)
    for j in range(40):
        one = Places(BODY, np.repeat(second.poses[j : j + 1], 250, 0), np.full(250, second.error[j]))
        near = distances(first, one) - first.error - one.error < 0.05
        assert (table[:, j] == near).all()
    assert 0.1 < table.mean() < 0.9


def test_the_body_covers_head_and_tails() -> None:
    robot = PRESETS["paper-control"]
    body, discs = Body.of(robot), Footprint.of(robot, 0.0)
    pose = np.array([[0.3, 0.2, 1.0]])
    centres = discs.centres(pose)[0] * robot.tail_length
    ends = body.ends(pose * [robot.tail_length, robot.tail_length, 1.0])[0]
    lines = np.stack([centres, centres], 1)
    assert line_distance(lines, np.broadcast_to(ends, lines.shape)) == pytest.approx(
        np.zeros(len(lines)), abs=1e-12
    )
    assert body.radius == pytest.approx(discs.radius * robot.tail_length)
