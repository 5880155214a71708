"""Tables of runs in the page: read and refused as by a calibration, and compared with the look-up table.

Copied rows, gaps of the notes and outputs that follow from others are left to the calibration.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from calibration.statistics import study
from calibration.swimmer import measured_table
from calibration.swimmer.measured_table import read_measurements
from tests.planner.page.cases import MEASURED, look_up, table_of_runs
from tests.planner.page.page_core import FOLDER, TABLE, answer, opened, refusal_of, typed

NAME = "table.csv"
Change = Callable[[pd.DataFrame], pd.DataFrame]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in an empty folder, so that a file has the same name in Python and in the page."""
    monkeypatch.chdir(tmp_path)


def read(table: pd.DataFrame, **form: Any) -> Any:
    """Write a table for Python, and read it as the page does."""
    text = table.to_csv(index=False, **form).encode()
    Path(NAME).write_bytes(text)
    found = opened(NAME, text)
    assert found["kind"] == "runs"
    columns = [typed(np.array(column)) for column in found["table"]["columns"]]
    return answer("measured.js", "readMeasurements", {**found["table"], "columns": columns}, NAME)


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


OTHER_UNITS = {"l_cm": "length [mm]", "theta_deg": "theta_rad", "omega_rpm": "rpm", "N": "Tails"}
TABLES: dict[str, Change] = {
    "as it is": lambda table: table,
    "bad rows": with_bad_rows,
    "missing outputs": lambda table: table.assign(
        theta_deg=table["theta_deg"].where(np.arange(len(table)) % 9 != 4),
        omega_h_rpm=table["omega_h_rpm"].where(np.arange(len(table)) != 30)),
    "the header again": lambda table: pd.concat(
        [table.astype(object)[:20], pd.DataFrame([list(table)], columns=list(table)), table.astype(object)[20:]],
        ignore_index=True),
    "other units": lambda table: table.assign(
        l_cm=10 * table["l_cm"], theta_deg=np.radians(table["theta_deg"])).rename(columns=OTHER_UNITS),
    "other columns": lambda table: table.assign(remark="calm", camera=1, temperature_F=70.0),
    "no sessions": lambda table: table.drop(columns="session"),
    "two robots": lambda table: table.assign(robot=np.where(np.arange(len(table)) % 3, "a", "b")),
    "numbered sessions": lambda table: table.assign(session=np.arange(len(table)) % 4),
    "columns without a value": lambda table: table.assign(
        v_cm_s=np.nan, session=" ", elapsed_min="", tachometer_sigma_percent=np.nan),
    "stated uncertainty": lambda table: table.assign(camera_scale_sigma_percent=2.0),
}  # fmt: skip


@pytest.mark.parametrize("form", [{}, {"sep": ";", "decimal": ","}], ids=["points", "commas"])
@pytest.mark.parametrize("name", TABLES)
def test_runs_are_read(name: str, form: dict[str, str]) -> None:
    found = read(TABLES[name](table_of_runs()), **form)
    wanted = read_measurements(NAME)
    assert tuple(found["excluded"]) == tuple(map(str, wanted.excluded))
    assert tuple(found["converted"]) == wanted.converted
    assert np.array_equal(np.array(found["usable"]) + 1, wanted.rows)
    assert tuple(found["sessions"]) == wanted.session_names
    assert found["repeats"] == len(wanted.y) - len(np.unique(wanted.condition))
    tails, length, rpm = (np.array(found["columns"][name])[found["usable"]] for name in ("N", "l_cm", "omega_rpm"))
    assert np.array_equal(tails, wanted.tails)
    assert np.allclose(length / 100, wanted.length, rtol=1e-15)
    assert np.allclose(rpm * np.pi / 30, wanted.omega, rtol=1e-15)


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
    assert str(read(BAD[name](table_of_runs()))) == refusal_of(read_measurements, NAME)


def test_the_numbers_of_the_rules_are_pythons() -> None:
    assert len(read(table_of_runs()[:20])["usable"]) == 20
    assert "20 usable runs; a calibration needs at least 24" in refusal_of(read_measurements, NAME)
    text = (FOLDER / "measured.js").read_text()
    assert f"const FEWEST_RUNS = {measured_table._FEWEST_RUNS};" in text
    assert f"const FEWEST_REPEATS = {measured_table.FEWEST_REPEATS};" in text


def compared(table: pd.DataFrame) -> Any:
    texts = [[str(value) for value in table[name]] for name in table]
    numbers = [pd.to_numeric(table[name], errors="coerce").fillna(0).tolist() for name in table]
    content = {"names": list(table), "columns": numbers, "texts": texts, "lines": list(range(2, len(table) + 2))}
    return answer("measured.js", "comparedRuns", content, NAME, MEASURED, TABLE)


def test_answers_and_differences_are_those_of_the_look_up_table() -> None:
    runs = table_of_runs()
    found, wanted = compared(runs), look_up(runs)
    assert len(found["rows"]) == len(runs)
    assert found["columns"] == ["omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg"]
    for i, name in enumerate(found["columns"]):
        motion = np.array([run["answer"][i] for run in found["rows"]])
        percent = np.array([run["percent"][i] for run in found["rows"]])
        assert np.allclose(motion, wanted[name], rtol=1e-11, atol=0)
        assert np.allclose(percent, 100 * (runs[name] / wanted[name] - 1), rtol=0, atol=1e-9)
        assert found["medians"][i] == pytest.approx(np.median(percent))
    assert found["needed"] == []
    assert [words.split(":")[0] for words in found["missing"]] == [
        "v_cm_s", "elapsed_min", "temperature_C", "tank_diameter_cm", "course_deg",
    ]  # fmt: skip


def test_a_run_outside_the_look_up_table_has_no_answer() -> None:
    runs = table_of_runs()
    runs.loc[3, "omega_rpm"] *= 1000
    runs.loc[5, "N"] = 90
    found = compared(runs)["rows"]
    assert [run["row"] for run in found if run["answer"] is None] == [4, 6]
    assert "were not learned" in found[3]["outside"]
    assert "the number of tails is an integer from 1 to 64" in found[5]["outside"]


NEEDED: dict[str, Change] = {
    "another N": lambda runs: runs[runs["N"] == 3],
    "another tail length": lambda runs: runs[runs["l_cm"] == 7.0],
    "another motor speed": lambda runs: runs[runs["omega_rpm"].abs() == 100.0],
    "the motor reversed": lambda runs: runs[runs["omega_rpm"] > 0],
    "repeated under equal conditions": lambda runs: runs.drop_duplicates(["N", "l_cm", "omega_rpm"]),
    "2 more sessions": lambda runs: runs[runs["session"] == "day 0"],
    "4 more: the table has 20 usable runs": lambda runs: runs[:20],
}


def test_runs_that_are_still_needed() -> None:
    for words, change in NEEDED.items():
        found = compared(change(table_of_runs()))
        assert [sentence for sentence in found["needed"] if words in sentence], words
    assert study._FEWEST == 3
