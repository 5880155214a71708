"""A plan made again from plan.json gives the same orders; old files, own tables and the rest of a plan."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from planner.__main__ import main
from planner.api import plan
from planner.files.own_table import table_for
from planner.files.plan_files import write_plan
from planner.files.saved_plan import is_plan, load_plan, restore_plan
from planner.paths.path import circle
from planner.planning.plan import Plan
from planner.planning.request import Camera
from planner.tracking.tracker import Tracker
from planner.vehicle.calibration_table import CalibrationKnowledge
from sim.inputs import save_robot
from sim.io.errors import InputError, run_command
from sim.model.robot import Robot
from sim.model.schedule import plan_id
from surrogate.table_file import load
from tests.planner.compiled import CompiledTracker
from tests.planner.plans import BIASED, CONTROL, CORNER, around, hindered_trip, own_table, planned, trip
from tests.shared import shared

pytestmark = pytest.mark.slow

CM = 100 * CONTROL.tail_length
KNOWN = CalibrationKnowledge(("C_t",), np.array([[1e-4]]), current=(2e-4, 1e-4), current_error=(1e-5, 0.0))


@shared
def in_current() -> Plan:
    return plan(circle(1.5), CONTROL, knowledge=KNOWN, camera=Camera((0.02, 0.03), 1.5, 0.5, 0.1))


PLANS: dict[str, Callable[[], Plan]] = {
    "square": lambda: planned("square:3l", minimum_dwell=0.8),
    "head tip": lambda: planned(CORNER, point="head_tip", minimum_dwell=0.8),
    "pivot": lambda: planned(CORNER, point="pivot", objective="flips"),
    "current": in_current,
    "goal": trip,
    "obstacles": around,
    "laps": lambda: planned("circle:1.2l", objective="flips", loop=True),
}


def saved(name: str) -> dict[str, Any]:
    return json.loads(json.dumps(PLANS[name]().to_dict()))  # type: ignore[no-any-return]


def orders(result: Plan, count: int = 100) -> list[tuple[int, float]]:
    """Follow a tracker without poses."""
    tracker = Tracker(result)
    told = []
    while len(told) < count and not tracker.command.finished:
        command = tracker.command
        told.append((command.direction, command.flip_at))
        tracker.update(command.flip_at)
    return told


@pytest.mark.parametrize("name", PLANS)
def test_a_restored_plan_gives_the_same_orders(name: str) -> None:
    result, content = PLANS[name](), saved(name)
    same = restore_plan(content)
    assert np.array(orders(same)) == pytest.approx(np.array(orders(result)), abs=1e-6)
    assert (same.warnings, same.request.camera) == (result.warnings, result.request.camera)
    assert (same.lap, same.feedback_error) == (result.lap, result.feedback_error)
    again = json.loads(json.dumps(same.to_dict()))
    assert again.keys() == content.keys()
    for key in ("reference", "predicted_poses", "dwell_s", "raw_path"):
        assert np.array(again[key]) == pytest.approx(np.array(content[key]), abs=1e-12)
    assert again["guidance"]["heading_rad"] == pytest.approx(content["guidance"]["heading_rad"], abs=1e-12)
    assert same.track == pytest.approx(result.track, abs=1e-9)
    known, found = result.tracked.knowledge, same.tracked.knowledge
    assert (found.names, found.current, found.current_error) == (known.names, known.current, known.current_error)
    assert found.covariance == pytest.approx(known.covariance)
    assert (same.kept_clear and same.kept_clear.to_dict()) == (result.kept_clear and result.kept_clear.to_dict())


def test_the_microcontroller_gets_the_same_tracker(tmp_path: Path) -> None:
    """Written again, tracker.h gives the orders of the plan in memory."""
    compiled = CompiledTracker(restore_plan(saved("square")), tmp_path)
    now = 0.0
    for direction, flip_at in orders(PLANS["square"](), 30):
        command = compiled.update(now)
        assert (command.direction, command.flip_at) == (direction, pytest.approx(flip_at, abs=1e-3))
        now = command.flip_at


def test_the_files_of_jobs_and_their_folder_lead_to_the_plan(tmp_path: Path) -> None:
    write_plan(trip(), tmp_path / "trip")
    places = [tmp_path / "trip", tmp_path / "trip" / "plan.json", tmp_path / "trip" / "goal.json"]
    first, *others = [restore_plan(place) for place in places]
    assert all(is_plan(place) for place in places)
    assert all(other.to_dict() == first.to_dict() for other in others)
    write_plan(planned(), tmp_path / "circle")
    (tmp_path / "circle" / "goal.json").write_text((tmp_path / "trip" / "goal.json").read_text())
    with pytest.raises(InputError, match=r"is of plan .* is another one; plan again"):
        restore_plan(tmp_path / "circle" / "goal.json")
    (tmp_path / "path.csv").write_text("x,y\n0,0\n3,0\n")
    assert not any(map(is_plan, (tmp_path / "path.csv", tmp_path, "circle:2l", tmp_path / "none.json")))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"guidance": {}}, "lacks what is needed"),
        ({"guidance": None, "dwell_bar": [1.0]}, "dwell_bar needs a number above 0"),
        ({"first_direction": 0}, "first_direction = 0"),
        ({"objective": "fun"}, "objective = fun"),
        ({"point": "tail"}, "point 'tail'"),
        ({"calibration": {"names": ["C_t"]}}, "calibration"),
        ({"minimum_dwell_bar": 0.0}, "not above 0"),
        ({"format": 1}, "has format 1"),
        ({"stated_error_over_l": 1e200}, "stated_error_over_l must be a finite number below 1e\\+100"),
        ({"reference": [[0.0, 0.0], [1e200, 0.0]]}, "reference must be 2 or more rows of 2 finite numbers"),
        ({"off_drawn_over_l": 1.0, "guidance": {"heading_rad": [1e300, -1e300]}}, "lacks what is needed"),
        ({"robot": {"groups": {"omega_bar": 10.0}}}, "lacks what is needed"),
        ({"robot": 3}, "not a plan.json"),
        ({"reference": []}, "reference must be 2 or more rows of 2 finite numbers"),
        ({"reference": [["nan", 0.0], [1.0, 1.0]]}, "reference must be 2 or more rows of 2 finite numbers"),
        ({"stated_error_over_l": "nan"}, "stated_error_over_l must be a finite number"),
    ],
)
def test_edited_plans_are_refused(changes: dict[str, Any], expected: str, tmp_path: Path) -> None:
    content = {**saved("obstacles"), **changes}
    content["id"] = plan_id(content)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(content))
    for source in (content, path):
        with pytest.raises(InputError, match=expected) as caught:
            restore_plan(source)
        assert "\n" not in str(caught.value)


def test_another_table_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    restore_plan({**saved("pivot"), "model": "0123"})
    assert "was made with look-up table 0123" in capsys.readouterr().err


def track_of(result: Plan, share: float) -> pd.DataFrame:
    """Return the camera's table of a share of the dwells."""
    frame = result.to_frame().iloc[: round(share * len(result.dwells)) + 1]
    return frame[["start_s", "x_cm", "y_cm", "heading_deg"]].rename(columns={"start_s": "time_s"})


def test_a_saved_plan_and_one_in_memory_have_the_same_rest_in_other_units_too(tmp_path: Path) -> None:
    """The last row of the track is not finished."""
    square = PLANS["square"]()
    track = track_of(square, 0.4)
    words = [f"{t / 60},{10 * x},{10 * y},{np.radians(h)}" for t, x, y, h in track.to_numpy().tolist()]
    (tmp_path / "track.csv").write_text("\n".join(["time_min,x_mm,y_mm,heading_rad", *words, "9.1,30"]) + "\n")
    sf.write_plan(square, tmp_path / "plan")
    rest, saved = sf.replan(square, track), sf.replan(tmp_path / "plan", tmp_path / "track.csv")
    assert isinstance(rest, sf.Plan)
    assert isinstance(saved, sf.Plan)
    assert saved.dwells == pytest.approx(rest.dwells, abs=1e-5)
    assert saved.start == pytest.approx(tuple(track.iloc[-1, 1:] / [CM, CM, 180 / np.pi]))


@pytest.mark.parametrize(
    ("share", "left"), [(0.5, 1), *(pytest.param(*case, marks=pytest.mark.rest) for case in ((0.1, 1), (0.9, 0)))]
)
def test_a_trip_goes_on_to_its_goal_through_the_places_that_are_left(
    share: float, left: int, tmp_path: Path
) -> None:
    track = track_of(hindered_trip(), share)
    sf.write_plan(hindered_trip(), tmp_path)
    after = sf.replan(tmp_path / "goal.json", track)
    assert isinstance(after.job, sf.Trip)
    assert len(after.job.via) == left
    assert after.job.end_error[0] < 0.01
    assert after.kept_clear is not None
    assert after.kept_clear.clearance > 0
    assert after.start == pytest.approx(tuple(track.iloc[-1, 1:] / [CM, CM, 180 / np.pi]), abs=1e-6)
    if share == 0.1:
        same = sf.replan(hindered_trip(), track)
        assert same.dwells == pytest.approx(after.dwells, abs=1e-4)


def test_tours_go_on_along_their_path() -> None:
    tour = sf.tour([(0, 0), (2, 0), (1.5, 1)], CONTROL)
    rest = sf.replan(tour, track_of(tour, 0.5))
    assert isinstance(rest, sf.Plan)
    assert np.hypot(*(rest.track[-1] - tour.job.places[tour.job.order[-1]])) < 0.1


def test_a_robot_that_the_package_s_table_knows_gets_that_table(tmp_path: Path) -> None:
    save_robot(CONTROL, tmp_path / "robot.toml")
    table = table_for(CONTROL, str(tmp_path / "robot.toml"), CalibrationKnowledge())
    assert table.identity == load().identity
    assert [path.name for path in tmp_path.iterdir()] == ["robot.toml"]


def test_a_robot_that_it_does_not_know_is_planned_for_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its table is kept and used again, but not for another robot, and not if it is damaged."""
    simulated: list[Robot] = []
    monkeypatch.setattr("surrogate.tabulate.tabulate", lambda robot: simulated.append(robot) or own_table())
    robot, kept = tmp_path / "robot.toml", tmp_path / "robot.table.json"
    save_robot(BIASED, robot)
    words = ["plan", "circle:1.5l", "--robot", str(robot), "--objective", "flips", "--out"]
    assert run_command(main, [*words, str(tmp_path / "first")]) == 0
    said = capsys.readouterr().err
    assert "left_right_bias" in said
    assert f"-> {kept}" in said
    before = kept.stat().st_mtime_ns
    assert run_command(main, [*words, str(tmp_path / "again")]) == 0
    assert capsys.readouterr().err == ""
    assert kept.stat().st_mtime_ns == before
    plans = [load_plan(tmp_path / name / "plan.json") for name in ("first", "again")]
    assert plans[0] == plans[1]
    assert simulated == [BIASED]
    kept.write_text("{}")
    for each in (BIASED, BIASED, replace(BIASED, effects={"left_right_bias": 0.1})):
        table_for(each, str(robot), CalibrationKnowledge())
    assert [each.effects["left_right_bias"] for each in simulated] == [0.2, 0.2, 0.1]
