"""Units, converted columns and times: names, spellings, numbers, and what could be two things."""

from __future__ import annotations

import math

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.io.errors import InputError
from sim.io.quantities import convert_columns, numbers_of
from sim.io.units import UNITS, convert, find_unit, format_length, format_time, from_si, of_kind, split, to_si


def test_a_name_is_split_into_quantity_and_unit() -> None:
    for name, quantity, suffix in (
        ("omega_yr_rad_s", "omega_yr", "rad_s"), ("omega_yr_deg_s", "omega_yr", "deg_s"), ("R_mm", "R", "mm"),
        ("viscosity_mPa_s", "viscosity", "mPa_s"), ("viscosity_Pa_s", "viscosity", "Pa_s"),
        ("time_s", "time", "s"), ("v_cm_min", "v", "cm_min"), ("X [cm]", "X", "cm"),
        ("omega (deg/s)", "omega", "deg_s"), ("theta [°]", "theta", "deg"), ("motor[U/min]", "motor", "rpm"),
    ):  # fmt: skip
        assert split(name) == (quantity, UNITS[suffix]), name
    for name in ("x", "N", "C_t", "C_yr", "omega_yr", "run", "cm", "rpm", "R [ells]", "x_1"):
        assert split(name).unit is None, name


def test_known_conversions() -> None:
    assert convert(60.0, "rpm", "rad_s") == pytest.approx(math.tau)
    assert convert(180.0, "deg", "rad") == math.pi
    assert convert(11.0, "cm", "m") == 0.11
    assert convert(3.2, "mm", "m") == 0.0032
    assert convert(20.0, "C", "K") == 293.15
    assert convert(68.0, "F", "C") == pytest.approx(20.0)
    assert convert(1490.0, "cP", "Pa_s") == 1.49
    assert convert(6.0, "cm_min", "mm_s") == pytest.approx(1.0)
    with pytest.raises(ValueError, match="unit of length"):
        convert(1.0, "cm", "s")


@given(st.sampled_from(sorted(UNITS)), st.floats(-1e6, 1e6))
def test_conversion_to_si_and_back_is_the_same_number(suffix: str, value: float) -> None:
    assert from_si(to_si(value, suffix), suffix) == pytest.approx(value, rel=1e-12, abs=1e-9)


@given(st.sampled_from(sorted(UNITS)))
def test_every_unit_is_found_as_it_is_written(suffix: str) -> None:
    unit = UNITS[suffix]
    assert find_unit(suffix) == find_unit(f"[{unit.text}]") == unit
    assert suffix in of_kind(unit.kind)


def test_times_and_lengths_as_people_say_them() -> None:
    assert [format_time(s) for s in (0.354, 48.2, 750.0, 12_000.0, 7200.0, 134_000.0)] == [
        "0.354 s", "48.2 s", "12.5 min", "3 h 20 min", "2 h", "37 h 13 min",
    ]  # fmt: skip
    assert [format_length(m) for m in (0.0032, 0.124, 1.5, 104.0, 0.0)] == [
        "3.2 mm", "12.4 cm", "150 cm", "104 m", "0 cm",
    ]  # fmt: skip


NAN = float("nan")
WANTED = ("N", "l_cm", "omega_rpm", "omega_h_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg", "temperature_C")


def converted(**columns: float) -> tuple[dict[str, float], tuple[str, ...]]:
    table, notes = convert_columns(pd.DataFrame({k: [v] for k, v in columns.items()}), WANTED, "runs.csv")
    return {str(name): table[name].iloc[0] for name in table}, notes


@pytest.mark.parametrize(
    ("column", "value", "wanted", "expected"),
    [
        ("l_mm", 110.0, "l_cm", 11.0),
        ("omega_yr_deg_s", 180.0, "omega_yr_rad_s", math.pi),
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
    """The length of the head is not taken for that of the tails."""
    assert converted(l_cm=3.0, omega_h_rpm=4.0, L_cm=6.0) == ({"l_cm": 3.0, "omega_h_rpm": 4.0, "L_cm": 6.0}, ())
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


def test_a_synonym_may_be_a_unit_and_a_value_that_is_no_number_is_missing() -> None:
    table, notes = convert_columns(pd.DataFrame({"rpm": [60.0]}), WANTED, "runs.csv", {"rpm": "omega"})
    assert table.to_dict("list") == {"omega_rpm": [60.0]}
    assert notes == ("column rpm read as omega_rpm",)
    table, _ = convert_columns(pd.DataFrame({"l_mm": ["110", "?"]}), WANTED, "runs.csv")
    assert table["l_cm"].iloc[0] == 11.0
    assert math.isnan(table["l_cm"].iloc[1])


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("time_s", pd.to_timedelta([0, 1.5], unit="s"), [0, 1.5]),
        ("time_ms", pd.to_timedelta([0, 1.5], unit="s"), [0, 1500]),
        ("elapsed_min", pd.to_datetime(["2026-01-01 00:03", "2026-01-01 00:00", None]), [3, 0, NAN]),
        ("elapsed_min", ["0:03:00", "0 days 00:00:30.0", "1 day, 0:00:00"], [3, 0.5, 1440]),
        ("t_s", ["2026-05-01T12:00:00Z", "2026-05-01 14:00:01,5+02:00", "2026-05-01"], [43200, 43201.5, 0]),
        ("time_s", ["0:00:01", "1:30", "2026"], [1, NAN, NAN]),
        ("time_s", [1.7e9, 1.7e9 + 0.5], [0, 0.5]),
        ("time_ms", [1.7e12, NAN, 1.7e12 + 500], [0, NAN, 500]),
        ("time_s", [1.7e12, 1.7e12 + 500], [NAN, NAN]),
        ("time_s", [5.0, 7.0], [5, 7]),
        ("time_s", ["5", "lost"], [5, NAN]),
        ("heading_deg", pd.to_timedelta([0, 1.5], unit="s"), [NAN, NAN]),
        ("heading_deg", pd.to_datetime(["2026-01-01", "2026-01-02"]), [NAN, NAN]),
    ],
    ids=str,
)
def test_times(name: str, given: object, expected: list[float]) -> None:
    assert numbers_of(pd.Series(given, name=name)).tolist() == pytest.approx(expected, nan_ok=True, abs=1e-9)


def test_a_duration_has_a_unit_of_its_own() -> None:
    table = convert_columns(
        pd.DataFrame({"t_ms": ["0:00:01", "0:00:02"]}), ["time_s"], "tracks", {"t": "time"}
    ).table
    assert table["time_s"].tolist() == [1, 2]
