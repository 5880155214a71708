"""plan.json and goal.json read back, as the same plan; edited and foreign files are refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.errors import InputError, run_command
from planner.files.plan_files import write_plan
from planner.files.saved_plan import is_plan, load_goal, load_plan, restore_plan
from planner.goal.trip import FORMAT as GOAL_FORMAT
from planner.jobs.plan import plan
from planner.paths.path import circle
from planner.planning.plan import Plan
from planner.planning.request import Camera
from planner.vehicle.from_table import table_for
from sim.inputs import save_robot
from sim.knowledge import CalibrationKnowledge
from sim.model.robot import Robot
from sim.model.schedule import FORMAT, load_schedule, plan_id
from softflagella.__main__ import main
from surrogate.table_file import load
from tests.planner.plans import (
    BIASED,
    CONTROL,
    CORNER,
    WALLS,
    around,
    goal_file,
    own_table,
    planned,
    trip,
)
from tests.shared import shared
from tracking.kalman_filter import prior
from tracking.tracker import Tracker

pytestmark = pytest.mark.slow

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
    assert (prior(same) == prior(result)).all()
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


def test_the_files_of_jobs_and_their_folder_lead_to_the_plan(tmp_path: Path) -> None:
    write_plan(trip(), tmp_path / "trip")
    places = [tmp_path / "trip", tmp_path / "trip" / "plan.json", tmp_path / "trip" / "goal.json"]
    first, *others = [restore_plan(place) for place in places]
    assert all(is_plan(place) for place in places)
    goal, content = load_goal(places[2]), load_plan(places[1])
    assert goal["plan_id"] == content["id"]
    assert content["predicted_poses"][-1] == pytest.approx(goal["predicted_end"])
    assert all(other.to_dict() == first.to_dict() for other in others)
    assert [each.job.goal for each in (first, *others)] == [trip().job.goal] * 3
    write_plan(planned(), tmp_path / "circle")
    (tmp_path / "circle" / "goal.json").write_text((tmp_path / "trip" / "goal.json").read_text())
    with pytest.raises(InputError, match=r"is of plan .* is another one; plan again"):
        restore_plan(tmp_path / "circle" / "goal.json")
    (tmp_path / "path.csv").write_text("x,y\n0,0\n3,0\n")
    assert not any(map(is_plan, (tmp_path / "path.csv", tmp_path, "circle:2l", tmp_path / "none.json")))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"guidance": {}}, "no entry 'straight'"),
        ({"guidance": None, "dwell_bar": [1.0]}, "dwell_bar needs a number above 0"),
        ({"first_direction": 0}, "first_direction = 0"),
        ({"objective": "fun"}, "objective = fun"),
        ({"arrival": {"wished_s": 1800.0, "fastest_s": 900.0, "swing": None}}, r"arrive at a time \(--arrive\)"),
        ({"point": "tail"}, "point 'tail'"),
        ({"calibration": {"names": ["C_t"]}}, "calibration"),
        ({"minimum_dwell_bar": 0.0}, "not above 0"),
        ({"format": 1}, "has format 1"),
        ({"stated_error_over_l": 1e200}, "stated_error_over_l must be a finite number below 1e\\+100"),
        ({"reference": [[0.0, 0.0], [1e200, 0.0]]}, "reference must be 2 or more rows of 2 finite numbers"),
        ({"off_drawn_over_l": 1.0, "guidance": {"heading_rad": [1e300, -1e300]}}, "no entry 'straight'"),
        ({"robot": {"groups": {"omega_bar": 10.0}}}, "no entry 'tail_length_m'"),
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


READERS = [load_plan, load_schedule]  # of the planner and of the simulator


def written(folder: Path, **changes: Any) -> Path:
    path = folder / "plan.json"
    path.write_text(json.dumps({**saved("square"), **changes}))
    return path


def test_a_changed_number_is_noticed(tmp_path: Path) -> None:
    dwells = saved("square")["dwell_bar"]
    changed = {"dwell_bar": [dwells[0] * 1.01, *dwells[1:]]}
    damaged = r"was edited or damaged after it was written: .*; plan again, or delete"
    for reader in READERS:
        with pytest.raises(InputError, match=damaged):
            reader(written(tmp_path, **changed))
    edited = {name: value for name, value in {**saved("square"), **changed}.items() if name != "id"}
    (tmp_path / "edited.json").write_text(json.dumps(edited))
    assert load_plan(tmp_path / "edited.json") == {**edited, "id": plan_id(edited)}
    assert load_plan(written(tmp_path, **changed, id="0123456789ab"))["id"] == "0123456789ab"


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (f'"format": {FORMAT}', '"format": 99', f"has format 99, this version reads {FORMAT}"),
        ('"omega_bar": ', '"omega_bar": 9e9, "was": ', "omega_bar is not between"),
        ('"dwell_bar": [', '"dwell_bar": [NaN, ', "NaN is no finite number"),
        ('"predicted_rms_over_l": ', '"predicted_rms_over_l": 1e999, "was": ', "1e999 is no finite number"),
    ],
    ids=["format", "range", "NaN", "overflow"],
)
def test_both_readers_refuse_the_same_files(
    reader: Callable[[Path], object], tmp_path: Path, old: str, new: str, expected: str
) -> None:
    text = json.dumps(saved("square"))
    assert old in text
    (tmp_path / "plan.json").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=expected) as caught:
        reader(tmp_path / "plan.json")
    assert "\n" not in str(caught.value)


OTHER = ["", "[1, 2]", "{}", "\x00", "3", '{"format": FORMAT}', "[" * 100_000]


@pytest.mark.parametrize("text", OTHER, ids=range(len(OTHER)))
@pytest.mark.parametrize(
    ("reader", "name", "number"),
    [*((reader, "plan.json", FORMAT) for reader in READERS), (load_goal, "goal.json", GOAL_FORMAT)],
)
def test_other_files_are_refused(
    reader: Callable[[Path], object], name: str, number: int, tmp_path: Path, text: str
) -> None:
    (tmp_path / name).write_text(text.replace("FORMAT", str(number)))
    with pytest.raises(InputError, match=f"not a {name}".replace(".", r"\.")):
        reader(tmp_path / name)


def test_a_goal_reads_back(tmp_path: Path) -> None:
    content = json.loads(goal_file())
    (tmp_path / "goal.json").write_bytes(goal_file())
    assert load_goal(tmp_path / "goal.json") == content
    assert content["goal"] == [3, 0, 0]
    assert [next(iter(region)) for region in content["keep_out"]] == ["circle", "polygon"]
    assert np.array(content["walls"]) == pytest.approx(np.array(WALLS))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"format": 99}, f"format 99, this version reads {GOAL_FORMAT}"),
        ({"format": FORMAT, "reference": []}, f"format {FORMAT}"),
        ({"goal": [1.0, 2.0]}, "goal.json: goal must be 3 finite numbers"),
        ({"goal": [1.0, 2.0, float("nan")]}, "goal must be 3 finite numbers"),
        ({"margin_over_l": float("inf")}, "margin_over_l must be a finite number"),
        ({"margin_over_l": "wide"}, "margin_over_l must be a finite number"),
        ({"via": 3}, "via must be 0 or more rows of 2 finite numbers"),
        ({"via": [[1, 2, 3]]}, "via must be 0 or more rows of 2 finite numbers"),
        ({"keep_out": [{"circle": [0, 0, -1]}]}, "radius above 0"),
        ({"keep_out": [{"square": [0, 0, 1]}]}, "not a goal.json"),
        ({"walls": [[0, 0], [1, 1]]}, "three or more points"),
        ({"plan_id": 3}, "plan_id must be text"),
    ],
)
def test_edited_goals_are_refused(tmp_path: Path, changes: dict[str, Any], expected: str) -> None:
    (tmp_path / "goal.json").write_text(json.dumps({**json.loads(goal_file()), **changes}))
    with pytest.raises(InputError, match=expected) as caught:
        load_goal(tmp_path / "goal.json")
    assert "\n" not in str(caught.value)
