"""Plans from pose to pose take robots as plans do, and make the table of a robot that the shipped table lacks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planner.files.own_table
import softflagella as sf
from planner.goal.to_goal import to_goal

ROBOT = sf.load_robot("paper-control")
START, GOAL = (0, 0, 0), (2.5, 0.5, 0.3)


def test_a_plan_to_a_goal_is_that_of_the_planner(tmp_path: Path) -> None:
    sf.save_robot(ROBOT, tmp_path / "robot.toml")
    wanted = to_goal(START, GOAL, ROBOT).to_dict()
    for robot in (ROBOT, "paper-control", tmp_path / "robot.toml", str(tmp_path / "robot.toml")):
        assert sf.to_goal(START, GOAL, robot).to_dict() == wanted


def test_a_robot_that_the_shipped_table_does_not_know_gets_its_own_beside_its_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = replace(ROBOT, effects={"left_right_bias": 0.2})
    with pytest.raises(sf.InputError, match="left_right_bias"):
        to_goal(START, GOAL, robot)
    sf.save_robot(robot, tmp_path / "robot.toml")
    first = sf.to_goal(START, GOAL, tmp_path / "robot.toml")
    assert "simulating this robot's own look-up table" in capsys.readouterr().err
    assert (tmp_path / "robot.table.json").exists()
    assert sf.to_goal(START, GOAL, tmp_path / "robot.toml").to_dict() == first.to_dict()
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(planner.files.own_table, "_TABLES", {})
    assert sf.to_goal(START, GOAL, robot).plan.tracked.model == first.plan.tracked.model


def test_knowledge_of_a_calibration_comes_from_the_robot_s_file(tmp_path: Path) -> None:
    sf.save_robot(ROBOT, tmp_path / "robot.toml")
    with (tmp_path / "robot.toml").open("a") as file:
        file.write('\n[calibration]\nnames = ["C_yr"]\ncovariance = [[0.01]]\n')
    known = sf.CalibrationKnowledge(names=("C_yr",), covariance=np.array([[0.01]]))
    exact, uncertain = (sf.to_goal(START, GOAL, ROBOT, knowledge=knowledge) for knowledge in (None, known))
    assert sf.to_goal(START, GOAL, tmp_path / "robot.toml").plan.stated_error == uncertain.plan.stated_error
    assert uncertain.plan.stated_error > exact.plan.stated_error
