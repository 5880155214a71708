"""Columns in other units are found and converted as Python does it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from sim.io.errors import InputError
from sim.io.quantities import convert_columns
from tests.planner.page.page_core import answer

WANTED = ("time_s", "x_cm", "y_cm", "heading_deg")
NAMES = [
    ["time_s", "x_cm", "y_cm", "heading_deg"], ["time [min]", "x_mm", "Y (m)", "heading_rad"],
    ["Time_ms", "X [in]", "y_cm", "note"], ["time", "x_cm", "y_cm"], ["time_s", "x_cm", "x_mm"], ["x", "y"],
    ["time_s", "x_deg", "y_cm"], ["t_s", "x_cm"], ["time_s", "x_cm", "X_cm"],
]  # fmt: skip


def page_table(names: list[str], rows: int = 3) -> dict[str, Any]:
    return {"names": names, "columns": [[1.0 + i + 0.3 * k for k in range(rows)] for i in range(len(names))]}


@pytest.mark.parametrize("names", NAMES, ids=str)
def test_columns(names: list[str]) -> None:
    check_columns(names, WANTED, {})


RUNS = ("N", "l_cm", "omega_rpm", "omega_yr_rad_s", "temperature_C")
SYNONYMS = {"rpm": "omega", "motor": "omega", "length": "l", "tails": "N"}


@pytest.mark.parametrize(
    "names",
    [
        ["tails", "length_mm", "rpm", "omega_yr_deg_s"], ["N", "l [cm]", "Motor (rad/s)"], ["n", "L_cm", "rpm"],
        ["N", "l_cm", "omega_rpm", "rpm"], ["N", "length", "rpm"], ["N", "l", "temperature_F"], ["Tails", "N"],
        ["l_um", "omega_Hz", "omega_yr_rps", "temperature_K"],
    ],
    ids=str,
)  # fmt: skip
def test_columns_with_synonyms(names: list[str]) -> None:
    check_columns(names, RUNS, SYNONYMS)


def check_columns(names: list[str], wanted: tuple[str, ...], synonyms: dict[str, str]) -> None:
    table = page_table(names)
    others = {"map": list(synonyms.items())}
    found = answer("quantities.js", "convertColumns", table, wanted, "the track", others)
    frame = pd.DataFrame(dict(zip(names, table["columns"], strict=True)))
    try:
        converted = convert_columns(frame, wanted, "the track", synonyms)
    except InputError as refusal:
        words = str(refusal)
        assert str(found) == words
        return
    assert found["notes"] == list(converted.notes)
    assert found["table"]["names"] == list(converted.table)
    for name, values in zip(found["table"]["names"], found["table"]["columns"], strict=True):
        assert np.array_equal(values, converted.table[name])
