"""The design: even, a prefix of any longer one, whatever the order in sweep.toml; what breaks is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dataset.__main__ import main
from dataset.rows.design import Axis, SweepDesign, load_design
from sim.io.errors import run_command
from tests.dataset.sweeps import SMALL, design


def loaded(folder: Path, text: str) -> SweepDesign:
    (folder / "sweep.toml").write_text(text)
    return load_design(folder / "sweep.toml")


def test_the_design_fills_its_ranges_evenly(tmp_path: Path) -> None:
    sweep = loaded(tmp_path, SMALL).with_rows(512)
    points = sweep.points()
    for name, axis in sweep.axes.items():
        assert points[name].min() >= axis.low
        assert points[name].max() <= axis.high
    assert np.bincount(points["N"].astype(int))[2:].tolist() == [256, 256]
    halves = np.log(points["omega_bar"]) < np.log(np.sqrt(6.0 * 12.0))
    assert halves.sum() == 256


def test_any_run_of_rows_is_the_same_bits_as_in_the_whole() -> None:
    whole = design(5000).points()
    for start, stop in ((0, 1), (0, 700), (1, 2), (511, 1025), (4999, 5000)):
        for name, values in design(5000).points(start, stop).items():
            assert values.tobytes() == whole[name][start:stop].tobytes(), (name, start)
    far = 3_000_000
    one, two = design(1).points(far, far + 8), design(1).points(far + 3, far + 5)
    assert all(two[name].tobytes() == one[name][3:5].tobytes() for name in one)


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
    text = SMALL.replace('scale = "log" }', 'scale = "log", both_directions = true }', 1).replace(
        "[2, 3]", "[1, 8]"
    )
    text += "a_over_R = { range = [0.5, 1.2] }\nleft_right_bias = { range = [-0.05, 0.05] }\n"
    sweep = loaded(tmp_path, text).with_rows(256)
    points = sweep.points()
    assert sweep.effects == ["left_right_bias"]
    assert (points["omega_bar"] < 0).sum() == 128
    assert sorted(set(points["N"])) == [1, 2, 3, 4, 5, 6, 7, 8]
    assert (
        SweepDesign.from_config(sweep.config(), 256).points()["a_over_R"].tolist() == points["a_over_R"].tolist()
    )


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("[2.0, 5.0]", "[5.0, 2.0]", "ordered"),
        ("[2.0, 5.0]", "[-2.0, 5.0]", "above 0"),
        ("[2.0, 5.0]", "[1e-9, 5.0]", "0.001 to 1000"),
        ("[20.0, 45.0]", "[5.0, 45.0]", "l/r0"),
        ("[20.0, 45.0]", "[4.0, 45.0]", "l_over_r0"),
        ("[6.0, 12.0]", "[1e-6, 12.0]", "omega_bar"),
        ("N = {", "dwell_bar = { range = [1.0, 2.0] }\nN = {", "rows hold all dwells"),
        ("rows = 6", "rows = 6\nhistory_every = -1", "history_every"),
        ("[2, 3]", "[0, 3]", "N"),
        ("[2, 3]", "[2, 65]", "N"),
        ("[2, 3]", "[2, 3.5]", "whole numbers"),
        ('"log"', '"cubic"', "scale"),
        ("C_t = { range = [2.0, 5.0] }", "C_t = { range = [2.0, 5.0], sclae = 'log' }", "sclae"),
        ("C_t = { range = [2.0, 5.0] }", "C_t = { range = [2.0, 5.0], both_directions = true }", "only the motor"),
        ("C_t =", "C_x =", "unknown input"),
        ("C_t = { range = [2.0, 5.0] }", "", "missing input"),
        (
            "C_t = { range = [2.0, 5.0] }",
            "C_t = { range = [2.0, 5.0] }\ntail_interaction = { range = [0, 99] }",
            "99",
        ),
        ("rows = 6", "rows = 0", "rows = 0"),
        ("rows = 6", "rows = true", "rows = True"),
        ("rows = 6", "rows = ", "not TOML"),
        ("rows = 6", "row = 6", "'row'"),
        ("seed = 3", "seed = 1.5", "seed"),
        (SMALL, "inputs = 3", "inputs"),
    ],
)
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
