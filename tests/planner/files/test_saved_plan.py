"""A plan made again from plan.json gives the same orders; old files are computed again; others are refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.files.goal_files import write_goal_plan
from planner.files.plan_files import write_plan
from planner.files.saved_plan import is_plan, restore_plan
from planner.goal.to_goal import to_goal
from planner.jobs.clear_plan import plan_clear
from planner.paths.obstacles import Circle, FreeSpace
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.tracked_point import tracked_vehicle
from sim.io.errors import InputError
from sim.model.plan_file import plan_id
from sim.model.presets import PRESETS
from tests.planner.compiled import CompiledTracker
from tests.planner.vehicles import PROMPT

ROBOT = PRESETS["paper-control"]
CORNER = [[0.0, 0.0], [3.0, 0.0], [3.0, 3.0]]
KNOWN = CalibrationKnowledge(("C_t",), np.array([[1e-4]]), current=(2e-4, 1e-4), current_error=(1e-5, 0.0))
NEW = ("guidance", "own_table", "calibration", "camera")  # entries that files from before do not have


def _clear() -> Plan:
    path, space = Path2D.of([[0.0, 0.0], [6.0, 0.0]]), FreeSpace((Circle(3.0, 0.2, 0.5),))
    request = PlanRequest(objective="flips")
    return plan_clear(path, tracked_vehicle(ROBOT, None, "head_centre", None), request, space)


PLANS: dict[str, Callable[[], Plan]] = {
    "circle": lambda: plan(circle(2.0), ROBOT),
    "square": lambda: plan(polygon(4, 3.0), ROBOT, minimum_dwell=0.8),
    "head tip": lambda: plan(CORNER, ROBOT, point="head_tip"),
    "pivot": lambda: plan(CORNER, ROBOT, point="pivot"),
    "current": lambda: plan(circle(2.0), ROBOT, knowledge=KNOWN),
    "goal": lambda: to_goal((0, 0, 0), (4, 1, 1), ROBOT).plan,
    "obstacles": _clear,
}


@cache
def made(name: str) -> Plan:
    return PLANS[name]()


def saved(name: str) -> dict[str, Any]:
    return json.loads(json.dumps(made(name).to_dict()))  # type: ignore[no-any-return]


def orders(result: Plan, count: int = 200) -> list[tuple[int, float]]:
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
    result, same = made(name), restore_plan(saved(name))
    assert np.array(orders(same)) == pytest.approx(np.array(orders(result)), abs=1e-6)
    assert same.warnings == result.warnings
    content = saved(name)
    again = json.loads(json.dumps(same.to_dict()))
    assert again.keys() == content.keys()
    for key in ("reference", "predicted_poses", "dwell_s", "raw_path"):
        assert np.array(again[key]) == pytest.approx(np.array(content[key]), abs=1e-12)
    assert again["guidance"]["heading_rad"] == pytest.approx(content["guidance"]["heading_rad"], abs=1e-12)
    assert same.track == pytest.approx(result.track, abs=1e-9)


def test_it_has_what_a_calibration_found_and_what_it_keeps_clear_of() -> None:
    known = restore_plan(saved("current")).tracked.knowledge
    assert (known.names, known.current, known.current_error) == (KNOWN.names, KNOWN.current, KNOWN.current_error)
    assert known.covariance == pytest.approx(KNOWN.covariance)
    kept, same = made("obstacles").kept_clear, restore_plan(saved("obstacles")).kept_clear
    assert kept is not None
    assert same is not None
    assert kept.to_dict() == same.to_dict()


def test_the_microcontroller_gets_the_same_tracker(tmp_path: Path) -> None:
    """Written again, tracker.h gives the orders of the plan in memory."""
    compiled = CompiledTracker(restore_plan(saved("square")), tmp_path)
    now = 0.0
    for direction, flip_at in orders(made("square"), 30):
        command = compiled.update(now)
        assert (command.direction, command.flip_at) == (direction, pytest.approx(flip_at, abs=1e-3))
        now = command.flip_at


@pytest.mark.parametrize("name", ["circle", "square", "head tip", "pivot", "goal", "obstacles"])
def test_a_file_from_before_is_computed_again(name: str) -> None:
    old = {key: value for key, value in saved(name).items() if key not in NEW}
    result, same = made(name), restore_plan(old)
    heading = same.declared.reference.heading
    assert heading == pytest.approx(result.declared.reference.heading, abs=1e-3)
    far, near = (swim(Tracker(each), result, result.tracked.vehicle, PROMPT).rms() for each in (same, result))
    assert far < 1.1 * near + 0.002


def test_the_files_of_jobs_and_their_folder_lead_to_the_plan(tmp_path: Path) -> None:
    write_goal_plan(to_goal((0, 0, 0), (3, 1, 1), ROBOT), tmp_path / "trip")
    places = [tmp_path / "trip", tmp_path / "trip" / "plan.json", tmp_path / "trip" / "goal.json"]
    first, *others = [restore_plan(place) for place in places]
    assert all(is_plan(place) for place in places)
    assert all(other.to_dict() == first.to_dict() for other in others)
    write_plan(made("circle"), tmp_path / "circle")
    (tmp_path / "circle" / "goal.json").write_text((tmp_path / "trip" / "goal.json").read_text())
    with pytest.raises(InputError, match=r"is of plan .* is another one; plan again"):
        restore_plan(tmp_path / "circle" / "goal.json")


def test_paths_are_no_plans(tmp_path: Path) -> None:
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
        ({"stated_error_over_l": 1e200}, "stated_error_over_l = 1e\\+200 is no finite number below 1e\\+100"),
        ({"reference": [[0.0, 0.0], [1e200, 0.0]]}, "reference must have two or more rows"),
        ({"off_drawn_over_l": 1.0, "guidance": {"heading_rad": [1e300, -1e300]}}, "lacks what is needed"),
        ({"robot": {"groups": {"omega_bar": 10.0}}}, "lacks what is needed"),
    ],
)
def test_edited_plans_are_refused(changes: dict[str, Any], expected: str, tmp_path: Path) -> None:
    content = {**saved("circle"), **changes}
    content["id"] = plan_id(content)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(content))
    for source in (content, path):
        with pytest.raises(InputError, match=expected) as caught:
            restore_plan(source)
        assert "\n" not in str(caught.value)


def test_another_table_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    restore_plan({**saved("circle"), "model": "0123"})
    assert "was made with look-up table 0123" in capsys.readouterr().err
