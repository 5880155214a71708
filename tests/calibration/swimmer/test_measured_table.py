"""Measured tables: what they need, what is left out, and copies of rows, which are no repeats."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calibration.linear.gls import repeat_count, repeat_covariance
from calibration.swimmer.measured_table import read_measurements
from calibration.table.excluded import find_copies
from common.errors import InputError
from tests.calibration.toy_tables import calibrated, none, toy_table
from tests.processes import LIMIT


def test_a_track_is_no_measured_table() -> None:
    track = pd.DataFrame({"time_s": [0.0, 1.0], "x_cm": [0.0, 1.0], "heading_deg": [0.0, 5.0], "heading_rad": 0.0})
    with pytest.raises(InputError, match=r"the table has no column 'N'; it needs N, l_cm, omega_rpm"):
        read_measurements(track)


@pytest.mark.parametrize("blank", [np.nan, "", " "], ids=["missing", "empty", "blank"])
def test_an_optional_column_without_any_value_is_left_out(blank: object) -> None:
    table = toy_table(3).drop(columns=["R_yr_cm", "session"])
    plain = read_measurements(table)
    for column in ("v_cm_s", "R_yr_mm", "elapsed_min", "session", "camera_scale_sigma_percent"):
        runs = read_measurements(table.assign(**{column: blank}))
        name = "R_yr_cm" if column == "R_yr_mm" else column
        assert tuple(map(str, runs.excluded)) == (f"column {name}: without any value, left out",)
        assert (runs.outputs, runs.session_names) == (plain.outputs, plain.session_names)
        assert np.array_equal(runs.y, plain.y)


def test_a_note_with_one_gap_keeps_its_other_values() -> None:
    table = toy_table(3)
    table = table.assign(
        temperature_C=np.linspace(18, 22, len(table)), elapsed_min=[np.nan] * 30 + [1.0] * (len(table) - 30)
    )
    table["temperature_C"] = table["temperature_C"].astype(object)
    table.loc[4, "temperature_C"] = "cold"
    runs = read_measurements(table)
    assert runs.noted_names == ("temperature_K",)
    assert tuple(map(str, runs.excluded)) == (
        "row 5: temperature_C = cold is not a finite number",
        "column elapsed_min: without a value in more than 10 % of the rows, left out",
    )


def test_an_excluded_row_is_named_with_its_line(tmp_path: Path) -> None:
    table = toy_table(3)
    lines = table[["l_cm", *table.columns.drop("l_cm")]].to_csv(index=False, sep=";", decimal=",").split("\n")
    lines[5] = "#WERT!" + lines[5][lines[5].index(";") :]
    (tmp_path / "runs.csv").write_text("\n".join(["% tank 3", *lines[:3], "", *lines[3:]]))
    runs = read_measurements(tmp_path / "runs.csv")
    assert tuple(map(str, runs.excluded)) == ("row 5 (line 8): l_cm has no value",)


@pytest.mark.slow
def test_a_missing_table_is_refused_before_anything_slow_is_loaded() -> None:
    code = """
import sys
from calibration.__main__ import program
from softflagella.__main__ import main
from common.errors import run_command
assert run_command(main, ["calibrate", "none.csv", "--robot", "r.toml", "--out", "o"]) == 2
assert run_command(program.main, ["tracks", "none.csv", "runs.csv", "--out", "o"]) == 2
assert not {"numba", "scipy", "matplotlib"} & set(sys.modules)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT)
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr.count("none.csv: no such file") == 2


def rows(*, digits: int, outputs: int, seed: int = 0, noise: float = 0.025) -> tuple[np.ndarray, np.ndarray]:
    """48 conditions, two runs each: inputs, and outputs about 2 to 9 with so many digits behind the point."""
    rng = np.random.default_rng(seed)
    mean = np.repeat(rng.uniform(2, 9, (48, outputs)), 2, 0)
    outputs_of_runs = (mean * np.exp(noise * rng.normal(size=mean.shape))).round(digits)
    return np.repeat(np.arange(48.0), 2)[:, None], outputs_of_runs


def test_a_copied_block_is_found_and_nothing_else() -> None:
    inputs, outputs = rows(digits=3, outputs=4)
    assert find_copies(inputs, outputs) == {}
    block = np.r_[0:96, 10:30]
    assert find_copies(inputs[block], outputs[block]) == {96 + i: 10 + i for i in range(20)}
    one = np.r_[0:96, 5]
    assert find_copies(inputs[one], outputs[one]) == {96: 5}
    outputs[4] = outputs[50]  # of other inputs
    assert find_copies(inputs, outputs) == {}


def test_repeats_in_coarse_numbers_are_kept() -> None:
    """With two outputs in steps of 0.1, one in about thirty pairs of repeats agrees by chance."""
    agree = 0
    for seed in range(20):
        inputs, outputs = rows(digits=1, outputs=2, seed=seed)
        agree += int((outputs[::2] == outputs[1::2]).all(1).sum())
        assert find_copies(inputs, outputs) == {}
    assert agree > 20


def test_copied_rows_are_no_repeats() -> None:
    """The noise is taken from repeats: with 40 copies among 136 rows p was 0.003, and without them 0.24."""
    table = toy_table(3)
    copied = pd.concat([table, table[:40].assign(session="N=9", run=0)], ignore_index=True)
    runs = read_measurements(copied)
    assert len(runs) == len(table)
    assert runs.y == pytest.approx(read_measurements(table).y, rel=1e-14)
    assert str(runs.excluded[0]) == "row 97: a copy of an earlier row, equal in all inputs and outputs (row 1)"
    assert len(runs.excluded) == 40
    result, without = calibrated(copied, few=True), none()
    assert result.attribution.misfit.p_value == without.attribution.misfit.p_value
    assert result.summary_of_excluded[0].startswith("40 of 136 rows (rows 97, 98, 99 and 37 more): a copy")
    assert result.rows == 136
    single = table[table["trial"] == 1].assign(session=range(48))
    with pytest.raises(InputError, match="0 repeated runs, without 48 copies of rows"):
        read_measurements(pd.concat([single, single]))


def test_without_repeats_mirror_runs_give_the_noise() -> None:
    """Noise 2.5 %, in a smooth odd effect; one direction alone needs many runs."""
    table = toy_table(3, left_right_bias=0.2)
    runs, single = (read_measurements(table[table["trial"] <= trial]) for trial in (2, 1))
    noise = [np.sqrt(np.trace(repeat_covariance(r.y, r.repeats())) / 5) for r in (runs, single)]
    assert repeat_count(single.repeats()) == 48 - 24 - 4
    assert noise[1] == pytest.approx(noise[0], rel=0.3)
    assert "0 repeated runs: the noise is estimated from what differs between mirror runs" in single.caveats[-1]
    result = calibrated(table[table["trial"] == 1], few=True)
    assert (result.verdict, result.effects) == ("effect", ("left_right_bias",))


@pytest.mark.parametrize(
    ("given", "meant", "factor"),
    [
        ("R_yr_mm", "R_yr_cm", 10.0),
        ("omega_yr_deg_s", "omega_yr_rad_s", 180 / math.pi),
        ("l_m", "l_cm", 0.01),
        ("omega_Hz", "omega_rpm", 1 / 60),
        ("theta [rad]", "theta_deg", math.pi / 180),
        ("rpm", "omega_rpm", 1.0),
        ("Tail_length_cm", "l_cm", 1.0),
    ],
)
def test_a_column_in_another_unit_is_converted(given: str, meant: str, factor: float) -> None:
    expected = toy_table(4)
    other = expected.rename(columns={meant: given}).assign(**{given: factor * expected[meant]})
    runs, same = read_measurements(other), read_measurements(expected)
    assert runs.y == pytest.approx(same.y, rel=1e-12)
    assert runs.inputs == pytest.approx(same.inputs, rel=1e-12)
    assert [note.split(" read as")[0].split(" converted")[0] for note in runs.converted] == [f"column {given}"]
    with pytest.raises(InputError, match="are the same quantity; drop all but one"):
        read_measurements(other.assign(**{meant: 1.0}))


def test_the_course_was_called_heading() -> None:
    """The heading is the direction of the axis in tracks, and was that of the path in runs."""
    table = toy_table(4)
    table = table.assign(heading_deg=np.linspace(0, 350, len(table)))
    runs = read_measurements(table)
    assert runs.noted_names == ("course_x", "course_y")
    assert runs.converted == ("column heading_deg read as course_deg",)
