"""Robots and their TOML files are read, written and refused as by Python."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.page.first_state import first_options, slider_ends
from planner.planning.request import PlanRequest
from sim.inputs import load_robot
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.robot_toml import robot_toml
from sim.model.uncertainty import Sigma
from surrogate.table.model_file import load
from tests.planner.page.cases import CONTROL
from tests.planner.page.page_core import answer, answers, call, to_page
from tests.planner.page.parity import check_parity, refusal_of, without_digits

pytestmark = pytest.mark.usefixtures("empty_folder")

ROBOTS = [
    *PRESETS.values(),
    replace(CONTROL, name='it\'s "quoted" \\ ü\n\x7f', disc_offset=0.0123, tails=3),
    replace(CONTROL, tail_length=0.1 / 3, viscosity=1 / 7, motor_speed=4.44),
    replace(CONTROL, sigmas={"viscosity": Sigma(0.05, True), "tail_length": Sigma(0.00123, False)}),
]
TEXT = robot_toml(CONTROL)
VISCOSITY = "viscosity_Pa_s = 1.49"
CHANGES = [
    ("length_cm = 11", "length_mm = 110"), ("length_cm = 11", "length_in = 4.5"), ("count = 2", "count = 2.5"),
    ("count = 2", "count = 0"), (VISCOSITY, "viscosity_mPa_s = 1490"), ("count = 2", "count = '2'"),
    (VISCOSITY, "viscosity_Pa_s = -1.49"), (VISCOSITY, "viscosity = 1.49"), (VISCOSITY, ""),
    ("count = 2", "count = 2\ncolour = 'red'"), ("count = 2", "count = true"), ("[drag]", "drag"),
    ("length_cm = 11", "length_cm = 11\nlength_mm = 110"), ("length_cm = 11", "length_cm = 1e200"),
    *((VISCOSITY, f"{VISCOSITY}\n{more}") for more in (
        "viscosity_Pa_s_sigma = '10 %'", "viscosity_Pa_s_sigma = 0.1", "viscosity_Pa_s_sigma = 'much'",
        "viscosity_Pa_s_sigma = '60 %'", "viscosity_sigma = 0.1")),
    ("C_t = 3.0", "C_t = 3.0\nC_t_sigma = 0.1"), ("C_t = 3.0", "C_t = 3"), ("[drag]", "[drags]"),
    ('name = "paper-control"', ""), ('name = "paper-control"', "name = 7"), ("C_t = 3.0", "C_t = ['3']"),
    ('name = "paper-control"', "depth = 3"), ("radius_mm = 3.2", "radius_mm = 32"), ("speed_rpm", "speed_Hz"),
    ("radius_mm = 3.2", "diameter_mm = 6.4"), ("[fluid]", "[liquid]"), ("youngs_modulus", "young_modulus"),
    ("length_cm = 11", "viscosity_Pa_s = 11"), ("length_cm = 11", "lenght_mm = 110"), ("C_t = 3.0", "C_t = inf"),
    (VISCOSITY, "viscosity_Pa_s = 1,49"), ("[drag]", "[tails]\n[drag]"), ("count = 2", "count = 0b10 # two"),
    ('name = "paper-control"', 'name = "a'), ('name = "paper-control"', "name = 'a\\'\r"),
    ('name = "paper-control"', 'name = "\\u00e9 \\U0001F41F \\" \\\\"'),
    ('name = "paper-control"', 'name = "\\q"'),
]  # fmt: skip


def written(text: str, name: str) -> Path:
    Path(name).write_bytes(text.encode())
    return Path(name)


def check_robot(found: Any, wanted: Robot) -> None:
    page = to_page(wanted)
    del page["effects"]
    for name in ("timeScale", "omegaBar"):
        assert found.pop(name) == pytest.approx(page.pop(name), rel=1e-15)
    assert found == page


def test_robots_are_written_byte_for_byte_and_read_back() -> None:
    check_parity("robot_toml.js", "robotToml", robot_toml, [(robot,) for robot in ROBOTS])
    texts = [call("robot_toml.js", "robotToml", robot) for robot in ROBOTS]
    found = answers([("robot_toml.js", "readRobot", text, "robot.toml") for text in texts])
    for one, robot in zip(found, ROBOTS, strict=True):
        check_robot(one, robot)


def test_texts_of_robots_are_read_or_refused() -> None:
    refused = 0
    for old, new in CHANGES:
        assert old in TEXT
        text = TEXT.replace(old, new, 1)
        found = answer("robot_toml.js", "readRobot", text, "robot.toml")
        file = written(text, "robot.toml")
        if isinstance(found, InputError):
            assert without_digits(found) == without_digits(refusal_of(load_robot, file))
            refused += 1
        else:
            check_robot(found, load_robot(file))
    assert 20 < refused < len(CHANGES) - 5


@pytest.mark.parametrize("table", ["effects", "correction", "learnt_from", "calibration"])
def test_a_robot_that_python_must_make_is_refused(table: str) -> None:
    found = answer("robot_toml.js", "readRobot", f"{TEXT}\n[{table}]\nx = 1\n", "robot.toml")
    assert isinstance(found, InputError)
    assert f"has [{table}]" in str(found)
    assert "softflagella page --robot robot.toml" in str(found)


def fields(robot: Robot) -> dict[str, Any]:
    """Return the numbers of a robot without those that follow from them."""
    followed = ("timeScale", "omegaBar", "effects")
    return {name: part for name, part in to_page(robot).items() if name not in followed}


def test_scales_and_groups() -> None:
    for robot in (*PRESETS.values(), replace(CONTROL, disc_offset=0.02)):
        found = answer("robot.js", "makeRobot", fields(robot))
        assert found["timeScale"] == pytest.approx(robot.time_scale, rel=1e-15)
        assert found["omegaBar"] == pytest.approx(robot.omega_bar, rel=1e-15)
        groups = answer("robot.js", "groupValues", {**found, "omegaBar": robot.omega_bar})
        assert list(groups.items()) == list(robot.group_values().items())
    assert answer("robot.js", "groupValues", {"groups": {"C_t": 1.5}}) == {"C_t": 1.5}


def test_robots_that_cannot_be_are_refused() -> None:
    camel = {"tail_length": "tailLength", "tail_radius": "tailRadius", "motor_speed": "motorSpeed",
             "disc_offset": "discOffset", "youngs_modulus": "youngsModulus"}  # fmt: skip
    cases: list[dict[str, Any]] = [
        {"tails": 0}, {"tails": 65}, {"tails": 2.5}, {"tail_length": 0.0}, {"viscosity": -1.5}, {"C_t": -1e-7},
        {"motor_speed": 0.0}, {"disc_offset": -0.01}, {"tail_radius": 0.03}, {"youngs_modulus": 1e-320},
        {"tail_length": 1e200, "tail_radius": 1e-200}, {"viscosity": 1e-310, "motor_speed": 1e-300},
    ]  # fmt: skip
    for changes in cases:
        given = {**fields(CONTROL), **{camel.get(name, name): value for name, value in changes.items()}}
        with pytest.raises(ValueError, match=r".") as refusal:
            replace(CONTROL, **changes)
        assert str(answer("robot.js", "makeRobot", given)) == str(refusal.value)


def test_sliders_end_where_the_look_up_table_does() -> None:
    domain = load().domain
    ends, units = (
        slider_ends(CONTROL, domain),
        {"motor_speed": 2 * np.pi / 60, "viscosity": 1.0, "youngs_modulus": 1e6},
    )
    for field, key in zip(units, ("motorSpeed", "viscosity", "youngsModulus"), strict=True):
        reached = sorted(replace(CONTROL, **{field: end * units[field]}).omega_bar for end in ends[key])
        assert reached == pytest.approx(domain["omega_bar"], rel=0.1)


@pytest.mark.parametrize("wanted", [PlanRequest(dwell=1.0), PlanRequest(seed=3)])
def test_a_plan_that_the_page_cannot_make_is_refused(wanted: PlanRequest) -> None:
    with pytest.raises(InputError, match="no option for a dwell or a seed"):
        first_options(wanted, CONTROL, None)
