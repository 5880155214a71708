"""Units, their spellings and sentences are Python's."""

from __future__ import annotations

import math

import pytest

from sim.io.units import UNITS, convert, find_unit, format_length, format_time, of_kind, split, to_si
from tests.planner.page.page_core import answers

SPELLINGS = [*UNITS, "meter", "°", "deg/s", "U/min", "µm", "μm", "min⁻¹", "rad·s⁻¹", "[mm]", " ( cm ) ", "%", "",
             "-", "RPM", "hz", "constructor", "furlong", "m / s", "mm//s"]  # fmt: skip
NAMES = ["x", "x_mm", "R_yr [mm]", "X (cm)", "omega_yr_deg_s", "x_1", "viscosity_mPa_s", "a_rad_s",
         "Speed [U/min]", " y_cm ", "x []", "x [mm", "x] [mm]", "_cm", "cm", "name_with_parts", "x (furlong)",
         "x_", "s"]  # fmt: skip
NUMBERS = [0.0, 0.35, 48.2, 89.99, 90.0, 750.0, 5399.0, 5400.0, 12_000.0, 360_000.0, 1e7, -100.0, math.inf, 1e-5,
           0.0099, 0.01, 0.123456, 1.99, 2.0, 12.0, 59.5 * 60, 90.5 * 60]  # fmt: skip


def test_units_by_their_spellings() -> None:
    for found, text in zip(
        answers([("si_units.js", "findUnit", text) for text in SPELLINGS]), SPELLINGS, strict=True
    ):
        unit = find_unit(text)
        assert found == (None if unit is None else {**unit._asdict()}), text


def test_names_are_split() -> None:
    for found, name in zip(answers([("si_units.js", "splitName", name) for name in NAMES]), NAMES, strict=True):
        quantity, unit = split(name)
        assert found == {"quantity": quantity, "unit": None if unit is None else {**unit._asdict()}}, name


def test_values_are_converted_to_the_last_bit() -> None:
    pairs = [(a, b) for a in UNITS for b in UNITS if UNITS[a].kind == UNITS[b].kind]
    found = answers([("si_units.js", "convertUnit", 1.37, *pair) for pair in pairs])
    assert found == [convert(1.37, *pair) for pair in pairs]
    assert answers([("si_units.js", "toSi", 1.1, unit) for unit in UNITS]) == [to_si(1.1, unit) for unit in UNITS]
    texts = answers([("si_units.js", "unitText", UNITS[unit]._asdict()) for unit in UNITS])
    assert texts == [unit.text for unit in UNITS.values()]
    kinds = ("length", "pressure", "number")
    assert answers([("si_units.js", "unitsOfKind", kind) for kind in kinds]) == list(map(of_kind, kinds))


@pytest.mark.parametrize(("name", "function"), [("formatTime", format_time), ("formatLength", format_length)])
def test_sentences(name: str, function: object) -> None:
    assert callable(function)
    finite = [value for value in NUMBERS if math.isfinite(value)]
    assert answers([("si_units.js", name, value) for value in finite]) == list(map(function, finite))
