"""Files of tables of one robot: they come back as they were, and a damaged one is refused in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim.io.errors import InputError
from sim.model.presets import PRESETS
from surrogate.one_robot.robot_table import RobotTable, load_robot_table
from surrogate.one_robot.tabulate import tabulate
from surrogate.table.model_file import load_table
from tests.surrogate.refusals import refusal


@pytest.fixture(scope="module")
def single() -> RobotTable:
    return tabulate(PRESETS["paper-control"])


def test_a_table_of_one_robot_comes_back_as_it_was(single: RobotTable, tmp_path: Path) -> None:
    single.save(tmp_path / "robot.json")
    again = load_table(tmp_path / "robot.json")
    assert again == single
    assert again.identity == single.identity


def test_damaged_tables_of_one_robot_are_refused(single: RobotTable, tmp_path: Path) -> None:
    """Or hold the same numbers, as where 1e-5 has become 1E-5."""
    path = tmp_path / "robot.json"
    single.save(path)
    contents = path.read_bytes()
    random = np.random.default_rng(6)
    same = 0
    for place in [*range(40), *random.integers(len(contents), size=160)]:
        broken = bytearray(contents)
        broken[place] ^= 1 << int(random.integers(8))
        path.write_bytes(broken)
        try:
            loaded = load_robot_table(path)
        except InputError:
            refusal(path, load_robot_table)
        else:
            same += 1
            assert loaded == single
    assert same < 10
    for size in [0, 1, len(contents) // 2, len(contents) - 3]:
        path.write_bytes(contents[:size])
        refusal(path, load_robot_table)
    for content in (b"\xff\xfe", b"[" * 100_000, b"[1]", b"9" * 10_000):
        path.write_bytes(content)
        assert "no table of a robot" in refusal(path, load_robot_table)
    assert "no such file" in refusal(tmp_path / "absent.json", load_robot_table)
    path.write_text('{"robot": {}, "dwells": [1.0]}')
    assert "has format 1, this version reads 3" in refusal(path, load_robot_table)


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("lag", [[1.0]], "no curves 'lag'"),
        ("spread", None, "no curves 'spread'"),
        ("steady", {}, "no 'omega_t_bar'"),
        ("robot", {"C_t": float("nan")}, "its numbers have no such form"),
        ("slopes", {"C_t": [1.0]}, "slopes are not finite numbers"),
        ("errors", {"v_x": {"rms": float("inf")}}, "errors are not finite"),
        ("before", 5, "its numbers have no such form"),
        ("errors", {"v_x": {"rms": "0.1"}}, "its numbers have no such form"),
        ("slopes", {"C_t": [["1", 2.0, 3.0], [1.0, 2.0, 3.0]]}, "its numbers have no such form"),
    ],
)
def test_wrong_numbers_of_one_robot_are_refused_though_the_hash_is_right(
    name: str, value: Any, expected: str, single: RobotTable, tmp_path: Path
) -> None:
    path = tmp_path / "robot.json"
    RobotTable(**{**vars(single), name: value}).save(path)
    assert expected in refusal(path, load_robot_table)


def test_an_edited_number_and_a_missing_key_of_one_robot_are_refused(single: RobotTable, tmp_path: Path) -> None:
    path = tmp_path / "robot.json"
    single.save(path)
    content = json.loads(path.read_text())
    for name in content:
        less = {key: part for key, part in content.items() if key != name}
        path.write_text(json.dumps(less))
        assert ("format" if name == "format" else "was changed") in refusal(path, load_robot_table)
    content["robot"]["omega_bar"] += 1
    path.write_text(json.dumps(content))
    assert "was changed" in refusal(path, load_robot_table)
