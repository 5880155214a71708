"""plan.json: what is written reads back; edited and foreign files are refused in one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from planner.files.plan_json import load_plan
from planner.paths.path import circle
from planner.planning.plan import plan
from sim.io.errors import InputError
from sim.model.plan_file import FORMAT, plan_id
from sim.model.presets import PRESETS
from sim.model.schedule import load_schedule

READERS = [load_plan, load_schedule]  # of the planner and of the simulator


@pytest.fixture(scope="module")
def record() -> dict[str, Any]:
    return json.loads(json.dumps(plan(circle(2.0), PRESETS["paper-control"]).to_dict()))  # type: ignore[no-any-return]


def written(record: dict[str, Any], folder: Path, **changes: Any) -> Path:
    path = folder / "plan.json"
    path.write_text(json.dumps({**record, **changes}))
    return path


def test_it_reads_back(record: dict[str, Any], tmp_path: Path) -> None:
    assert load_plan(written(record, tmp_path)) == record
    assert load_plan(written(record, tmp_path, code_version="0")) == {**record, "code_version": "0"}


def test_a_changed_number_is_noticed(record: dict[str, Any], tmp_path: Path) -> None:
    """One flipped bit used to change a dwell in silence."""
    changed = {"dwell_bar": [record["dwell_bar"][0] * 1.01, *record["dwell_bar"][1:]]}
    for reader in READERS:
        with pytest.raises(
            InputError, match=r"was edited or damaged after it was written: .*; plan again, or delete"
        ):
            reader(written(record, tmp_path, **changed))
    edited = {name: value for name, value in {**record, **changed}.items() if name != "id"}
    assert load_plan(written(edited, tmp_path)) == {**edited, "id": plan_id(edited)}
    assert load_plan(written(record, tmp_path, **changed, id="0123456789ab"))["id"] == "0123456789ab"


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"format": 99}, f"has format 99, this version reads {FORMAT}"),
        ({"reference": []}, "reference must have two or more rows"),
        ({"reference": [["nan", 0.0], [1.0, 1.0]]}, "reference must have two or more rows"),
        ({"stated_error_over_l": float("nan")}, "no finite number"),
        ({"stated_error_over_l": "nan"}, "no finite number"),
        ({"robot": {"groups": {"omega_bar": 1e6}}}, "omega_bar is not between"),
        ({"robot": 3}, "not a plan.json"),
    ],
)
def test_edited_files_are_refused(
    record: dict[str, Any], tmp_path: Path, changes: dict[str, Any], expected: str
) -> None:
    with pytest.raises(InputError, match=expected) as caught:
        load_plan(written(record, tmp_path, **changes, id=plan_id({**record, **changes})))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("text", ["", "[1, 2]", "{}", "\x00", '{"format": 2}', "[" * 100_000])
def test_other_files_are_refused(reader: Callable[[Path], object], tmp_path: Path, text: str) -> None:
    (tmp_path / "plan.json").write_text(text)
    with pytest.raises(InputError, match=r"not a plan\.json"):
        reader(tmp_path / "plan.json")


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (f'"format": {FORMAT}', '"format": 99', f"has format 99, this version reads {FORMAT}"),
        ('"omega_bar": ', '"omega_bar": 9e9, "was": ', "omega_bar is not between"),
        ('"dwell_bar": [', '"dwell_bar": [NaN, ', "NaN is no finite number"),
        ('"predicted_rms_over_l": ', '"predicted_rms_over_l": 1e999, "was": ', "1e999 is no finite number"),
    ],
)
def test_both_readers_refuse_the_same_files(
    reader: Callable[[Path], object], record: dict[str, Any], tmp_path: Path, old: str, new: str, expected: str
) -> None:
    """`sim replay` replayed a plan.json of any format, and one with NaN in it."""
    text = json.dumps(record)
    assert old in text
    (tmp_path / "plan.json").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=expected) as caught:
        reader(tmp_path / "plan.json")
    assert "\n" not in str(caught.value)
