"""plan.json and goal.json: what is written reads back; edited and foreign files are refused in one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from planner.files.goal_files import write_goal_plan
from planner.files.goal_json import load_goal
from planner.files.plan_json import load_plan
from planner.goal.goal_plan import FORMAT as GOAL_FORMAT
from sim.io.errors import InputError
from sim.model.plan_file import FORMAT, plan_id
from sim.model.schedule import load_schedule
from tests.planner.plans import WALLS, hindered_trip, planned
from tests.shared import shared

READERS = [load_plan, load_schedule]  # of the planner and of the simulator


@cache
def record() -> dict[str, Any]:
    return json.loads(json.dumps(planned().to_dict()))  # type: ignore[no-any-return]


def written(folder: Path, **changes: Any) -> Path:
    path = folder / "plan.json"
    path.write_text(json.dumps({**record(), **changes}))
    return path


def test_it_reads_back(tmp_path: Path) -> None:
    assert load_plan(written(tmp_path)) == record()
    assert load_plan(written(tmp_path, code_version="0")) == {**record(), "code_version": "0"}


def test_a_changed_number_is_noticed(tmp_path: Path) -> None:
    dwells = record()["dwell_bar"]
    changed = {"dwell_bar": [dwells[0] * 1.01, *dwells[1:]]}
    damaged = r"was edited or damaged after it was written: .*; plan again, or delete"
    for reader in READERS:
        with pytest.raises(InputError, match=damaged):
            reader(written(tmp_path, **changed))
    edited = {name: value for name, value in {**record(), **changed}.items() if name != "id"}
    (tmp_path / "edited.json").write_text(json.dumps(edited))
    assert load_plan(tmp_path / "edited.json") == {**edited, "id": plan_id(edited)}
    assert load_plan(written(tmp_path, **changed, id="0123456789ab"))["id"] == "0123456789ab"


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"reference": []}, "reference must have two or more rows"),
        ({"reference": [["nan", 0.0], [1.0, 1.0]]}, "reference must have two or more rows"),
        ({"stated_error_over_l": "nan"}, "no finite number"),
        ({"robot": 3}, "not a plan.json"),
    ],
)
def test_edited_plans_are_refused(tmp_path: Path, changes: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError, match=expected) as caught:
        load_plan(written(tmp_path, **changes, id=plan_id({**record(), **changes})))
    assert "\n" not in str(caught.value)


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
    text = json.dumps(record())
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


@shared
def goal_file() -> str:
    """Return goal.json of a trip, as it is written."""
    with TemporaryDirectory() as folder:
        write_goal_plan(hindered_trip(), Path(folder))
        content = load_goal(Path(folder, "goal.json"))
        made = load_plan(Path(folder, "plan.json"))
        assert content["plan_id"] == made["id"]
        assert made["predicted_poses"][-1] == pytest.approx(content["predicted_end"])
        return Path(folder, "goal.json").read_text()


def test_a_goal_reads_back(tmp_path: Path) -> None:
    content = json.loads(goal_file())
    (tmp_path / "goal.json").write_text(goal_file())
    assert load_goal(tmp_path / "goal.json") == content
    assert content["goal"] == [3, 0, 0]
    assert [next(iter(region)) for region in content["keep_out"]] == ["circle", "polygon"]
    assert np.array(content["walls"]) == pytest.approx(np.array(WALLS))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"format": 99}, f"format 99, this version reads {GOAL_FORMAT}"),
        ({"format": FORMAT, "reference": []}, f"format {FORMAT}"),
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
def test_edited_goals_are_refused(tmp_path: Path, changes: dict[str, Any], expected: str) -> None:
    (tmp_path / "goal.json").write_text(json.dumps({**json.loads(goal_file()), **changes}))
    with pytest.raises(InputError, match=expected) as caught:
        load_goal(tmp_path / "goal.json")
    assert "\n" not in str(caught.value)
