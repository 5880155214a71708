"""A robot that the package's table does not know gets a table of its own, which is kept beside its file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from planner.__main__ import main
from planner.files.own_table import table_for
from planner.files.plan_json import load_plan
from planner.vehicle.calibration_table import CalibrationKnowledge
from sim.inputs import save_robot
from sim.io.errors import run_command
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from surrogate.table.model_file import load

CONTROL = PRESETS["paper-control"]
BIASED = replace(CONTROL, effects={"left_right_bias": 0.2})


def test_a_robot_that_the_package_s_table_knows_gets_that_table(tmp_path: Path) -> None:
    save_robot(CONTROL, tmp_path / "robot.toml")
    table = table_for(CONTROL, str(tmp_path / "robot.toml"), CalibrationKnowledge())
    assert table.identity == load().identity
    assert [path.name for path in tmp_path.iterdir()] == ["robot.toml"]


def test_a_corrected_robot_is_planned_for_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The command used to refuse until the user had made the robot's table by hand."""
    robot, kept = tmp_path / "robot.toml", tmp_path / "robot.table.json"
    save_robot(BIASED, robot)
    words = ["plan", "circle:2l", "--robot", str(robot), "--out"]
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


def test_a_table_of_another_robot_or_a_damaged_one_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, kept, none = tmp_path / "robot.toml", tmp_path / "robot.table.json", CalibrationKnowledge()
    kept.write_text("{}")
    save_robot(BIASED, robot)
    table = table_for(BIASED, str(robot), none)
    simulated: list[Robot] = []
    monkeypatch.setattr("surrogate.one_robot.tabulate.tabulate", lambda robot: simulated.append(robot) or table)
    assert table_for(BIASED, str(robot), none).identity == table.identity
    assert not simulated
    other = replace(BIASED, effects={"left_right_bias": 0.1})
    table_for(other, str(robot), none)
    assert simulated == [other]
