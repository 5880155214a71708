"""Sweeps around a robot through the public function."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import softflagella as sf

ROBOT = sf.load_robot("paper-control")


def test_a_sweep_around_a_robot_varies_its_inputs_alone(tmp_path: Path) -> None:
    ranges = {"motor_speed_rpm": (20.0, 40.0), "C_yr": (1.0, 4.0)}
    sf.sweep(ROBOT, tmp_path / "sweep", inputs=ranges, rows=8, jobs=1)
    rows = sf.read_sweep(tmp_path / "sweep")
    values = ROBOT.group_values()
    assert len(rows) == 8
    assert rows["l_over_R"].to_numpy() == pytest.approx(values["l_over_R"])
    assert rows["C_yr"].between(1.0, 4.0).all()
    rpm = rows["omega_bar"] / values["omega_bar"] * ROBOT.motor_speed * 30 / 3.141592653589793
    assert rpm.between(20.0, 40.0).all()
    assert rpm.nunique() == 8


def test_a_sweep_that_cannot_be_says_why(tmp_path: Path) -> None:
    with pytest.raises(sf.InputError, match="inputs are for a sweep around a robot"):
        sf.sweep("sweep.toml", tmp_path, inputs={"tail_length_cm": (6, 11)})
    with pytest.raises(sf.InputError, match="tail_lenght"):
        sf.sweep(ROBOT, tmp_path, inputs={"tail_lenght_cm": (6, 11)})
    with pytest.raises(sf.InputError, match="ordered"):
        sf.sweep(replace(ROBOT, tails=3), tmp_path, inputs={"tail_length_cm": (11, 6)})
