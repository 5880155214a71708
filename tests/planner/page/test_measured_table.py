"""Tables of runs are read as calibration reads them: the same rows are left out, for the same reasons."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from calibration.swimmer import measured_table
from calibration.swimmer.measured_table import read_measurements
from tests.planner.page.page_core import answer, answers, refusal_of, typed
from tests.planner.page.runs import table_of_runs

NAME = "table.csv"
Change = Callable[[pd.DataFrame], pd.DataFrame]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in an empty folder, so that a file has the same name in Python and in the page."""
    monkeypatch.chdir(tmp_path)


def opened(text: bytes) -> dict[str, Any]:
    found = answer("open_file.js", "openFile", {"name": NAME, "bytes": list(text)})
    assert found["kind"] == "runs"
    return {**found["table"], "columns": [typed(np.array(column)) for column in found["table"]["columns"]]}


def read(text: bytes) -> Any:
    """Read a table as the page does, and write it for Python."""
    Path(NAME).write_bytes(text)
    return answer("measured_table.js", "readMeasurements", opened(text), NAME)


def csv(table: pd.DataFrame, **form: Any) -> bytes:
    return table.to_csv(index=False, **form).encode()


def with_bad_rows(table: pd.DataFrame) -> pd.DataFrame:
    """Spoil a row in each of the ways in which a row is spoilt."""
    table = table.astype(object)
    spoilt = [("N", 2.5), ("N", "three"), ("l_cm", 0), ("l_cm", -3.5), ("omega_rpm", 0), ("omega_rpm", ""),
              ("theta_deg", "inf"), ("theta_deg", -1e-7), ("R_yr_cm", 2e9), ("N", -3),
              ("omega_h_rpm", "NA")]  # fmt: skip
    for row, (column, value) in enumerate(spoilt):
        table.loc[row, column] = value
    for row, column in enumerate(("omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s"), len(spoilt)):
        table.loc[row, column] = -table.loc[row, column]
    return table


TABLES: dict[str, tuple[Change, dict[str, Any]]] = {
    "as it is": (lambda table: table, {}),
    "bad rows": (with_bad_rows, {}),
    "decimal commas": (with_bad_rows, {"sep": ";", "decimal": ","}),
    "other units": (
        lambda table: table.assign(l_cm=10 * table["l_cm"], theta_deg=np.radians(table["theta_deg"])).rename(
            columns={"l_cm": "length [mm]", "theta_deg": "theta_rad", "omega_rpm": "rpm", "N": "Tails"}
        ),
        {},
    ),
    "other columns": (lambda table: table.assign(remark="calm", camera=1, temperature_F=70.0), {}),
    "no sessions": (lambda table: table.drop(columns="session"), {}),
    "numbered sessions": (lambda table: table.assign(session=np.arange(len(table)) % 4), {}),
    "a speed that follows": (
        lambda table: table.assign(v_cm_s=table["omega_yr_rad_s"].abs() * table["R_yr_cm"]),
        {},
    ),
    "copied rows": (lambda table: pd.concat([table, table[3:30], table.assign(session="again")[:7]]), {}),
    "coarse numbers that agree by chance": (
        lambda table: table.round({"R_yr_cm": 0, "theta_deg": -1, "omega_yr_rad_s": 1, "omega_h_rpm": -1})
        .drop(columns="omega_t_rpm"),
        {},
    ),
    "columns without a value": (
        lambda table: table.assign(v_cm_s=np.nan, session=" ", elapsed_min="", tachometer_sigma_percent=np.nan),
        {},
    ),
    "stated uncertainty": (lambda table: table.assign(camera_scale_sigma_percent=2.0), {}),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_runs_are_read_as_python_reads_them(name: str) -> None:
    change, form = TABLES[name]
    found = read(csv(change(table_of_runs()), **form))
    wanted = read_measurements(NAME)
    assert found["refusal"] is None
    assert tuple(found["excluded"]) == wanted.excluded
    assert tuple(found["converted"]) == wanted.converted
    assert np.array_equal(np.array(found["usable"]) + 1, wanted.rows)
    assert tuple(found["sessions"]) == wanted.session_names
    assert found["repeats"] == len(wanted.y) - len(np.unique(wanted.condition))
    rows = found["usable"]
    assert np.array_equal(np.array(found["columns"]["N"])[rows], wanted.tails)
    assert np.allclose(np.array(found["columns"]["l_cm"])[rows] / 100, wanted.length, rtol=1e-15)
    assert np.allclose(np.array(found["columns"]["omega_rpm"])[rows] * np.pi / 30, wanted.omega, rtol=1e-15)


BAD: dict[str, Change] = {
    "no N": lambda table: table.drop(columns="N"),
    "no motor": lambda table: table.drop(columns="omega_rpm"),
    "a misspelt column": lambda table: table.rename(columns={"theta_deg": "thetta_deg"}),
    "no outputs": lambda table: table[["N", "l_cm", "omega_rpm", "session"]],
    "spins alone": lambda table: table[["N", "l_cm", "omega_rpm", "omega_h_rpm", "omega_t_rpm"]],
    "one quantity twice": lambda table: table.assign(theta_rad=table["theta_deg"]),
    "words for numbers": lambda table: table.assign(l_cm="long"),
    "no unit": lambda table: table.rename(columns={"l_cm": "l"}),
}


@pytest.mark.parametrize("name", BAD)
def test_tables_are_refused_in_the_same_words(name: str) -> None:
    found = read(csv(BAD[name](table_of_runs())))
    assert str(found) == refusal_of(read_measurements, NAME)


REFUSED: dict[str, Change] = {
    "the same in all repeats": lambda table: table.assign(theta_deg=20.0 + table["l_cm"]),
    "two uncertainties": lambda table: table.assign(tachometer_sigma_percent=np.arange(len(table)) % 2),
    "a large uncertainty": lambda table: table.assign(heading_zero_sigma_deg=60.0),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_calibration_refuses_is_said(name: str) -> None:
    found = read(csv(REFUSED[name](table_of_runs())))
    assert f"{NAME}: {found['refusal']}" == refusal_of(read_measurements, NAME)


def test_the_numbers_of_the_rules_are_pythons() -> None:
    assert read(csv(table_of_runs()[:20]))["refusal"] is None
    assert "20 usable runs; a calibration needs at least 24" in refusal_of(read_measurements, NAME)
    text = (Path(__file__).parents[3] / "planner" / "page" / "measured_table.js").read_text()
    assert f"const FEWEST_RUNS = {measured_table._FEWEST_RUNS};" in text
    assert f"const FEWEST_REPEATS = {measured_table._FEWEST_REPEATS};" in text


def test_columns_of_runs_are_recognised() -> None:
    names = [["N", "l_mm"], ["rpm"], ["theta [rad]", "a"], ["x_cm", "y_cm"], ["time_s", "heading_deg"], ["a", "b"]]
    found = answers([("measured_table.js", "areOfRuns", columns) for columns in names])
    assert found == [True, True, True, False, False, False]
