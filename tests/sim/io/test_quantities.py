"""Columns are converted to the units that a program needs; what could mean two things is refused."""

from __future__ import annotations

import math

import pandas as pd
import pytest

from sim.io.errors import InputError
from sim.io.quantities import convert_columns

WANTED = ("N", "l_cm", "omega_rpm", "omega_h_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg", "temperature_C")


def converted(**columns: float) -> tuple[dict[str, float], tuple[str, ...]]:
    table, notes = convert_columns(pd.DataFrame({k: [v] for k, v in columns.items()}), WANTED, "runs.csv")
    return {str(name): table[name].iloc[0] for name in table}, notes


@pytest.mark.parametrize(
    ("column", "value", "wanted", "expected"),
    [
        ("l_mm", 110.0, "l_cm", 11.0),
        ("omega_yr_deg_s", 180.0, "omega_yr_rad_s", math.pi),
        ("omega_yr [°/s]", 180.0, "omega_yr_rad_s", math.pi),
        ("R_yr_mm", 25.0, "R_yr_cm", 2.5),
        ("theta_rad", math.pi / 2, "theta_deg", 90.0),
        ("Theta (rad)", math.pi / 2, "theta_deg", 90.0),
        ("omega_rad_s", math.tau, "omega_rpm", 60.0),
        ("omega_h_Hz", 2.0, "omega_h_rpm", 120.0),
        ("temperature_K", 293.15, "temperature_C", 20.0),
        ("l [cm]", 11.0, "l_cm", 11.0),
        ("n", 2.0, "N", 2.0),
    ],
)
def test_a_column_in_another_unit_is_converted(column: str, value: float, wanted: str, expected: float) -> None:
    row, notes = converted(**{column: value, "note": 1.0})
    assert row == {wanted: pytest.approx(expected, rel=1e-14), "note": 1.0}
    assert len(notes) == 1
    assert notes[0].startswith(f"column {column} ")
    assert wanted in notes[0]


def test_columns_that_fit_are_left_alone() -> None:
    assert converted(l_cm=3.0, omega_h_rpm=4.0, L_cm=6.0) == ({"l_cm": 3.0, "omega_h_rpm": 4.0, "L_cm": 6.0}, ())


def test_the_length_of_the_head_is_not_taken_for_that_of_the_tails() -> None:
    assert converted(L_mm=60.0) == ({"L_mm": 60.0}, ())


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"l_cm": 1.0, "l_mm": 10.0}, "l_cm and l_mm are the same quantity"),
        ({"R_yr [cm]": 1.0, "R_yr [mm]": 10.0}, r"R_yr \[cm\] and R_yr \[mm\] are the same quantity"),
        ({"omega_h": 1.0}, "'omega_h' has no unit; name it one of omega_h_rad_s, omega_h_deg_s, omega_h_rpm"),
        ({"theta": 1.0}, "'theta' has no unit; name it one of theta_rad, theta_deg"),
    ],
)
def test_what_could_mean_two_things_is_refused(columns: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        converted(**columns)


def test_a_synonym_may_be_a_unit() -> None:
    table, notes = convert_columns(pd.DataFrame({"rpm": [60.0]}), WANTED, "runs.csv", {"rpm": "omega"})
    assert table.to_dict("list") == {"omega_rpm": [60.0]}
    assert notes == ("column rpm read as omega_rpm",)


def test_a_value_that_is_no_number_is_missing_after_conversion() -> None:
    table, _ = convert_columns(pd.DataFrame({"l_mm": ["110", "?"]}), WANTED, "runs.csv")
    assert table["l_cm"].iloc[0] == 11.0
    assert math.isnan(table["l_cm"].iloc[1])
