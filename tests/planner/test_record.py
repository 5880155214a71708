"""plan.json: what is written reads back; edited and foreign files are refused in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from planner.path import circle
from planner.plan import plan
from planner.record import FORMAT, load_plan, plan_record
from sim.io.errors import InputError
from sim.model.presets import PRESETS


@pytest.fixture(scope="module")
def record() -> dict[str, Any]:
    return json.loads(json.dumps(plan_record(plan(circle(2.0), PRESETS["paper-control"]))))  # type: ignore[no-any-return]


def written(record: dict[str, Any], folder: Path, **changes: Any) -> Path:
    path = folder / "plan.json"
    path.write_text(json.dumps({**record, **changes}))
    return path


def test_it_reads_back(record: dict[str, Any], tmp_path: Path) -> None:
    assert load_plan(written(record, tmp_path)) == record


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"format": 99}, f"has format 99, this version reads {FORMAT}"),
        ({"reference": []}, "reference must have two or more rows"),
        ({"reference": [[float("nan"), 0.0], [1.0, 1.0]]}, "reference must have two or more rows"),
        ({"stated_error_over_l": float("nan")}, "no finite number"),
        ({"robot": {"groups": {"omega_bar": 1e6}}}, "omega_bar is not between"),
        ({"robot": 3}, "not a plan.json"),
    ],
)
def test_edited_files_are_refused(
    record: dict[str, Any], tmp_path: Path, changes: dict[str, Any], expected: str
) -> None:
    with pytest.raises(InputError, match=expected) as caught:
        load_plan(written(record, tmp_path, **changes))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "[1, 2]", "{}", "\x00", '{"format": 2}'])
def test_other_files_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "plan.json").write_text(text)
    with pytest.raises(InputError, match=r"not a plan\.json"):
        load_plan(tmp_path / "plan.json")
