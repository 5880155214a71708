"""What is no measured table is told what such a table needs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calibration.swimmer.measured_table import read_measurements
from sim.io.errors import InputError
from tests.calibration.toy_tables import toy_table
from tests.processes import LIMIT


def test_a_track_is_no_measured_table() -> None:
    """Its answer used to be that heading_deg and heading_rad are the same quantity."""
    track = pd.DataFrame({"time_s": [0.0, 1.0], "x_cm": [0.0, 1.0], "heading_deg": [0.0, 5.0], "heading_rad": 0.0})
    with pytest.raises(InputError, match=r"the table has no column 'N'; it needs N, l_cm, omega_rpm"):
        read_measurements(track)


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize("blank", [np.nan, "", " "], ids=["missing", "empty", "blank"])
@pytest.mark.parametrize("column", ["v_cm_s", "R_yr_mm", "elapsed_min", "session", "camera_scale_sigma_percent"])
def test_an_optional_column_without_any_value_is_left_out(column: str, blank: object) -> None:
    """An empty v_cm_s left 0 usable runs; an empty session was one session with the name nan."""
    table = toy_table(3).drop(columns=["R_yr_cm", "session"])
    runs, plain = read_measurements(table.assign(**{column: blank})), read_measurements(table)
    name = "R_yr_cm" if column == "R_yr_mm" else column
    assert runs.excluded == (f"column {name}: without any value, left out",)
    assert runs.outputs == plain.outputs
    assert runs.session_names == plain.session_names
    assert np.array_equal(runs.y, plain.y)


@pytest.mark.usefixtures("toy_model")
def test_inputs_and_the_last_outputs_must_have_values() -> None:
    with pytest.raises(InputError, match="0 usable runs"):
        read_measurements(toy_table(3).assign(l_cm=np.nan))
    outputs = {name: np.nan for name in ("omega_yr_rad_s", "R_yr_cm", "theta_deg")}
    with pytest.raises(InputError, match="without any value: omega_yr_rad_s, R_yr_cm, theta_deg"):
        read_measurements(toy_table(3).assign(**outputs))


@pytest.mark.usefixtures("toy_model")
def test_a_note_with_one_gap_keeps_its_other_values() -> None:
    """The whole column used to be left out, without a word."""
    table = toy_table(3)
    table = table.assign(
        temperature_C=np.linspace(18, 22, len(table)), elapsed_min=[np.nan] * 30 + [1.0] * (len(table) - 30)
    )
    table["temperature_C"] = table["temperature_C"].astype(object)
    table.loc[4, "temperature_C"] = "cold"
    runs = read_measurements(table)
    assert runs.noted_names == ("temperature_K",)
    assert runs.excluded == (
        "row 5: temperature_C = cold is not a finite number",
        "column elapsed_min: without a value in more than 10 % of the rows, left out",
    )


@pytest.mark.usefixtures("toy_model")
def test_an_excluded_row_is_named_with_its_line(tmp_path: Path) -> None:
    table = toy_table(3)
    lines = table[["l_cm", *table.columns.drop("l_cm")]].to_csv(index=False, sep=";", decimal=",").split("\n")
    lines[5] = "#WERT!" + lines[5][lines[5].index(";") :]
    (tmp_path / "runs.csv").write_text("\n".join(["% tank 3", *lines[:3], "", *lines[3:]]))
    runs = read_measurements(tmp_path / "runs.csv")
    assert runs.excluded == ("row 5 (line 8): l_cm = nan is not a finite number",)


@pytest.mark.parametrize(
    "words",
    [
        ["calibrate", "none.csv", "--robot", "r.toml", "--out", "o"],
        ["tracks", "none.csv", "runs.csv", "--out", "o"],
    ],
)
def test_a_missing_table_is_refused_before_anything_slow_is_loaded(words: list[str]) -> None:
    code = (
        "import sys; from calibration.__main__ import program; from sim.io.errors import run_command;"
        f"assert run_command(program.main, {words!r}) == 2;"
        "assert not {'numba', 'scipy', 'matplotlib'} & set(sys.modules)"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT)
    assert ended.returncode == 0, ended.stderr
    assert "none.csv: no such file" in ended.stderr
