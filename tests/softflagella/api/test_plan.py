"""Plans from files, for robots that the shipped table does not know, and checks of tracks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planner.files.own_table
import softflagella as sf
from planner.planning.plan import plan

ROBOT = sf.load_robot("paper-control")


def test_a_plan_of_a_robot_is_that_of_the_planner() -> None:
    wanted = plan(sf.circle(1.5), ROBOT).to_dict()["id"]
    assert sf.plan(sf.circle(1.5), ROBOT).to_dict()["id"] == wanted
    assert sf.plan(sf.circle(1.5), "paper-control").to_dict()["id"] == wanted


def test_a_file_with_a_unit_is_converted(tmp_path: Path) -> None:
    square = 33 * np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
    np.savetxt(tmp_path / "cm.csv", square, delimiter=",", header="x_cm,y_cm", comments="")
    np.savetxt(tmp_path / "l.csv", square / 11, delimiter=",", header="x,y", comments="")
    for path, unit in (
        (tmp_path / "cm.csv", None), (tmp_path / "cm.csv", "cm"), (tmp_path / "l.csv", "l"),
        (sf.read_path(tmp_path / "cm.csv"), None), (sf.read_path(tmp_path / "l.csv"), "l"),
        (sf.Drawing(sf.polygon(4, 33.0), "cm"), None), (square, "cm"), (sf.polygon(4, 3.0), None),
        ("square:33cm", None), ("square:3l", None), ("square:330", "mm"),
    ):  # fmt: skip
        assert sf.plan(path, ROBOT, unit=unit, objective="flips").drawn.length == pytest.approx(12.0)
    for path in (tmp_path / "l.csv", sf.read_path(tmp_path / "l.csv"), "square:3"):
        with pytest.raises(sf.InputError, match="have no unit; write it behind them, 24cm or 3l"):
            sf.plan(path, ROBOT)
    with pytest.raises(sf.InputError, match=r"unit 'inch'; allowed are l, m, cm, mm"):
        sf.plan("square:3", ROBOT, unit="inch")


def test_a_robot_that_the_shipped_table_does_not_know_gets_its_own_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = replace(ROBOT, effects={"left_right_bias": 0.2})
    with pytest.raises(sf.InputError, match="left_right_bias"):
        plan(sf.circle(2.0), robot)
    monkeypatch.setattr(planner.files.own_table, "_TABLES", {})
    first = sf.plan(sf.circle(2.0), robot)
    assert "simulating this robot's own look-up table" in capsys.readouterr().err
    again = sf.plan(sf.circle(1.8), replace(robot, name="same groups"))
    assert capsys.readouterr().err == ""
    assert first.tracked.model == again.tracked.model == sf.tabulate(robot).identity


def test_knowledge_of_a_calibration_comes_from_the_robot_s_file(tmp_path: Path) -> None:
    sf.save_robot(ROBOT, tmp_path / "robot.toml")
    with (tmp_path / "robot.toml").open("a") as file:
        file.write('\n[calibration]\nnames = ["C_yr"]\ncovariance = [[0.01]]\n')
    known = sf.CalibrationKnowledge(names=("C_yr",), covariance=np.array([[0.01]]))
    exact = sf.plan(sf.circle(2.0), ROBOT).stated_error
    uncertain = sf.plan(sf.circle(2.0), ROBOT, knowledge=known).stated_error
    assert sf.plan(sf.circle(2.0), tmp_path / "robot.toml").stated_error == uncertain > exact


def test_a_track_is_checked_against_a_plan_in_any_form(tmp_path: Path) -> None:
    result = sf.plan(sf.circle(1.2), ROBOT, objective="flips")
    track = sf.replay(result)
    error = sf.check(result, track)
    assert error.largest < error.stated == result.stated_error
    sf.write_plan(result, tmp_path)
    track.to_csv(tmp_path / "track.csv", index=False)
    for plan_given in (result.to_dict(), tmp_path / "plan.json", str(tmp_path / "plan.json")):
        assert sf.check(plan_given, tmp_path / "track.csv").rms == pytest.approx(error.rms, rel=1e-9)
    camera = track[["time_s", "x_cm", "y_cm", "heading_deg"]]
    assert sf.check(result, camera).rms == pytest.approx(error.rms, rel=1e-9)
    with pytest.raises(sf.InputError, match="it needs time_s, x_cm"):
        sf.check(result, camera.drop(columns="x_cm"))


def test_a_goal_plan_is_written_with_its_goal_and_checked_as_its_plan(tmp_path: Path) -> None:
    goal = sf.to_goal((0, 0, 0), (2.5, 0.5, 0.3), ROBOT)
    names = [path.name for path in sf.write_plan(goal, tmp_path)]
    assert names[-2:] == ["goal.json", "goal.svg"]
    assert sf.load_plan(tmp_path / "plan.json")["id"] == goal.plan.to_dict()["id"]
    track = sf.replay(goal.plan)
    assert sf.check(goal, track).rms == sf.check(goal.plan, track).rms
