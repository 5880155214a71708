"""robot.toml is read and written as Python does it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sim.inputs import load_robot
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.robot_toml import robot_toml
from sim.model.uncertainty import Sigma
from tests.planner.page.page_core import answer, answers, call, without_digits
from tests.planner.page.plans import robot_to_page

BASE = PRESETS["paper-control"]
ROBOTS = [
    *PRESETS.values(),
    replace(BASE, name='it\'s "quoted" \\ ü\n\x7f', disc_offset=0.0123, tails=3),
    replace(BASE, tail_length=0.1 / 3, viscosity=1 / 7, motor_speed=4.44),
    replace(BASE, sigmas={"viscosity": Sigma(0.05, True), "tail_length": Sigma(0.00123, False)}),
]
TEXT = robot_toml(BASE)
CHANGES = [
    ("length_cm = 11", "length_mm = 110"), ("length_cm = 11", "length_in = 4.5"), ("count = 2", "count = 2.5"),
    ("count = 2", "count = 0"), ("viscosity_Pa_s = 1.49", "viscosity_mPa_s = 1490"), ("count = 2", "count = '2'"),
    ("viscosity_Pa_s = 1.49", "viscosity_Pa_s = -1.49"), ("viscosity_Pa_s = 1.49", "viscosity = 1.49"),
    ("viscosity_Pa_s = 1.49", ""), ("count = 2", "count = 2\ncolour = 'red'"), ("count = 2", "count = true"),
    ("length_cm = 11", "length_cm = 11\nlength_mm = 110"), ("length_cm = 11", "length_cm = 1e200"),
    ("viscosity_Pa_s = 1.49", "viscosity_Pa_s = 1.49\nviscosity_Pa_s_sigma = '10 %'"),
    ("viscosity_Pa_s = 1.49", "viscosity_Pa_s = 1.49\nviscosity_Pa_s_sigma = 0.1"),
    ("viscosity_Pa_s = 1.49", "viscosity_Pa_s = 1.49\nviscosity_Pa_s_sigma = 'much'"),
    ("viscosity_Pa_s = 1.49", "viscosity_Pa_s = 1.49\nviscosity_Pa_s_sigma = '60 %'"),
    ("viscosity_Pa_s = 1.49", "viscosity_Pa_s = 1.49\nviscosity_sigma = 0.1"),
    ("C_t = 3.0", "C_t = 3.0\nC_t_sigma = 0.1"), ("C_t = 3.0", "C_t = 3"), ("[drag]", "[drags]"),
    ('name = "paper-control"', ""), ('name = "paper-control"', "name = 7"), ("C_t = 3.0", "C_t = ['3']"),
    ('name = "paper-control"', "depth = 3"), ("radius_mm = 3.2", "radius_mm = 32"), ("speed_rpm", "speed_Hz"),
    ("radius_mm = 3.2", "diameter_mm = 6.4"), ("[fluid]", "[liquid]"), ("youngs_modulus", "young_modulus"),
    ("length_cm = 11", "viscosity_Pa_s = 11"), ("length_cm = 11", "lenght_mm = 110"),
    ("C_t = 3.0", "C_t = inf"), ("[drag]", "drag"), ("viscosity_Pa_s = 1.49", "viscosity_Pa_s = 1,49"),
]  # fmt: skip


def check_robot(found: Any, wanted: Robot) -> None:
    page = robot_to_page(wanted)
    for name in ("timeScale", "omegaBar"):
        assert found.pop(name) == pytest.approx(page.pop(name), rel=1e-15)
    assert found == page


def test_robots_are_written_byte_for_byte_and_read_back() -> None:
    pages = [robot_to_page(robot) for robot in ROBOTS]
    assert answers([("robot_toml.js", "robotToml", page) for page in pages]) == list(map(robot_toml, ROBOTS))
    texts = [call("robot_toml.js", "robotToml", page) for page in pages]
    for found, robot in zip(
        answers([("robot_toml.js", "readRobot", text, "robot.toml") for text in texts]), ROBOTS, strict=True
    ):
        check_robot(found, robot)


@pytest.mark.parametrize(("old", "new"), CHANGES, ids=[new or f"no {old}" for old, new in CHANGES])
def test_texts_are_read_or_refused_in_the_same_words(old: str, new: str, tmp_path: Path) -> None:
    assert old in TEXT
    file = tmp_path / "robot.toml"
    file.write_text(TEXT.replace(old, new, 1), encoding="utf-8")
    found = answer("robot_toml.js", "readRobot", file.read_text(encoding="utf-8"), str(file))
    try:
        wanted = load_robot(file)
    except InputError as refusal:
        wanted_words = without_digits(refusal)
        assert without_digits(found) == wanted_words
    else:
        check_robot({**found, "name": Path(found["name"]).name}, wanted)


@pytest.mark.parametrize("table", ["effects", "correction", "learnt_from", "calibration"])
def test_a_robot_that_python_must_make_is_refused(table: str) -> None:
    found = answer("robot_toml.js", "readRobot", f"{TEXT}\n[{table}]\nx = 1\n", "robot.toml")
    assert isinstance(found, InputError)
    assert f"has [{table}]" in str(found)
    assert "softflagella page --robot robot.toml" in str(found)
