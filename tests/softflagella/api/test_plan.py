"""The public functions of plans, swims and calibrations: robots and paths in any form, tracks, decisions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import planner.vehicle.from_table
import softflagella as sf
import surrogate.tabulate
from common.errors import InputError
from tests.calibration.toy_tables import DRAG, START, ambiguous, on_the_toy, toy_table
from tests.planner.plans import BIASED, CONTROL, own_table
from tests.planner.vehicles import FINE

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
        with pytest.raises(sf.InputError, match="have no unit"):
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
    plans = [
        sf.plan(sf.circle(1.5), robot, own_table=True),
        sf.to_goal((0, 0, 0), (4, 1, 0), robot, own_table=True),
        sf.tour([(0, 0), (4, 0)], robot, objective="time", own_table=True),
    ]
    own = own_table(biased=False).identity
    assert {plan.tracked.model for plan in plans} == {own}
    assert sf.plan(sf.circle(1.5), robot).tracked.model != own


@pytest.mark.slow
def test_a_simulated_robot_swims_like_the_vehicle_of_its_plan() -> None:
    plan = sf.plan(sf.circle(1.0), CONTROL, objective="flips")
    simulated, moved = sf.swim(plan, camera=FINE), sf.swim(sf.Tracker(plan), plan.tracked.vehicle, FINE)
    assert simulated.finished
    assert simulated.rms() == pytest.approx(moved.rms(), rel=0.2)
    assert len(simulated.dwells) == pytest.approx(len(moved.dwells), abs=1)
    assert simulated.to_frame()["x_over_l"].to_numpy() == pytest.approx(simulated.poses[:, 0])


@pytest.mark.slow
def test_another_robot_with_an_askew_marker_in_a_current() -> None:
    """A tail that is a tenth shorter has other units of time and length; those of the plan are told."""
    plan = sf.plan(sf.circle(1.0), CONTROL, objective="flips")
    other = replace(CONTROL, tail_length=0.95 * CONTROL.tail_length)
    tracker = sf.Tracker(plan)
    camera = replace(FINE, marker=(0.0, 0.0, 0.3))
    result = sf.swim(tracker, other, camera, current_cm_s=(0.004, 0.0))
    assert result.finished
    assert result.rms() < 2 * plan.predicted_rms + 0.02
    assert tracker.learned["marker, angle"] == pytest.approx(0.3, abs=0.05)
    assert sf.check(plan, result.to_frame()).rms == pytest.approx(result.rms(), rel=0.05)


@pytest.mark.parametrize("wrong", [{"noise": (0.0, 0.01)}, {"every_s": 0.0}, {"delay_s": -1.0}, {"lost": 1.5},
                                   {"noise": (np.nan, 0.01)}])  # fmt: skip
def test_a_camera_that_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(sf.InputError, match=f"{next(iter(wrong))} is"):
        sf.Camera(**wrong)  # type: ignore[arg-type]


def circle_track(run: int, samples: int) -> pd.DataFrame:
    time = np.linspace(0, 120, samples)
    angle = 0.05 * time
    columns: dict[str, Any] = {"run": run, "time_s": time, "x_cm": 9 * np.cos(angle), "y_cm": 9 * np.sin(angle)}
    return pd.DataFrame({**columns, "heading_deg": np.degrees(angle) + 20})


def test_tracks_that_are_left_out_are_warned_of() -> None:
    samples = pd.concat([circle_track(1, 200), circle_track(2, 5)])
    runs = pd.DataFrame({"run": [1, 2], "N": 2, "l_cm": 11.0, "omega_rpm": 43.0})
    with pytest.warns(UserWarning, match="excluded: run 2: 5 samples") as warned:
        table = sf.tracks(samples, runs)
    assert warned[0].filename == __file__
    assert table["R_yr_cm"].round(6).tolist()[0] == 9.0
    assert np.isnan(table["R_yr_cm"].iloc[1])
    assert len(table.attrs["excluded"]) == 1
    assert table.attrs["units"]["v_cm_s"] == "cm/s"


@pytest.mark.slow
def test_new_runs_decide_a_verdict_that_is_at_hand() -> None:
    table = toy_table(1, lengths_cm=(8.0,), **{DRAG: 4.0})
    more = toy_table(2, lengths_cm=(5.0, 11.0), **{DRAG: 4.0}).assign(session="new").sample(8, random_state=1)
    with on_the_toy():
        decision = sf.decide(pd.concat([table, more], ignore_index=True), ambiguous(), START)
    assert decision.new_runs == 8
    assert decision.decided == "head's end-over-end drag"
    assert decision.sentence.startswith("Decided: head's end-over-end drag.")
    assert not sf.Decision(decision.standings[:1] * 2, 8).decided


def test_lengths_of_paths_have_the_unit_that_is_given() -> None:
    with pytest.raises(InputError, match=r"missing\.csv"):
        sf.calibrate("missing.csv", "paper-control", paths=("square:24",), unit="cm")
    with pytest.raises(InputError, match="unit"):
        sf.calibrate("missing.csv", "paper-control", paths=("square:24",))
    with pytest.raises(InputError, match="max_seconds"):
        sf.calibrate("missing.csv", "paper-control", max_seconds=0.0)
