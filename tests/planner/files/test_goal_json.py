"""goal.json: what is written reads back; edited and foreign files are refused in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from planner.files.goal_files import write_goal_plan
from planner.files.goal_json import load_goal
from planner.files.plan_json import load_plan
from planner.goal.goal_plan import FORMAT
from planner.goal.to_goal import to_goal
from planner.paths.obstacles import Circle
from sim.io.errors import InputError
from sim.model.presets import PRESETS

BOX = [[-4, -4], [8, -4], [8, 6], [-4, 6]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trip")
    square = [[3, 3], [4, 3], [4, 4]]
    regions = [Circle(2.0, -1.5, 0.3), square]
    trip = to_goal((0, 0, 0), (4, 1, 0.5), PRESETS["paper-control"], keep_out=regions, walls=BOX, via=[(2, 0.5)])
    write_goal_plan(trip, folder)
    return folder


def test_it_reads_back_with_the_identity_of_its_plan(folder: Path) -> None:
    content = load_goal(folder / "goal.json")
    assert content == json.loads((folder / "goal.json").read_text())
    assert content["goal"] == [4, 1, 0.5]
    assert content["plan_id"] == load_plan(folder / "plan.json")["id"]
    assert load_plan(folder / "plan.json")["predicted_poses"][-1] == pytest.approx(content["predicted_end"])
    assert [next(iter(region)) for region in content["keep_out"]] == ["circle", "polygon"]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"format": 99}, f"format 99, this version reads {FORMAT}"),
        ({"goal": [1.0, 2.0]}, "should have 3 numbers"),
        ({"goal": [1.0, 2.0, float("nan")]}, "nan is no finite number"),
        ({"margin_over_l": float("inf")}, "inf is no finite number"),
        ({"margin_over_l": "wide"}, "not a goal.json"),
        ({"via": 3}, "not a goal.json"),
        ({"keep_out": [{"circle": [0, 0, -1]}]}, "radius above 0"),
        ({"keep_out": [{"square": [0, 0, 1]}]}, "not a goal.json"),
        ({"walls": [[0, 0], [1, 1]]}, "three or more points"),
        ({"plan_id": 3}, "plan_id is no text"),
    ],
)
def test_edited_files_are_refused(folder: Path, tmp_path: Path, changes: dict[str, Any], expected: str) -> None:
    content = json.loads((folder / "goal.json").read_text())
    (tmp_path / "goal.json").write_text(json.dumps({**content, **changes}))
    with pytest.raises(InputError, match=expected) as caught:
        load_goal(tmp_path / "goal.json")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "[1, 2]", "{}", "\x00", "3", '{"format": 1}', "[" * 100_000])
def test_other_files_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "goal.json").write_text(text)
    with pytest.raises(InputError, match=r"not a goal\.json"):
        load_goal(tmp_path / "goal.json")


def test_a_plan_is_no_goal(folder: Path) -> None:
    with pytest.raises(InputError, match=r"plan\.json: format 2"):
        load_goal(folder / "plan.json")
