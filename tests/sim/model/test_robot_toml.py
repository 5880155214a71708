"""Robots as files: any unit is read, and what is written is read back to the last bit."""

from __future__ import annotations

import re
import tomllib
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from common.errors import InputError, InputWarning
from common.units import Sigma
from sim.inputs import load_robot, save_robot
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.robot_toml import ENTRIES, doubtful, read_robot, robot_toml
from sim.model.uncertainty import DEFAULTS

CONTROL, MEASURED = PRESETS["paper-control"], PRESETS["paper-measured"]
LAB = """\
[tails]
count = 3
length_cm = 9
radius_mm = 3.2
youngs_modulus_MPa = 1.2
[head]
radius_mm = 16
length_in = 2.5
[fluid]
viscosity_cP = 1490
[motor]
speed_rpm = 90
[drag]
C_t = 3.0
C_r = 2.8
C_yr = 2.0
"""
IN_SI = {
    "tails": 3, "tail_length": 0.09, "tail_radius": 0.0032, "youngs_modulus": 1.2e6, "head_radius": 0.016,
    "head_length": 0.0635, "viscosity": 1.49, "motor_speed": 9.42477796076938,
}  # fmt: skip


def read(text: str, folder: Path) -> Robot:
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    return load_robot(folder / "robot.toml")


def test_a_robot_in_the_units_of_a_laboratory(tmp_path: Path) -> None:
    robot = read(LAB, tmp_path)
    assert {name: getattr(robot, name) for name in IN_SI} == pytest.approx(IN_SI, rel=1e-15)
    assert read("\ufeff" + LAB, tmp_path) == robot


@pytest.mark.parametrize(
    ("given", "doubted", "question"),
    [
        ("youngs_modulus_MPa = 1.2", "youngs_modulus_MPa = 1.2e6", "1.2e+06 is 1,000,000 times"),
        ("length_cm = 9", "length_m = 9", "9 is 82 times that of the paper's robot; is its unit cm?"),
        ("radius_mm = 3.2", "radius_cm = 320", "is its unit um?"),
        ("length_in = 2.5", "length_m = 4.5", "4.5 is 75 times that of the paper's robot; is its unit cm?"),
        ("radius_mm = 16", "radius_m = 16", "is its unit mm?"),
        ("viscosity_cP = 1490", "viscosity_Pa_s = 1490", "; is its unit mPa_s?"),
        ("viscosity_cP = 1490", "viscosity_cP = 1.49", " is 0.001 times that of the paper's"),
        ("speed_rpm = 90", "speed_rpm = 1e5", "is it right?"),
        ("viscosity_cP = 1490", "viscosity_Pa_s = 1e-321", "is it right?"),  # and 0 in mPa_s
        ("C_t = 3.0", "C_t = 300", "300 is 100 times that of the paper's robot; is it right?"),
    ],
)  # fmt: skip
def test_a_number_far_from_those_of_silicone_in_glycerine_is_asked_about(
    given: str, doubted: str, question: str
) -> None:
    assert not [*doubtful(tomllib.loads(LAB))]
    (asked,) = doubtful(tomllib.loads(LAB.replace(given, doubted)))
    assert asked.startswith(doubted.split("=")[0])
    assert question in asked


def test_all_doubts_are_one_warning_and_usual_robots_have_none(tmp_path: Path) -> None:
    read(LAB, tmp_path)
    read(LAB.replace("C_yr = 2.0", "C_yr = 0"), tmp_path)
    doubted = LAB.replace("length_cm = 9", "length_m = 9").replace("C_t = 3.0", "C_t = 300")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("default")  # as commands do
        assert read(doubted, tmp_path) == read(doubted, tmp_path)
        load_robot(tmp_path / "robot.toml")  # from another place
    (warning,) = told
    assert warning.category is InputWarning
    for part in ("robot.toml: length_m = 9 is", ", C_t = 300 is"):
        assert part in str(warning.message)


def test_a_file_in_si_units_is_read_as_before(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "reference" / "robot.toml").read_text()
    assert "length_m = 0.11" in text
    assert read(text, tmp_path) == PRESETS["paper-measured"]


REFUSALS = {
    "no unit": ("length_cm = 9", "length = 9", "[tails] length has no unit; give one of length_m, length_cm"),
    "another kind of unit": ("length_cm = 9", "length_rpm = 9", "unknown entry [tails] length_rpm"),
    "two units": ("length_cm = 9", "length_cm = 9\nlength_mm = 90", "length_mm are the same number; drop one"),
    "text": ("length_cm = 9", "length_cm = '9'", "[tails] length_cm = '9'; give a number"),
    "below 0": ("length_cm = 9", "length_cm = -9", "[tails] length_cm = -9; it must be above 0"),
    "no tails": ("count = 3", "count = 0", "N = 0"),
    "missing": ("length_cm = 9", "", "missing entry [tails] length_cm"),
    "no TOML": ("[tails]", "[tails", "not TOML"),
    "above all tables": ("[tails]", "length_cm = 9\n[tails]", "length_cm is in no table; a robot has [tails]"),
    "sigma too large": ("length_cm = 9", "length_cm = 9\nlength_cm_sigma = 7", "length_cm_sigma = 7; a standard"),
    "sigma in words": ("length_cm = 9", 'length_cm = 9\nlength_cm_sigma = "ten %"', "length_cm_sigma"),
    "sigma no number": ("length_cm = 9", "length_cm = 9\nlength_cm_sigma = true", "a number in its unit, or"),
    "sigma below 0": ("length_cm = 9", "length_cm = 9\nlength_cm_sigma = -1", "from 0 to half"),
    "sigma in per cent": ("length_cm = 9", 'length_cm = 9\nlength_cm_sigma = "60 %"', "from 0 to half"),
    "sigma of a count": ("count = 3", "count = 3\ncount_sigma = 1", "[tails] count_sigma: this number takes no"),
    "a diameter": ("radius_mm = 16", "diameter_mm = 32", "is it [head] radius_mm, half of it?"),
    "a diameter of tails": ("radius_mm = 3", "diameter_mm = 6", "is it [tails] radius_mm, half of it?"),
    "misspelt": ("length_cm = 9", "lenght_cm = 9", "unknown entry [tails] lenght_cm; is it [tails] length_cm?"),
    "no such unit": ("speed_rpm = 90", "speed_V = 6", "unknown entry [motor] speed_V; is it [motor] speed_rpm?"),
    "another table": ("C_t = 3.0", "C_t = 3.0\nlength_mm = 16", "[drag] length_mm; is it [head] length_mm?"),
    "cSt": ("viscosity_cP", "viscosity_cSt", "[fluid] viscosity_cSt is a kinematic viscosity; give"),
    "mm²/s": ("viscosity_cP", "kinematic_viscosity_mm2_s", "(mm²/s) times the density of the liquid in g/cm³"),
    "misspelt table": ("[motor]", "[moter]", "unknown entry [moter] speed_rpm; is it [motor] speed_rpm?"),
    "a correction": ("[motor]", "[correction]\nlow = [2]\n[motor]", "[correction] is no longer read; calibrate"),
    "like no other": ("[motor]", "colour = 1\n[motor]", "[fluid] colour; a robot has [tails], [head]"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSALS)
def test_what_is_no_robot_is_refused(case: str, tmp_path: Path) -> None:
    old, new, words = REFUSALS[case]
    assert old in LAB
    with pytest.raises(InputError, match=re.escape(words)) as refusal:
        read(LAB.replace(old, new, 1), tmp_path)
    assert "robot.toml" in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_standard_deviation_may_have_a_unit_of_its_own(tmp_path: Path) -> None:
    robot = read(LAB.replace("length_cm = 9", "length_cm = 9\nlength_mm_sigma = 2"), tmp_path)
    assert robot.sigmas == {"tail_length": Sigma(0.002, False)}
    assert read(robot_toml(robot), tmp_path) == robot


def test_effects_and_stated_standard_deviations_are_read_back(tmp_path: Path) -> None:
    stated = {
        "youngs_modulus": Sigma(0.07, True),
        "tail_length": Sigma(5e-4, False),
        "disc_offset": Sigma(0.03, True),
        "viscosity": Sigma(0.0, False),
    }
    robot = replace(MEASURED, sigmas=stated, effects={"end_over_end_drag": 4.5}, disc_offset=0.012)
    save_robot(robot, tmp_path / "robot.toml")
    found = load_robot(tmp_path / "robot.toml")
    assert found == robot
    assert found.sigma("youngs_modulus").of(found.youngs_modulus) == pytest.approx(0.07 * 1.2e6)
    assert found.sigma("tail_radius") == DEFAULTS["tail_radius"]


def test_a_new_file_shows_optional_entries_and_what_the_coefficients_are() -> None:
    lines = robot_toml(CONTROL).splitlines()
    for start in ("# disc_offset_mm = 16 ", "# [effects]"):
        assert any(line.startswith(start) for line in lines), start
    assert {line.split("=")[0].strip() for line in lines if " = " in line and not line.startswith("#")} == {
        "name", *(entry.key for entry in ENTRIES if not entry.optional)
    }  # fmt: skip
    assert "first\n# guess" in robot_toml(CONTROL)


SIZES = st.floats(1e-4, 1.0)
OTHERS = st.tuples(st.floats(1e3, 1e10), st.floats(1e-4, 1e3), st.floats(1e-3, 1e3))


@given(st.text(max_size=9), st.tuples(SIZES, SIZES, SIZES, st.none() | SIZES), OTHERS, st.floats(0.0, 0.4))
@settings(max_examples=80, deadline=None)
@example('a "quoted" name\\ in two\nlines', (0.1, 0.016, 0.06, None), (1.2e6, 1.5, 4.5), 0.0)
def test_what_is_written_is_read_back_to_the_last_bit(
    name: str, lengths: tuple[float, float, float, float | None], others: tuple[float, float, float], sigma: float
) -> None:
    length, radius, head, offset = lengths
    stiffness, viscosity, speed = others
    robot = replace(
        CONTROL, tail_length=length, tail_radius=length / 20, head_radius=radius, head_length=head,
        disc_offset=offset, youngs_modulus=stiffness, viscosity=viscosity, motor_speed=speed,
        sigmas={"head_length": Sigma(sigma * head, False)}, name=name,
    )  # fmt: skip
    tables = tomllib.loads(robot_toml(robot))
    assert Robot(name=tables.pop("name"), **read_robot(tables)) == robot


def test_numbers_of_the_presets() -> None:
    assert CONTROL.time_scale == pytest.approx(2.207, abs=1e-3)
    assert CONTROL.omega_bar == pytest.approx(10.0)
    values = CONTROL.group_values()
    assert [values[k] for k in ("l_over_R", "L_over_R", "l_over_r0")] == pytest.approx([6.875, 3.75, 34.375])


def test_a_robot_that_cannot_be_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="paper-control"):
        load_robot("no-such-robot")
    with pytest.raises(InputError, match="one N"):
        Groups.from_columns({k: np.array([v, v + (k == "N")]) for k, v in CONTROL.group_values().items()})
    with pytest.raises(InputError, match="above 0"):
        replace(CONTROL, viscosity=-1.0)
