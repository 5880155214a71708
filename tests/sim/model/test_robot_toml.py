"""Robots as files: any unit is read, and what is written is read back to the last bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.inputs import load_robot
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.robot_toml import ENTRIES, read_robot, robot_toml
from sim.model.uncertainty import Sigma

CONTROL = PRESETS["paper-control"]
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


def test_a_file_in_si_units_is_read_as_before(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "reference" / "robot.toml").read_text()
    assert "length_m = 0.11" in text
    assert read(text, tmp_path) == PRESETS["paper-measured"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "length_cm = 9",
            "length = 9",
            r"\[tails\] length has no unit; give one of length_m, length_cm, length_mm",
        ),
        ("length_cm = 9", "length_rpm = 9", r"unknown entry \[tails\] length_rpm"),
        (
            "length_cm = 9",
            "length_cm = 9\nlength_mm = 90",
            "length_cm and length_mm are the same number; drop one",
        ),
        ("length_cm = 9", "length_cm = '9'", r"\[tails\] length_cm = '9'; give a number"),
        ("length_cm = 9", "", r"missing entry \[tails\] length_cm"),
        ("C_t = 3.0", "C_t = 3.0\nC_t_sigma = 0.1", r"unknown entry \[drag\] C_t_sigma"),
        ("length_cm = 9", "length_cm = 9\nlength_cm_sigma = 7", "length_cm_sigma = 7; a standard deviation"),
    ],
)
def test_what_is_no_robot_is_refused(old: str, new: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        read(LAB.replace(old, new), tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[head]\nradius_mm = 16", "[head]\ndiameter_mm = 32", "[head] diameter_mm; give radius_mm, half of it"),
        ("radius_mm = 3.2", "diameter_in = 0.25", "[tails] diameter_in; give radius_in, half of it"),
        ("length_cm = 9", "lenght_cm = 9", "[tails] lenght_cm; is it length_cm?"),
        ("speed_rpm = 90", "sped_Hz = 1.5", "[motor] sped_Hz; is it speed_Hz?"),
        ("speed_rpm = 90", "speed_V = 6", "[motor] speed_V; is it speed_rpm?"),
        ("C_t = 3.0", "C_t = 3.0\nlength_mm = 16", "[drag] length_mm; is it [tails] length_mm?"),
        ("C_t = 3.0", "C_t = 3.0\nC_t_sigma = 0.1", "[drag] C_t_sigma; this number takes no standard deviation"),
        ("[motor]", "[moter]", "[moter] speed_rpm; is it [motor]?"),
        ("[motor]", "colour = 1\n[motor]", "[fluid] colour; [fluid] has viscosity_Pa_s, in any usual unit"),
    ],
)
def test_an_unknown_key_is_told_which_one_is_near(old: str, new: str, words: str, tmp_path: Path) -> None:
    """The answer to a diameter used to be a list of all keys of all tables."""
    with pytest.raises(InputError) as caught:
        read(LAB.replace(old, new), tmp_path)
    assert str(caught.value).endswith(f": unknown entry {words}")
    assert len(str(caught.value).removeprefix(str(tmp_path))) < 100


def test_a_key_above_all_tables_is_told_so(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"length_cm is in no table; a robot has \[tails\], \[head\], \[fluid\]"):
        read("length_cm = 9\n" + LAB, tmp_path)


def test_a_standard_deviation_may_have_a_unit_of_its_own(tmp_path: Path) -> None:
    robot = read(LAB.replace("length_cm = 9", "length_cm = 9\nlength_mm_sigma = 2"), tmp_path)
    assert robot.sigmas == {"tail_length": Sigma(0.002, False)}
    assert read(robot_toml(robot), tmp_path) == robot


def test_a_new_file_shows_units_optional_entries_and_what_the_coefficients_are() -> None:
    lines = robot_toml(CONTROL).splitlines()
    for start in (
        "length_cm = 11",
        "radius_mm = 3.2 ",
        "# disc_offset_mm = 16 ",
        "speed_rpm = 43.2",
        "# [effects]",
    ):
        assert any(line.startswith(start) for line in lines), start
    assert {line.split("=")[0].strip() for line in lines if " = " in line and not line.startswith("#")} == {
        "name", *(entry.key for entry in ENTRIES if not entry.optional)
    }  # fmt: skip
    assert "first\n# guess" in robot_toml(CONTROL)


SIZES = st.floats(1e-4, 1.0)


@given(
    lengths=st.tuples(SIZES, SIZES, SIZES, st.none() | SIZES),
    others=st.tuples(st.floats(1e3, 1e10), st.floats(1e-4, 1e3), st.floats(1e-3, 1e3)),
    sigma=st.floats(0.0, 0.4),
    relative=st.booleans(),
)
@settings(max_examples=100, deadline=None)
def test_what_is_written_is_read_back_to_the_last_bit(
    lengths: tuple[float, float, float, float | None],
    others: tuple[float, float, float],
    sigma: float,
    relative: bool,
) -> None:
    import tomllib

    length, radius, head, offset = lengths
    stiffness, viscosity, speed = others
    robot = replace(
        CONTROL,
        tail_length=length,
        tail_radius=length / 20,
        head_radius=radius,
        head_length=head,
        disc_offset=offset,
        youngs_modulus=stiffness,
        viscosity=viscosity,
        motor_speed=speed,
        sigmas={} if relative else {"head_length": Sigma(sigma * head, False)},
    )
    tables = tomllib.loads(robot_toml(robot))
    name = tables.pop("name")
    assert Robot(name=name, **read_robot(tables, "robot.toml")) == robot


def test_a_comment_stands_apart_from_a_number_of_any_length() -> None:
    robot = replace(PRESETS["paper-control"], disc_offset=0.015065219030606398)
    lines = [line for line in robot_toml(robot).splitlines() if "disc_offset" in line]
    assert all(" # " in line.removeprefix("# ") for line in lines)
    assert lines
