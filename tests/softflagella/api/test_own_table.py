"""The robot's own table in every planning function."""

from __future__ import annotations

import pytest

import planner.files.own_table
import softflagella as sf


@pytest.mark.rest
def test_every_planning_function_takes_the_robot_s_own_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planner.files.own_table, "_TABLES", {})
    robot = "paper-control"
    square = [[0, 0], [2, 0], [2, 2], [0, 2]]
    plans = [
        sf.plan(sf.circle(1.5), robot, own_table=True),
        sf.to_goal((0, 0, 0), (4, 1, 0), robot, own_table=True).plan,
        sf.tour([(0, 0), (4, 0)], robot, objective="time", own_table=True).plan,
        sf.cover(square, 0.8, robot, objective="time", own_table=True).plan,
    ]
    own = sf.tabulate(sf.load_robot(robot)).identity
    assert {plan.tracked.model for plan in plans} == {own}
    assert sf.plan(sf.circle(1.5), robot).tracked.model != own
