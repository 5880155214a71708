"""The files of a plan are Python's, byte for byte, if its numbers are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.files.plan_files import milliseconds, write_plan
from planner.files.plan_json import load_plan
from planner.files.tracker_header import DIRECTIONS, c_part, header_template
from sim.io.errors import InputError
from sim.io.provenance import code_version
from tests.planner.page.page_core import answer, answers, refusal_of
from tests.planner.page.plans import plan_to_page, planned

PARTS = {
    "codeVersion": code_version(),
    "directions": DIRECTIONS,
    "flash": c_part("schedule_flash.h"),
    "schedule": c_part("schedule.h"),
    "tracker": header_template(),
}
NAMES = ("plan.json", "plan.csv", "schedule.h", "tracker.h")


@pytest.mark.parametrize(
    ("name", "robot", "options"),
    [
        ("circle", "paper-control", {"objective": "flips"}),
        ("bend", "paper-control", {"point": "head_tip", "objective": "flips"}),
        ("square", "paper-triangle", {"objective": "flips"}),
        ("line", "paper-control", {"objective": "error"}),
    ],
)
def test_files(name: str, robot: str, options: dict[str, str], tmp_path: Path) -> None:
    result = planned(name, robot, **options)
    write_plan(result, tmp_path / "python")
    found = answer("plan_files.js", "planFiles", plan_to_page(result), PARTS)
    for file in NAMES:
        assert found[file] == (tmp_path / "python" / file).read_text(encoding="utf-8"), file
    (tmp_path / "plan.json").write_text(found["plan.json"], encoding="utf-8")
    assert load_plan(tmp_path / "plan.json")["id"] == result.to_dict()["id"]


def test_a_name_that_could_end_a_comment(tmp_path: Path) -> None:
    result = planned("line")
    robot = replace(result.robot, name="böse */ 3.1 #_-²½")
    result = replace(result, tracked=result.tracked._replace(robot=robot))
    write_plan(result, tmp_path)
    found = answer("plan_files.js", "planFiles", plan_to_page(result), PARTS)
    for file in NAMES:
        assert found[file] == (tmp_path / file).read_text(encoding="utf-8"), file


def test_whole_milliseconds() -> None:
    rng = np.random.default_rng(0)
    cases = [
        rng.uniform(0.01, 3, 200),
        np.array([65.535, 65.536, 200.0, 0.001]),
        np.array([0.0005, 0.001, 0.0015]),
    ]
    cases += [np.array([1.0, 0.0001]), np.array([0.0004])]
    found = answers([("plan_files.js", "milliseconds", case) for case in cases])
    for outcome, case in zip(found, cases, strict=True):
        if isinstance(outcome, InputError):
            assert str(outcome) == refusal_of(milliseconds, case)
        else:
            assert outcome == milliseconds(case)
    assert sum(isinstance(outcome, InputError) for outcome in found) >= 2
