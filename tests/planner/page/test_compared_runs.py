"""Runs stand beside the look-up table's own answers, and the page says which runs are still needed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from calibration.statistics import study
from sim.io.errors import InputError
from tests.planner.page.page_core import TABLE, answers
from tests.planner.page.plans import robot_to_page
from tests.planner.page.robots import shipped_data
from tests.planner.page.runs import ROBOT, look_up, table_of_runs


def compared(table: pd.DataFrame, lookup: str | None = TABLE) -> Any:
    texts = [[str(value) for value in table[name]] for name in table]
    numbers = [pd.to_numeric(table[name], errors="coerce").fillna(0).tolist() for name in table]
    content = {"names": list(table), "columns": numbers, "texts": texts, "lines": list(range(2, len(table) + 2))}
    robot = robot_to_page(ROBOT)
    return answers([("compared_runs.js", "comparedRuns", content, "table.csv", robot, lookup)], shipped_data())[0]


def test_answers_and_differences_are_those_of_the_look_up_table() -> None:
    runs = table_of_runs()
    found, wanted = compared(runs), look_up(runs)
    assert len(found["rows"]) == len(runs)
    assert found["columns"] == ["omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg"]
    for i, name in enumerate(found["columns"]):
        answer = np.array([run["answer"][i] for run in found["rows"]])
        percent = np.array([run["percent"][i] for run in found["rows"]])
        assert np.allclose(answer, wanted[name], rtol=1e-11, atol=0)
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


NEEDED = {
    "another N": lambda runs: runs[runs["N"] == 3],
    "another tail length": lambda runs: runs[runs["l_cm"] == 7.0],
    "another motor speed": lambda runs: runs[runs["omega_rpm"].abs() == 100.0],
    "the motor reversed": lambda runs: runs[runs["omega_rpm"] > 0],
    "repeated under equal conditions": lambda runs: runs.drop_duplicates(["N", "l_cm", "omega_rpm"]),
    "2 more sessions": lambda runs: runs[runs["session"] == "day 0"],
    "4 more: the table has 20 usable runs": lambda runs: runs[:20],
}


@pytest.mark.parametrize("words", NEEDED)
def test_runs_that_are_still_needed(words: str) -> None:
    found = compared(NEEDED[words](table_of_runs()))
    assert [sentence for sentence in found["needed"] if words in sentence]
    assert study._FEWEST == 3


def test_without_the_trained_table_runs_cannot_be_compared() -> None:
    found = compared(table_of_runs(), None)
    assert isinstance(found, InputError)
    assert "runs can only be compared with the trained look-up table" in str(found)
