"""Robots and paths in any form, for plans and goals; the robot's own table; checks of tracks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import planner.files.own_table
import softflagella as sf
import surrogate.tabulate
from tests.softflagella.made import ODD, ROBOT, goal, own_table

KNOWN = sf.CalibrationKnowledge(names=("C_yr",), covariance=np.array([[0.01]]))


@pytest.fixture
def calibrated_file(tmp_path: Path) -> Path:
    """The robot's file with what a calibration found besides."""
    sf.save_robot(ROBOT, tmp_path / "robot.toml")
    with (tmp_path / "robot.toml").open("a") as file:
        file.write('\n[calibration]\nnames = ["C_yr"]\ncovariance = [[0.01]]\n')
    return tmp_path / "robot.toml"


@pytest.mark.slow
def test_a_robot_in_any_form_has_the_plan_of_the_planner(calibrated_file: Path) -> None:
    circle, few = sf.circle(1.5), {"objective": "flips"}
    exact, wanted = (sf.plan(circle, ROBOT, knowledge=known, **few) for known in (None, KNOWN))
    for robot in (ROBOT, "paper-control"):
        assert sf.plan(circle, robot, **few).to_dict()["id"] == exact.to_dict()["id"]
    uncertain = sf.plan(circle, ROBOT, knowledge=KNOWN, **few)
    for given in (uncertain, sf.plan(circle, str(calibrated_file), **few)):
        assert given.stated_error == wanted.stated_error > exact.stated_error


@pytest.mark.slow
def test_a_path_in_any_form_has_its_unit(tmp_path: Path) -> None:
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
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In memory, or beside its file; the table is simulated elsewhere."""
    own = own_table(odd=True)
    monkeypatch.setattr(planner.files.own_table, "_TABLES", {})
    monkeypatch.setattr(surrogate.tabulate, "tabulate", lambda robot: own)
    with pytest.raises(sf.InputError, match="left_right_bias"):
        sf.plan(sf.circle(2.0), ODD, lookup=sf.load_table())
    file = tmp_path / "robot.toml"
    sf.save_robot(ODD, file)
    for first, again in ((ODD, replace(ODD, name="same groups")), (file, str(file))):
        made = sf.plan(sf.circle(1.5), first, objective="flips")
        assert "simulating this robot's own look-up table" in capsys.readouterr().err
        assert (
            sf.plan(sf.circle(1.2), again, objective="flips").tracked.model == made.tracked.model == own.identity
        )
        assert capsys.readouterr().err == ""
    assert (tmp_path / "robot.table.json").exists()


@pytest.mark.rest
def test_every_planning_function_takes_the_robot_s_own_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planner.files.own_table, "_TABLES", {})
    robot = "paper-control"
    square = [[0, 0], [2, 0], [2, 2], [0, 2]]
    plans = [
        sf.plan(sf.circle(1.5), robot, own_table=True),
        sf.to_goal((0, 0, 0), (4, 1, 0), robot, own_table=True),
        sf.tour([(0, 0), (4, 0)], robot, objective="time", own_table=True),
        sf.cover(square, 0.8, robot, objective="time", own_table=True),
    ]
    own = own_table().identity
    assert {plan.tracked.model for plan in plans} == {own}
    assert sf.plan(sf.circle(1.5), robot).tracked.model != own


@pytest.mark.slow
def test_a_track_is_checked_against_a_plan_in_any_form(tmp_path: Path) -> None:
    result = sf.plan(sf.circle(1.0), ROBOT, objective="flips")
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


@pytest.mark.slow
def test_a_goal_plan_is_written_with_its_goal_and_checked_as_its_plan(tmp_path: Path) -> None:
    names = [path.name for path in sf.write_plan(goal(), tmp_path)]
    assert names[-2:] == ["goal.json", "goal.svg"]
    assert sf.load_plan(tmp_path / "plan.json")["id"] == goal().to_dict()["id"]
    plan = goal()
    track = pd.DataFrame(plan.poses, columns=["x_over_l", "y_over_l", "heading_rad"])
    track["time_bar"] = np.concatenate([[0.0], np.cumsum(plan.dwells)])
    assert sf.check(tmp_path / "plan.json", track).rms == sf.check(plan, track).rms
