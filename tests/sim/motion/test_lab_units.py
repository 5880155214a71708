"""The motion in lab units: closed forms, the table of a lab, and the command that prints it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from sim.__main__ import main
from sim.io.errors import run_command
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.batches import steady_columns
from sim.motion.lab_units import LAB_COLUMNS, describe_motion, lab_columns, lab_motion

ROBOT = PRESETS["paper-control"]


def motion_of(robot: Robot = ROBOT) -> dict[str, np.ndarray]:
    return steady_columns({name: np.array([value]) for name, value in robot.group_values().items()}, title="")


def test_a_motion_by_hand() -> None:
    """A tail of 10 cm and a time unit of 2 s: numbers that can be checked in the head."""
    motion = {
        "omega_t_bar": np.array([math.pi]), "omega_h_bar": np.array([-2 * math.pi]),
        "omega_yr_bar": np.array([0.1]), "v_x": np.array([0.03]), "v_z": np.array([0.04]),
        "R_yr_over_l": np.array([0.5]), "theta_deg": np.array([30.0]),
    }  # fmt: skip
    lab = lab_columns(motion, 10.0, 2.0)
    assert tuple(lab) == LAB_COLUMNS
    wanted = {"omega_t_rpm": 15.0, "omega_h_rpm": -30.0, "omega_yr_rad_s": 0.05, "R_yr_cm": 5.0, "theta_deg": 30.0,
              "v_cm_s": 0.25, "circle_s": 40 * math.pi}  # fmt: skip
    assert {name: values.item() for name, values in lab.items()} == pytest.approx(wanted)
    at_rest = {name: np.array([0.0]) for name in motion}
    assert lab_columns(at_rest, 10.0, 2.0)["circle_s"] == math.inf


def test_lab_units_agree_with_each_other() -> None:
    """The motor's speed is the difference of the spins; a circle is 2 π R_yr long; slow motors in thick fluids."""
    robots = [ROBOT, replace(ROBOT, viscosity=2 * ROBOT.viscosity, motor_speed=ROBOT.motor_speed / 2)]
    motions = [motion_of(robot) for robot in robots]
    lab = lab_motion(robots, {name: np.concatenate([m[name] for m in motions]) for name in motions[0]})
    rpm = [robot.motor_speed * 30 / math.pi for robot in robots]
    assert lab["omega_t_rpm"] - lab["omega_h_rpm"] == pytest.approx(rpm, rel=1e-9)
    assert lab["v_cm_s"] * lab["circle_s"] == pytest.approx(2 * math.pi * lab["R_yr_cm"], rel=1e-9)
    assert lab["omega_yr_rad_s"] * lab["circle_s"] == pytest.approx([2 * math.pi] * 2)
    for name, ratio in (("R_yr_cm", 1.0), ("circle_s", 2.0), ("v_cm_s", 0.5)):
        assert lab[name][1] == pytest.approx(ratio * lab[name][0])


def test_the_lines_say_what_the_columns_hold() -> None:
    motion = motion_of()
    lab = lab_motion([ROBOT], motion)
    lines = describe_motion(ROBOT, motion).splitlines()
    assert lines[0] == "paper-control: 2 tails of 11 cm, motor at 43.26 rpm, fluid of 1.49 Pa s"
    assert f"{lab['v_cm_s'][0]:.4g} cm/s" in lines[6]
    assert f"({motion['R_yr_over_l'][0]:.4g} l)" in lines[4]
    assert lines[-1].endswith(f"{100 * motion['error'][0]:.2g} %")


@pytest.mark.parametrize("words", ["paper-control", "robot.toml"])
def test_the_command_prints_the_motion_of_a_robot(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(main, ["robot", "paper-control", "--out", "robot.toml"]) == 0
    capsys.readouterr()
    assert run_command(main, ["steady", words, "--out", "motion.csv"]) == 0
    assert capsys.readouterr().out.startswith(describe_motion(ROBOT, motion_of()))
    table = pd.read_csv("motion.csv")
    assert table["robot"].tolist() == ["paper-control"]
    assert list(table)[1 : 1 + len(LAB_COLUMNS)] == list(LAB_COLUMNS)
    assert table["omega_yr_bar"].item() == pytest.approx(motion_of()["omega_yr_bar"].item(), rel=1e-7)


def test_what_the_command_says_without_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(main, ["steady", "paper-measured"]) == 0
    assert "tails touch" in capsys.readouterr().out
    Path("points.csv").write_text("N\n2\n")
    for words, refusal in (
        ("points.csv", "name the file of their motion with --out"), ("paper", "no robot 'paper'"),
        ("robot.tml", "robot.tml: no such file"), (".", ". is a folder"),
    ):  # fmt: skip
        assert run_command(main, ["steady", words]) == 2
        assert refusal in capsys.readouterr().err
