"""The normal equations of the poses, their order and their solution are Python's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from planner.paths.pose_equations import (
    Task,
    damped_step,
    normal_equations,
    places,
    sorted_equations,
)
from sim.arrays import Floats
from tests.planner.page.cases import DRIFTS, drift_to_page
from tests.planner.page.page_core import answer, answers, check_near

RNG = np.random.default_rng(0)


def poses_and_task(drift: str, *, closed: bool) -> tuple[Floats, Task]:
    count = 41
    angle = np.linspace(0, 5.0, count)
    target = np.stack([3 * np.cos(angle), 3 * np.sin(angle)], 1)
    poses = np.concatenate([target, (angle + 1.5)[:, None]], 1) + 0.1 * RNG.normal(size=(count, 3))
    sides = RNG.normal(size=(count, 2, 2))
    shares = RNG.uniform(0.1, 2.0, count)
    task = Task(target, sides, shares, 0.8, 0.7, DRIFTS[drift], 0.3, 0.05, 2 * np.pi if closed else None)
    return poses, task


def to_page(poses: Floats, task: Task) -> tuple[dict[str, Any], dict[str, Any]]:
    """Write poses and a task as the core has them."""
    (along_x, along_y), (across_x, across_y) = np.moveaxis(task.sides, 0, -1)
    sides = {"alongX": along_x, "alongY": along_y, "acrossX": across_x, "acrossY": across_y}
    fields = {
        "target": task.target, "sides": sides, "shares": task.shares, "distance": task.distance,
        "radius": task.radius, "drift": drift_to_page(task.drift), "spacing": task.spacing,
        "timeWeight": task.time_weight, "turn": task.turn,
    }  # fmt: skip
    return dict(zip(("x", "y", "heading"), poses.T, strict=True)), fields


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("drift", DRIFTS)
def test_equations_and_steps(drift: str, closed: bool) -> None:
    poses, task = poses_and_task(drift, closed=closed)
    for weight, allowed in ((0.3, 1e-11), (1000.0, 1e-6)):
        wanted = normal_equations(poses, task, weight)
        found = answer("pose_equations.js", "normalEquations", *to_page(poses, task), weight)
        assert found["cost"] == pytest.approx(wanted.cost, rel=1e-13)
        for name in ("gradient", "diagonal", "across"):
            size = float(np.abs(getattr(wanted, name)).max())
            check_near(np.array(found[name]) / size, getattr(wanted, name) / size, 1e-14)
        place = places(len(poses), closed=closed)
        band, right = sorted_equations(wanted, place)
        for damping in (1e-3, 1.0):
            step = damped_step(band, right, damping)
            assert step is not None
            entries = {"band": band.T.reshape(-1), "right": right, "width": len(band) - 1}
            check_near(answer("pose_equations.js", "dampedStep", entries, damping), step, allowed)
        system = {name: getattr(wanted, name) for name in ("gradient", "diagonal", "across")}
        ordered = answer("pose_equations.js", "sortedEquations", system, place)
        assert ordered["width"] == len(band) - 1
        assert np.array_equal(np.array(ordered["band"]).reshape(-1, len(band)), band.T)
        assert ordered["right"] == right.tolist()


def test_order_of_the_poses() -> None:
    cases = [(count, closed) for count in (2, 3, 10, 11) for closed in (False, True)]
    found = answers([("pose_equations.js", "places", *case) for case in cases])
    assert found == [places(count, closed=closed).tolist() for count, closed in cases]


def test_a_matrix_that_is_not_positive_definite_has_no_step() -> None:
    entries = {"band": [1.0, 2.0, 1.0, 0.0], "right": [1.0, 1.0], "width": 1}
    assert answer("pose_equations.js", "dampedStep", entries, 0.5) is None
