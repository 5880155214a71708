"""Robots and paths in any form, for plans and goals; the robot's own table; checks of tracks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planner.vehicle.from_table
import softflagella as sf
import surrogate.tabulate
from tests.planner.plans import BIASED, CONTROL, own_table

KNOWN = sf.CalibrationKnowledge(names=("C_yr",), covariance=np.array([[0.01]]))


@pytest.fixture
def calibrated_file(tmp_path: Path) -> Path:
    """The robot's file with what a calibration found besides."""
    sf.save_robot(CONTROL, tmp_path / "robot.toml")
    with (tmp_path / "robot.toml").open("a") as file:
        file.write('\n[calibration]\nnames = ["C_yr"]\ncovariance = [[0.01]]\n')
    return tmp_path / "robot.toml"


@pytest.mark.slow
def test_a_robot_in_any_form_has_the_plan_of_the_planner(calibrated_file: Path) -> None:
    circle, few = sf.circle(1.5), {"objective": "flips"}
    exact, wanted = (sf.plan(circle, CONTROL, knowledge=known, **few) for known in (None, KNOWN))
    for robot in (CONTROL, "paper-control"):
        assert sf.plan(circle, robot, **few).to_dict()["id"] == exact.to_dict()["id"]
    uncertain = sf.plan(circle, CONTROL, knowledge=KNOWN, **few)
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
        assert sf.plan(path, CONTROL, unit=unit, objective="flips").drawn.length == pytest.approx(12.0)
    for path in (tmp_path / "l.csv", sf.read_path(tmp_path / "l.csv"), "square:3"):
        with pytest.raises(sf.InputError, match="have no unit; write it behind them, 24cm or 3l"):
            sf.plan(path, CONTROL)
    with pytest.raises(sf.InputError, match=r"unit 'inch'; allowed are l, m, cm, mm"):
        sf.plan("square:3", CONTROL, unit="inch")


def test_a_robot_that_the_shipped_table_does_not_know_gets_its_own_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In memory; the table is simulated elsewhere."""
    own = own_table()
    monkeypatch.setattr(planner.vehicle.from_table, "_TABLES", {})
    monkeypatch.setattr(surrogate.tabulate, "tabulate", lambda robot: own)
    with pytest.raises(sf.InputError, match="left_right_bias"):
        sf.plan(sf.circle(2.0), BIASED, lookup=sf.load_table())
    robots = (BIASED, replace(BIASED, name="same groups"))
    assert {sf.plan(sf.circle(1.5), each, objective="flips").tracked.model for each in robots} == {own.identity}
    assert capsys.readouterr().err.count("simulating this robot's own look-up table") == 1


@pytest.mark.rest
def test_every_planning_function_takes_the_robot_s_own_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planner.vehicle.from_table, "_TABLES", {})
    robot = "paper-control"
    square = [[0, 0], [2, 0], [2, 2], [0, 2]]
    plans = [
        sf.plan(sf.circle(1.5), robot, own_table=True),
        sf.to_goal((0, 0, 0), (4, 1, 0), robot, own_table=True),
        sf.tour([(0, 0), (4, 0)], robot, objective="time", own_table=True),
        sf.cover(square, 0.8, robot, objective="time", own_table=True),
    ]
    own = own_table(biased=False).identity
    assert {plan.tracked.model for plan in plans} == {own}
    assert sf.plan(sf.circle(1.5), robot).tracked.model != own


@pytest.mark.slow
def test_a_track_is_checked_against_a_plan_in_any_form(tmp_path: Path) -> None:
    result = sf.plan(sf.circle(1.0), CONTROL, objective="flips")
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
