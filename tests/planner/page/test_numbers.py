"""Numbers, units, names and drawn numbers of the core are Python's, to the last bit where this decides a plan."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from planner.draws import normals
from planner.paths.path import Path2D, circle, polygon
from planner.paths.units import check_size, describe, extent, in_lab, place_in_lab, time_in_lab
from sim.io.units import UNITS, convert, format_length, format_time, split, to_si
from sim.motion.lab_units import lab_columns
from tests.planner.page.cases import CONTROL
from tests.planner.page.page_core import answer
from tests.planner.page.parity import check_parity

NUMBERS = [
    0.0, -0.0, -2.0, 1e-5, 1e-4, 123456.0, 1234567.0, 1e15, 1e16, -1e22, 5e-324, 1.7e308, -12.5, 9.999995,
    0.5, 1.5, 2.5, -0.5, 0.125, 0.375, 2.675, 1.005, 1234565.0, 1234575.0, 0.000244140625, 999999.5,  # ties
    *np.random.default_rng(0).lognormal(0.0, 20.0, 100).tolist(),
]  # fmt: skip
NUMBER_WORDS = [" -2.5 ", "+.5", "3.", "1E-3", "1_000", "inf", "-Infinity", "nan", "1,5", "", "0x10", "1__0", "e5",
                ".", "1e", "12 3", "½", "1e400"]  # fmt: skip
NAMES = ["x", "x_mm", "R_yr [mm]", "X (cm)", "omega_yr_deg_s", "x_1", "viscosity_mPa_s", "a_rad_s",
         "Speed [U/min]", " y_cm ", "x []", "x [mm", "x] [mm]", "_cm", "cm", "name_with_parts", "x (furlong)",
         "x_", "s"]  # fmt: skip
SIZES = [0.0, 0.35, 48.2, 89.99, 90.0, 750.0, 5399.0, 5400.0, 12_000.0, 360_000.0, 1e7, -100.0, 1e-5, 0.0099, 0.01,
         0.123456, 1.99, 2.0, 12.0, 59.5 * 60, 90.5 * 60]  # fmt: skip
LENGTHS = [(x, CONTROL) for x in (0.0, 0.32, 1e-4, -2.5, 17.0, 999.6, 1000.0, 12_345.0)]
PATHS = [circle(2.0), polygon(3, 40.0), circle(0.01), Path2D.of([[0, 0], [3, 4]]), circle(3000.0), circle(50.0)]
KNOWN = ["count", "length", "radius", "youngs_modulus", "disc_offset", "viscosity", "speed", "C_t", "C_r", "C_yr"]
WORDS = ["cuont", "lenght", "radus", "diameter", "young_modulus", "offset", "viscos", "C_x", "C", "sped", "",
         "zzz", "radius", "modulus", "C_y"]  # fmt: skip
Cases = list[tuple[Any, ...]]


def one_each(values: list[Any]) -> Cases:
    return [(value,) for value in values]


def python_number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def split_name(name: str) -> dict[str, Any]:
    quantity, unit = split(name)
    return {"quantity": quantity, "unit": None if unit is None else unit._asdict()}


PARITY: list[tuple[str, str, Callable[..., Any], Cases]] = [
    ("format", "repr", repr, one_each(NUMBERS)),
    ("format", "general", lambda x, digits: f"{x:.{digits}g}", [(x, n) for x in NUMBERS for n in (1, 3, 6)]),
    ("format", "fixed", lambda x, places: f"{x:.{places}f}", [(x, n) for x in NUMBERS for n in (0, 2, 5)]),
    ("format", "roundHalfEven", round, one_each([value for value in NUMBERS if abs(value) < 1e15])),
    ("format", "pythonNumber", python_number, one_each(NUMBER_WORDS)),
    ("close_match", "closeMatch", lambda word, known: next(iter(difflib.get_close_matches(word, known, 1)), None),
     [(word, [*KNOWN, ""]) for word in WORDS]),
    ("si_units", "splitName", split_name, one_each(NAMES)),
    ("si_units", "convertUnit", convert,
     [(1.37, a, b) for a in UNITS for b in UNITS if UNITS[a].kind == UNITS[b].kind]),
    ("si_units", "toSi", to_si, [(1.1, unit) for unit in UNITS]),
    ("si_units", "formatTime", format_time, one_each(SIZES)),
    ("si_units", "formatLength", format_length, one_each(SIZES)),
    ("units", "inLab", in_lab, LENGTHS),
    ("units", "timeInLab", time_in_lab, LENGTHS),
    ("units", "placeInLab", place_in_lab, [(x, -0.0001 * y, robot) for x, robot in LENGTHS for y, _ in LENGTHS]),
    ("units", "describe", describe, [(path, CONTROL) for path in PATHS]),
    ("units", "extent", extent, one_each(PATHS)),
]  # fmt: skip


@pytest.mark.parametrize(("file", "name", "function", "cases"), PARITY, ids=[case[1] for case in PARITY])
def test_to_the_last_bit(file: str, name: str, function: Callable[..., Any], cases: Cases) -> None:
    assert check_parity(f"{file}.js", name, function, cases) == 0


def test_sizes_of_paths_are_refused() -> None:
    assert 0 < check_parity("units.js", "checkSize", check_size, [(path, CONTROL, 1.3) for path in PATHS]) < 6


def test_numbers_are_drawn() -> None:
    cases = [(0, 0, 200_000), (1, 5, 1000), (12345, 2**20, 1000), (2**32 - 1, 0, 1000), (2**40, 7, 10)]
    check_parity("draws.js", "normals", normals, cases, 5e-15)


def test_motions_in_the_units_of_a_laboratory() -> None:
    motion = {"omega_h_bar": -12.5, "omega_t_bar": 40.25, "omega_yr_bar": -0.31, "R_yr_over_l": 0.42,
              "theta_deg": 31.5, "v_x": -0.03, "v_z": 0.11}  # fmt: skip
    found = answer("lab_units.js", "labColumns", motion, 9.5, 2.125)
    wanted = lab_columns({name: np.array([value]) for name, value in motion.items()}, 9.5, 2.125)
    assert set(wanted) - set(found) == {"circle_s"}
    for name, value in found.items():
        assert value == pytest.approx(float(wanted[name][0]), rel=1e-15)
