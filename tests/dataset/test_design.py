"""Designs: even, a prefix of any longer one, by groups or around a robot; what breaks is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from common.errors import InputError, run_command
from dataset.__main__ import main
from dataset.build import build
from dataset.data_set import read
from dataset.design import Axis, SweepDesign, design_around, load_design
from dataset.robot_inputs import sweep_toml
from dataset.verify import verify
from sim.inputs import save_robot
from sim.model.presets import PRESETS
from tests.dataset.sweeps import SMALL, design


def loaded(folder: Path, text: str) -> SweepDesign:
    (folder / "sweep.toml").write_text(text)
    return load_design(folder / "sweep.toml")


ROBOT = PRESETS["paper-control"]
AROUND = """
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


def around(folder: Path, text: str = AROUND) -> SweepDesign:
    save_robot(replace(ROBOT, disc_offset=0.012), folder / "robot.toml")
    return loaded(folder, text)


def test_the_design_fills_its_ranges_evenly(tmp_path: Path) -> None:
    sweep = loaded(tmp_path, SMALL).with_rows(512)
    points = sweep.points()
    for name, axis in sweep.axes.items():
        assert points[name].min() >= axis.low
        assert points[name].max() <= axis.high
    assert np.bincount(points["N"].astype(int))[2:].tolist() == [256, 256]
    halves = np.log(points["omega_bar"]) < np.log(np.sqrt(6.0 * 12.0))
    assert halves.sum() == 256


def test_any_run_of_rows_is_the_same_bits_as_in_the_whole(tmp_path: Path) -> None:
    whole = design(5000).points()
    for start, stop in ((0, 1), (0, 700), (1, 2), (511, 1025), (4999, 5000)):
        for name, values in design(5000).points(start, stop).items():
            assert values.tobytes() == whole[name][start:stop].tobytes(), (name, start)
    far = 3_000_000
    one, two = design(1).points(far, far + 8), design(1).points(far + 3, far + 5)
    assert all(two[name].tobytes() == one[name][3:5].tobytes() for name in one)
    sweep = around(tmp_path).with_rows(300)
    points, again = sweep.points(), SweepDesign.from_config(sweep.config(), 300)
    assert all(
        values.tobytes() == points[name][37:211].tobytes() for name, values in sweep.points(37, 211).items()
    )
    assert all(values.tobytes() == points[name].tobytes() for name, values in again.points().items())


def test_the_order_of_lines_does_not_matter(tmp_path: Path) -> None:
    head, lines = SMALL.split("[inputs]\n")
    turned = "[inputs]\n".join([head, "\n".join(reversed(lines.strip().splitlines()))])
    one, other = loaded(tmp_path, SMALL), loaded(tmp_path, turned)
    assert one.config() == other.config()
    assert all(np.array_equal(values, other.points()[name]) for name, values in one.points().items())


def test_both_directions_are_mirror_images_in_number_and_range() -> None:
    axis = Axis(1.0, 100.0, "log", both_directions=True)
    values = axis.at((np.arange(1000) + 0.5) / 1000)
    assert (values > 0).sum() == (values < 0).sum() == 500
    assert np.sort(-values[values < 0]) == pytest.approx(np.sort(values[values > 0]))
    assert np.abs(values).min() == pytest.approx(1.0, rel=0.01)
    assert np.abs(values).max() == pytest.approx(100.0, rel=0.01)


def test_optional_inputs_effects_and_directions_are_swept(tmp_path: Path) -> None:
    text = SMALL.replace('scale = "log" }', 'scale = "log", both_directions = true }').replace("[2, 3]", "[1, 8]")
    text += "a_over_R = { range = [0.5, 1.2] }\nleft_right_bias = { range = [-0.05, 0.05] }\n"
    sweep = loaded(tmp_path, text).with_rows(256)
    points = sweep.points()
    assert sweep.effects == ["left_right_bias"]
    assert (points["omega_bar"] < 0).sum() == 128
    assert sorted(set(points["N"])) == [1, 2, 3, 4, 5, 6, 7, 8]
    again = SweepDesign.from_config(sweep.config(), 256).points()
    assert again["a_over_R"].tolist() == points["a_over_R"].tolist()


BAD = [
    ("[2.0, 5.0]", "[5.0, 2.0]", "ordered"), ("[2.0, 5.0]", "[-2.0, 5.0]", "above 0"),
    ("[2.0, 5.0]", "[1e-9, 5.0]", "0.001 to 1000"), ("[20.0, 45.0]", "[5.0, 45.0]", "l/r0"),
    ("[20.0, 45.0]", "[4.0, 45.0]", "l_over_r0"), ("[6.0, 12.0]", "[1e-6, 12.0]", "omega_bar"),
    ("N = {", "dwell_bar = { range = [1.0, 2.0] }\nN = {", "rows hold all dwells"), ("[2, 3]", "[0, 3]", "N"),
    ("[2, 3]", "[2, 65]", "N"), ("[2, 3]", "[2, 3.5]", "whole numbers"), ('"log"', '"cubic"', "scale"),
    ("5.0] }", "5.0], sclae = 'log' }", "sclae"), ("5.0] }", "5.0], both_directions = true }", "only the motor"),
    ("C_t =", "C_x =", "unknown input"), ("C_t = { range = [2.0, 5.0] }", "", "missing input"),
    ("5.0] }", "5.0] }\ntail_interaction = { range = [0, 99] }", "99"), ("rows = 6", "rows = 0", "rows = 0"),
    ("rows = 6", "rows = 6\nhistory_every = -1", "history_every"), ("rows = 6", "rows = true", "rows = True"),
    ("rows = 6", "rows = ", "not TOML"), ("rows = 6", "row = 6", "'row'"), ("seed = 3", "seed = 1.5", "seed"),
    (SMALL, "inputs = 3", "inputs"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "expected"), BAD, ids=[words for *_, words in BAD])
def test_bad_configurations(
    old: str, new: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert old in SMALL
    (tmp_path / "s.toml").write_text(SMALL.replace(old, new, 1))
    words = ["build", "--config", str(tmp_path / "s.toml"), "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_row_is_the_robot_with_the_numbers_of_its_axes(tmp_path: Path) -> None:
    design = around(tmp_path).with_rows(64)
    points = design.points()
    assert list(points) == design.columns
    length = points["l_over_R"] * ROBOT.head_radius
    assert 0.07 <= length.min() < 0.08
    assert 0.12 < length.max() <= 0.13
    for row in range(0, 64, 7):
        rpm = 60 / (2 * np.pi) * abs(points["omega_bar"][row])
        rpm /= replace(ROBOT, tail_length=float(length[row])).time_scale
        assert 30 * (1 - 1e-9) <= rpm <= 160 * (1 + 1e-9)
        robot = replace(
            ROBOT, disc_offset=0.012, tails=int(points["N"][row]), tail_length=float(length[row]),
            motor_speed=float(rpm * np.pi / 30),
            effects={"end_over_end_drag": float(points["end_over_end_drag"][row])},
        )  # fmt: skip
        expected = robot.group_values()
        assert {name: abs(points[name][row]) for name in points} == pytest.approx(expected, rel=1e-12)
    assert (points["omega_bar"] > 0).sum() == 32
    assert set(points["N"]) == {2.0, 3.0, 4.0}


def test_a_sweep_around_a_robot_is_built_read_and_verified(tmp_path: Path) -> None:
    design = around(tmp_path)
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
    with pytest.raises(InputError, match=r"youngs_modulus .* there, 2000000.0 here"):
        build(stiffer, tmp_path / "data", jobs=1)


LAW = "law_Fx_wh_speed-93_length425_tails0"


def test_a_law_is_swept_as_an_effect_is(tmp_path: Path) -> None:
    design = around(tmp_path, f"{AROUND}{LAW} = {{ range = [-0.5, 0.5] }}")
    assert design.effects == ["end_over_end_drag", LAW]
    build(design, tmp_path / "data", jobs=1)
    sizes = read(tmp_path / "data")[LAW]
    assert np.array_equal(sizes, design.points()[LAW])
    assert sizes.min() < 0 < sizes.max()
    assert loaded(tmp_path, f"{SMALL}{LAW} = {{ range = [-0.5, 0.5] }}").effects == [LAW]


def test_a_law_of_the_robot_that_is_not_swept_is_a_column(tmp_path: Path) -> None:
    save_robot(replace(ROBOT, effects={LAW: 0.2}), tmp_path / "robot.toml")
    design = loaded(tmp_path, AROUND)
    assert design.effects == ["end_over_end_drag", LAW]
    assert set(design.points()[LAW]) == {0.2}


BAD_AROUND = [
    ("tail_length_cm =", "tail_length =", "input 'tail_length' has no unit; give one of tail_l"),
    ("tail_length_cm =", "tail_length_rpm =", "unknown input 'tail_length_rpm' of a robot; allowed are N"),
    ("tail_length_cm =", "l_over_R =", "unknown input 'l_over_R' of a robot"),
    ("N = {", "tail_length_mm = {", "tail_length_cm and tail_length_mm are the same input; drop one"),
    ("[7, 13]", "[7, 1300]", "l_over_R from 4.38 to 812; a sweep takes 0.1 to 100"),
    ("[7, 13]", "[0.7, 13]", "the ends of the ranges make an impossible robot: l/r0"),
    ("[7, 13]", "[13, 7]", "tail_length_cm has range"),
    ("[7, 13] }", "'wide' }", "tail_length_cm = "),
    ('"robot.toml"', '"no.toml"', "no robot"),
    ('"robot.toml"', "3", "robot = 3; give the name"),
    (AROUND[AROUND.index("tail_length_cm") :], "", "no inputs; give at least one"),
]


@pytest.mark.parametrize(("old", "new", "words"), BAD_AROUND, ids=[words for *_, words in BAD_AROUND])
def test_what_is_no_sweep_around_a_robot_is_refused(old: str, new: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words) as refusal:
        around(tmp_path, AROUND.replace(old, new))
    assert "\n" not in str(refusal.value)


def test_the_command_writes_a_sweep_around_a_robot(tmp_path: Path) -> None:
    save_robot(ROBOT, tmp_path / "robot.toml")
    (tmp_path / "sweeps").mkdir()
    out = tmp_path / "sweeps" / "sweep.toml"
    assert run_command(main, ["config", "--robot", str(tmp_path / "robot.toml"), "--out", str(out)]) == 0
    design = load_design(out)
    assert design.axes["tail_length"].low == pytest.approx(ROBOT.tail_length * 2 / 3, rel=0.01)
    assert design.axes["motor_speed"].high == pytest.approx(ROBOT.motor_speed * 4 / 3, rel=0.01)
    assert design.robot is not None
    assert design.robot["youngs_modulus"] == ROBOT.youngs_modulus
    every = sweep_toml(ROBOT, "paper-control").replace("# tail_radius", "tail_radius").replace("# head", "head")
    for name in ("disc_offset", "youngs", "viscosity"):
        every = every.replace(f"# {name}", name)
    out.write_text(every)
    assert len(load_design(out).axes) == 12


def test_a_design_around_a_robot_needs_no_file(tmp_path: Path) -> None:
    given = {"tail_length_mm": (70.0, 130.0), "motor_speed_rpm": (30.0, 160.0), "N": (2.0, 4.0)}
    design = design_around(ROBOT, given, rows=32)
    points = design.points()
    assert set(points["N"]) == {2.0, 3.0, 4.0}
    length = points["l_over_R"] * ROBOT.head_radius
    assert 0.07 <= length.min() <= length.max() <= 0.13
    assert points["C_t"].tolist() == [ROBOT.C_t] * 32
    (tmp_path / "sweep.toml").write_text(sweep_toml(ROBOT, "paper-control"))
    default, written = design_around(ROBOT), load_design(tmp_path / "sweep.toml")
    assert default.config() == written.config()
    with pytest.raises(InputError, match=r"sweep around robot 'paper-control'.*motor_speed"):
        design_around(ROBOT, {"motor_speed_rpm": (160.0, 30.0)})
    with pytest.raises(InputError, match="'motor_speed' has no unit"):
        design_around(ROBOT, {"motor_speed": (30.0, 160.0)})
