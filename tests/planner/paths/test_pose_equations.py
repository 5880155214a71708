"""The normal equations against differences of the cost, and their sorted form against a dense matrix."""

from __future__ import annotations

import numpy as np
import pytest

from planner.paths.pose_equations import (
    Task,
    damped_step,
    normal_equations,
    places,
    sorted_equations,
)
from planner.paths.tractrix import Drift
from sim.arrays import Floats

WEIGHT = 3.0


def hindrance(poses: Floats) -> tuple[Floats, Floats]:
    """One residual a pose: x + 2 y - heading, and its derivatives."""
    return poses @ np.array([[1.0], [2.0], [-1.0]]), np.tile([1.0, 2.0, -1.0], (len(poses), 1, 1))


def task(count: int, *, closed: bool, hindered: bool) -> tuple[Task, Floats]:
    """Random poses near a random path; some steps turn too far, or are too short."""
    rng = np.random.default_rng(count)
    target = np.cumsum(rng.normal(size=(count, 2)), 0)
    sides = rng.normal(size=(count, 2, 2))
    poses = np.concatenate([target + 0.3 * rng.normal(size=(count, 2)), rng.normal(size=(count, 1))], 1)
    turn = 2 * np.pi if closed else None
    return Task(
        target, sides, rng.uniform(0.5, 2, count), 0.9, 0.4, Drift(0.1), 1.0, 0.2, turn,
        hindrance if hindered else None,
    ), poses  # fmt: skip


@pytest.mark.parametrize(("closed", "hindered"), [(True, False), (False, False), (False, True)])
def test_the_gradient_is_that_of_the_cost(closed: bool, hindered: bool) -> None:
    what, poses = task(9, closed=closed, hindered=hindered)
    gradient = normal_equations(poses, what, WEIGHT).gradient
    for pose in range(9):
        for number in range(3):
            step = np.zeros_like(poses)
            step[pose, number] = 1e-6
            up, down = (normal_equations(poses + sign * step, what, WEIGHT).cost for sign in (1, -1))
            assert gradient[number, pose] == pytest.approx((up - down) / 4e-6, rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("count", [3, 4, 9, 10])
@pytest.mark.parametrize("closed", [True, False])
def test_the_banded_step_is_that_of_the_dense_system(count: int, closed: bool) -> None:
    what, poses = task(count, closed=closed, hindered=False)
    system = normal_equations(poses, what, WEIGHT)
    dense = np.zeros((count, 3, count, 3))
    for pose in range(count):
        dense[pose, :, pose] = system.diagonal[:, :, pose]
        dense[pose, :, pose] += np.triu(dense[pose, :, pose], 1).T
    for step in range(system.across.shape[2]):
        after = (step + 1) % count
        dense[step, :, after] += system.across[:, :, step]
        dense[after, :, step] += system.across[:, :, step].T
    matrix = dense.reshape(3 * count, -1) + 0.5 * np.eye(3 * count)
    place = places(count, closed=closed)
    found = damped_step(*sorted_equations(system, place), 0.5)
    assert found is not None
    assert found.reshape(-1, 3)[place].ravel() == pytest.approx(
        np.linalg.solve(matrix, system.gradient.T.ravel()), rel=1e-8
    )
