"""Units: suffixes, brackets, spellings, conversion, and quantities in sentences."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.io.units import UNITS, convert, find_unit, format_length, format_time, from_si, of_kind, split, to_si


@pytest.mark.parametrize(
    ("name", "quantity", "suffix"),
    [
        ("omega_yr_rad_s", "omega_yr", "rad_s"),
        ("omega_yr_deg_s", "omega_yr", "deg_s"),
        ("R_yr_mm", "R_yr", "mm"),
        ("viscosity_mPa_s", "viscosity", "mPa_s"),
        ("viscosity_Pa_s", "viscosity", "Pa_s"),
        ("v_cm_min", "v", "cm_min"),
        ("time_s", "time", "s"),
        ("X [cm]", "X", "cm"),
        ("omega (deg/s)", "omega", "deg_s"),
        ("theta [°]", "theta", "deg"),
        ("motor[U/min]", "motor", "rpm"),
        ("youngs_modulus_MPa", "youngs_modulus", "MPa"),
    ],
)
def test_a_name_is_split_into_quantity_and_unit(name: str, quantity: str, suffix: str) -> None:
    assert split(name) == (quantity, UNITS[suffix])


@pytest.mark.parametrize("name", ["x", "N", "C_t", "C_yr", "omega_yr", "run", "cm", "rpm", "R [ells]", "x_1"])
def test_a_name_without_a_unit_has_none(name: str) -> None:
    assert split(name).unit is None


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
