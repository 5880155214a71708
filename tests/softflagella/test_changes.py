"""A command changes its robot: --set KEY=VALUE."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from common.changes import ChangedRobot
from common.errors import InputError
from planner.vehicle import from_table
from sim.inputs import load_robot
from sim.knowledge import CalibrationKnowledge, knowledge_toml
from sim.robot_rows import robot_rows
from softflagella.__main__ import main, program_of
from softflagella.shadowing import COMMANDED

VEHICLE = "speed_cm_s = 0.5\nturn_left_deg_s = 3\nturn_right_deg_s = 3\n"
REFUSALS = {
    "fluid.viscosity=0.7": "--set fluid.viscosity: a robot has no such entry; is it fluid.viscosity_Pa_s?",
    "viscosity_Pa_s=0.7": "is it fluid.viscosity_Pa_s?",
    "motor.sped_rpm=4": "is it motor.speed_rpm?",
    "tails.length=9": "is it tails.length_cm or head.length_mm?",
    "colour=red": "there are name, tails.count, tails.length_cm",
    "motor.speed_rpm=fast": "--set: [motor] speed_rpm = 'fast'; give a number",
    "motor.speed_rpm=0,7": "'0,7'; give a number",
    "motor.speed_rpm": "write KEY=VALUE",
    "=3": "write KEY=VALUE",
    "tails.count=2.5": "--set: N = 2.5",
    "name.first=3": "a robot has no such entry",
    "effects.end_over=5": "is it end_over_end_drag?",
}


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    main(["robot", "paper-control", "--out", "robot.toml"])
    return Path("robot.toml")


def test_every_command_with_a_robot_takes_changes() -> None:
    for package in COMMANDED:
        for name, command in program_of(package).commands.items():
            theirs, own = command.parameters()
            words = command.parser(name).format_help()
            assert ("--set KEY=VALUE" in words) == bool({"robot", "robots", "preset"} & {*theirs, *own}), name


@pytest.mark.parametrize("words", REFUSALS)
def test_a_change_that_cannot_be_is_refused(words: str, robot: Path) -> None:
    with pytest.raises(InputError) as refusal:
        main(["plan", "circle:2l", "--robot", str(robot), "--set", words, "--out", "plan"])
    assert REFUSALS[words] in str(refusal.value)
    assert not Path("plan").exists()


@pytest.mark.parametrize("words", ["track plan.json", "steady points.csv", "replay plan.json --out t.csv"])
def test_a_change_without_a_robot_is_refused(words: str) -> None:
    with pytest.raises(InputError, match="changes a robot, and none is given"):
        main([*words.split(), "--set", "motor.speed_rpm=4"])


def test_a_preset_that_there_is_not_is_named_as_it_was_typed(robot: Path) -> None:
    with pytest.raises(InputError, match="no preset 'thin'; there are"):
        main(["robot", "thin", "--set", "motor.speed_rpm=4", "--out", "thin.toml"])


def test_a_robot_is_written_with_its_changes_and_only_then(robot: Path) -> None:
    changes = ["--set", "fluid.viscosity_mPa_s=700", "--set", "effects.end_over_end_drag=5", "--set", "name=thin"]
    main(["robot", "paper-control", *changes, "--out", "thin.toml"])
    thin = load_robot("thin.toml")
    assert (thin.name, thin.viscosity, thin.effects) == ("thin", 0.7, {"end_over_end_drag": 5})
    assert load_robot("paper-control") == load_robot(robot)


def test_changes_are_of_the_robot_that_has_them(robot: Path) -> None:
    faster = ChangedRobot("paper-control", {"motor.speed_rpm": 60.0})
    speeds = [load_robot(each).motor_speed for each in ("paper-control", faster, robot, "paper-control")]
    assert speeds[1] > speeds[0] == speeds[2] == speeds[3]
    assert [each.name for each in robot_rows([faster, "paper-control"]).robots] == ["paper-control"] * 2


def test_a_plan_is_that_of_the_changed_robot(robot: Path) -> None:
    main(["robot", "paper-control", "--set", "motor.speed_rpm=60", "--out", "fast.toml"])
    main(["plan", "circle:2l", "--robot", "fast.toml", "--out", "plan"])
    main(["plan", "circle:2l", "--robot", str(robot), "--set", "motor.speed_rpm=60", "--out", "changed"])
    for name in ("plan.json", "plan.csv", "schedule.h", "plan.svg"):
        assert Path("plan", name).read_text() == Path("changed", name).read_text()


def test_the_table_of_a_changed_robot_is_not_kept_beside_the_file(
    robot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept: list[Path | None] = []
    monkeypatch.setattr(from_table, "_kept_table", lambda robot, place, known: kept.append(place))
    monkeypatch.setattr(from_table, "_simulated_table", lambda robot, place: from_table.default_table())
    for changes in ([], ["--set", "motor.speed_rpm=60"]):
        main(["plan", "circle:2l", "--robot", str(robot), "--own-table", *changes, "--out", "plan"])
    assert kept == [Path("robot.table.json"), None]


def test_a_vehicle_is_changed_in_any_unit(robot: Path) -> None:
    Path("vehicle.toml").write_text(VEHICLE)
    words = ["plan", "circle:1m", "--robot", "vehicle.toml", "--out", "plan"]
    main([*words, "--set", "speed_mm_s=6"])
    assert json.loads(Path("plan/plan.json").read_text())["robot"]["vehicle"]["speed_m_s"] == [0.006, 0]
    with pytest.raises(InputError, match="spead_mm_s is no line of a vehicle"):
        main([*words, "--set", "spead_mm_s=6"])


def test_a_doubtful_number_is_asked_about_as_in_the_file(robot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["robot", "paper-control", "--set", "fluid.viscosity_mPa_s=1.49", "--out", "thin.toml"])
    assert "viscosity_mPa_s = 1.49 is 0.001 times" in capsys.readouterr().err


def test_a_sweep_refers_to_a_file(robot: Path) -> None:
    with pytest.raises(InputError, match="names the file of its robot"):
        main(["dataset", "config", "--robot", str(robot), "--set", "motor.speed_rpm=4", "--out", "sweep.toml"])


def test_a_fitted_number_that_is_changed_loses_its_uncertainty(
    robot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    known = CalibrationKnowledge(
        ("C_t", "C_r", "C_yr", "viscosity"),
        0.01 * np.array([[4, 1, 0, 0], [1, 4, 0, 0], [0, 0, 4, 1], [0, 0, 1, 9]]),
    )
    Path("corrected.toml").write_text(robot.read_text() + knowledge_toml(known))
    words = ["plan", "circle:2l", "--robot", "corrected.toml", "--objective", "flips", "--out", "plan"]
    main([*words, "--set", "fluid.viscosity_mPa_s=1490", "--set", "motor.speed_rpm=40"])
    content = json.loads(Path("plan/plan.json").read_text())
    assert content["calibration"]["names"] == ["C_t", "C_r", "C_yr"]
    assert content["calibration"]["covariance"] == known.covariance[:3, :3].tolist()
    assert "--set replaces fluid.viscosity_mPa_s, which the calibration fitted" in capsys.readouterr().err
    main([*words, "--set", "drag.C_t=3"])  # is what it was, but no longer what was fitted
    said = capsys.readouterr()
    assert "if the coefficients are exact" in said.out
    assert "--set replaces drag.C_t" in said.err
    main([*words, "--set", "motor.speed_rpm=40"])
    assert "--set" not in capsys.readouterr().err
