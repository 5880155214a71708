"""Sweeps around a robot, in the units of a laboratory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset.__main__ import main
from dataset.build.build import build
from dataset.build.verify import verify
from dataset.rows.design import SweepDesign, design_around, load_design
from dataset.rows.robot_inputs import sweep_toml
from dataset.storage.data_set import read
from sim.inputs import save_robot
from sim.io.errors import InputError, run_command
from sim.model.presets import PRESETS

CONTROL = PRESETS["paper-control"]
TEXT = """
robot = "robot.toml"
rows = 8
seed = 3
history_every = 0
[inputs]
tail_length_cm = { range = [7, 13] }
motor_speed_rpm = { range = [30, 160], scale = "log", both_directions = true }
N = { range = [2, 4] }
end_over_end_drag = { range = [0, 5] }
"""


def loaded(folder: Path, text: str = TEXT) -> SweepDesign:
    save_robot(replace(CONTROL, disc_offset=0.012), folder / "robot.toml")
    (folder / "sweep.toml").write_text(text)
    return load_design(folder / "sweep.toml")


def test_a_row_is_the_robot_with_the_numbers_of_its_axes(tmp_path: Path) -> None:
    design = loaded(tmp_path).with_rows(64)
    points = design.points()
    assert list(points) == design.columns
    length = points["l_over_R"] * CONTROL.head_radius
    assert 0.07 <= length.min() < 0.08
    assert 0.12 < length.max() <= 0.13
    for row in range(0, 64, 7):
        rpm = 60 / (2 * np.pi) * abs(points["omega_bar"][row])
        rpm /= replace(CONTROL, tail_length=float(length[row])).time_scale
        assert 30 * (1 - 1e-9) <= rpm <= 160 * (1 + 1e-9)
        robot = replace(
            CONTROL,
            disc_offset=0.012,
            tails=int(points["N"][row]),
            tail_length=float(length[row]),
            motor_speed=float(rpm * np.pi / 30),
            effects={"end_over_end_drag": float(points["end_over_end_drag"][row])},
        )
        expected = robot.group_values()
        assert {name: abs(points[name][row]) for name in points} == pytest.approx(expected, rel=1e-12)
    assert (points["omega_bar"] > 0).sum() == 32
    assert set(points["N"]) == {2.0, 3.0, 4.0}


def test_any_run_of_rows_is_the_same_bits_as_in_the_whole(tmp_path: Path) -> None:
    design = loaded(tmp_path).with_rows(300)
    whole, part = design.points(), design.points(37, 211)
    assert all(part[name].tobytes() == whole[name][37:211].tobytes() for name in whole)
    again = SweepDesign.from_config(design.config(), 300)
    assert all(values.tobytes() == whole[name].tobytes() for name, values in again.points().items())


def test_a_sweep_around_a_robot_is_built_read_and_verified(tmp_path: Path) -> None:
    design = loaded(tmp_path)
    build(design, tmp_path / "data", jobs=1)
    rows = read(tmp_path / "data")
    points = design.points()
    assert all(np.array_equal(rows[name], values) for name, values in points.items())
    assert rows["end_over_end_drag"].max() <= 5
    verify(tmp_path / "data", rows=1)
    for name, spec in design.ranges().items():
        low, high = spec["range"]
        assert (rows[name].abs() >= low * (1 - 1e-12)).all(), name
        assert (rows[name].abs() <= high * (1 + 1e-12)).all(), name
    stiffer = SweepDesign(**{**vars(design), "robot": {**(design.robot or {}), "youngs_modulus": 2e6}})
    with pytest.raises(InputError, match="holds rows of another robot"):
        build(stiffer, tmp_path / "data", jobs=1)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "tail_length_cm =",
            "tail_length =",
            "input 'tail_length' has no unit; give one of tail_l",
        ),
        (
            "tail_length_cm =",
            "tail_length_rpm =",
            "unknown input 'tail_length_rpm' of a robot; allowed are N",
        ),
        ("tail_length_cm =", "l_over_R =", "unknown input 'l_over_R' of a robot"),
        ("N = {", "tail_length_mm = {", "tail_length_cm and tail_length_mm are the same input; drop one"),
        ("[7, 13]", "[7, 1300]", "the ranges give l_over_R from 4.38 to 812; a sweep takes 0.1 to 100"),
        ("[7, 13]", "[0.7, 13]", "the ends of the ranges make an impossible robot: l/r0"),
        ("[7, 13]", "[13, 7]", "tail_length_cm has range"),
        ("[7, 13] }", "'wide' }", "tail_length_cm = "),
        ('"robot.toml"', '"no.toml"', "no robot"),
        ('"robot.toml"', "3", "robot = 3; give the name"),
    ],
)
def test_what_is_no_sweep_around_a_robot_is_refused(old: str, new: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words) as refusal:
        loaded(tmp_path, TEXT.replace(old, new))
    assert "\n" not in str(refusal.value)


def test_without_inputs_there_is_no_sweep(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no inputs; give at least one"):
        loaded(tmp_path, TEXT.split("tail_length_cm")[0])


def test_the_command_writes_a_sweep_around_a_robot(tmp_path: Path) -> None:
    save_robot(CONTROL, tmp_path / "robot.toml")
    (tmp_path / "sweeps").mkdir()
    out = tmp_path / "sweeps" / "sweep.toml"
    assert run_command(main, ["config", "--robot", str(tmp_path / "robot.toml"), "--out", str(out)]) == 0
    design = load_design(out)
    assert design.axes["tail_length"].low == pytest.approx(CONTROL.tail_length * 2 / 3, rel=0.01)
    assert design.axes["motor_speed"].high == pytest.approx(CONTROL.motor_speed * 4 / 3, rel=0.01)
    assert design.robot is not None
    assert design.robot["youngs_modulus"] == CONTROL.youngs_modulus
    every = sweep_toml(CONTROL, "paper-control").replace("# tail_radius", "tail_radius").replace("# head", "head")
    for name in ("disc_offset", "youngs", "viscosity"):
        every = every.replace(f"# {name}", name)
    out.write_text(every)
    assert len(load_design(out).axes) == 12


def test_a_design_around_a_robot_needs_no_file(tmp_path: Path) -> None:
    given = {"tail_length_mm": (70.0, 130.0), "motor_speed_rpm": (30.0, 160.0), "N": (2.0, 4.0)}
    design = design_around(CONTROL, given, rows=32)
    points = design.points()
    assert set(points["N"]) == {2.0, 3.0, 4.0}
    length = points["l_over_R"] * CONTROL.head_radius
    assert 0.07 <= length.min() <= length.max() <= 0.13
    assert points["C_t"].tolist() == [CONTROL.C_t] * 32
    (tmp_path / "sweep.toml").write_text(sweep_toml(CONTROL, "paper-control"))
    default, written = design_around(CONTROL), load_design(tmp_path / "sweep.toml")
    assert default.config() == written.config()
    with pytest.raises(InputError, match=r"sweep around robot 'paper-control'.*motor_speed"):
        design_around(CONTROL, {"motor_speed_rpm": (160.0, 30.0)})
    with pytest.raises(InputError, match="'motor_speed' has no unit"):
        design_around(CONTROL, {"motor_speed": (30.0, 160.0)})
