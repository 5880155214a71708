"""The report: the lab's units, what to do next, and nothing that a person would have to decode."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from calibration.attribution.wrong_numbers import notable_gains
from calibration.report.report import write_report
from calibration.statistics.fit import Pull
from calibration.swimmer.influences import nuisance_parameters
from calibration.verdict.record import facts, shown, verdict_record
from calibration.verdict.verdict import Verdict
from calibration.words.quantities import detectable, direction_in_words, plain, size, with_error
from calibration.words.render import next_steps
from tests.calibration.toy_tables import (
    START,
    calibrated_toy,
    number,
)
from tests.page_text import PageText


def page(result: Verdict, folder: Path) -> PageText:
    write_report(result, verdict_record(result, table="t.csv"), folder / "report.html")
    return PageText(folder / "report.html")


@pytest.mark.slow
def test_a_report_is_in_the_words_and_units_of_a_lab_with_what_to_do_next_first(tmp_path: Path) -> None:
    """verdict.json stays in SI units; only what is shown has others."""
    result = number()
    seen = page(result, tmp_path)
    assert "SI" not in seen.text
    for value in ("1.2 MPa", "1.49 Pa s", "3.2 mm", "1.6 cm", "6 cm", "± 1 mm", "± 1°", "1.600 ± 0.016 cm"):
        assert value in seen.text, value
    assert re.findall(r"\d[eE][-+]\d\d", seen.text) == []  # no exponents
    assert "^" not in seen.text  # no products of powers
    assert re.findall(r"omega_\w+|R_yr|theta", seen.text) == []
    assert re.search(r"one standard deviation is C_t [\d.]+ % \w+, C_r [\d.]+ % \w+ and C_yr", seen.text)
    assert seen.headings[0] == "What to do next"
    assert "Measure again: " in seen.text
    assert "scale of the camera" in seen.text
    assert [c.effect.name for c in result.found.candidates if f"({c.effect.name})" not in seen.text] == []
    assert seen.text.count("tail length [cm]") == 2  # of the calibrated and of the final model
    record = verdict_record(result, table="t")
    given = {entry["name"]: entry["given"] for entry in record["numbers_as_given"]}
    assert given["youngs_modulus"] == START.youngs_modulus
    assert given["head_length"] == START.head_length
    assert record["next_steps"] == next_steps(facts(result))


@pytest.mark.slow
def test_the_number_to_measure_better_is_listed_with_what_it_would_show(tmp_path: Path) -> None:
    result = calibrated_toy(2)
    seen = page(result, tmp_path).text
    title = "Which number, measured better, would show what"
    best = next(p.title for p in result.base.fitted if p.name == facts(result)["halved_tolerances"][0]["name"])
    assert f"by: {best} (" in seen[seen.index(title) :]
    halved = notable_gains(result.found.candidates)[0]
    effect = shown(halved.effect.effect) | {"bounds": halved.effect.effect.bounds}
    assert detectable(halved.halved, effect) in seen[seen.index(title) :]


def test_numbers_are_written_without_exponents_and_changes_in_words() -> None:
    assert [plain(v) for v in (1.2e6, 3.2e-3, 8.7e-10, 0.0, 12.0)] == [
        "1200000", "0.0032", "0.00000000087", "0", "12",
    ]  # fmt: skip
    assert with_error(1.3456, 0.0932, "MPa") == "1.346 ± 0.093 MPa"
    assert with_error(-1e-9, 0.84, "mm", signed=True) == "0.00 ± 0.84 mm"
    assert with_error(0.63, 0.26, "°", signed=True) == "+0.63 ± 0.26°"
    worst = direction_in_words({"C_t": 0.6, "C_r": -0.8, "C_yr": 0.01}, 0.1)
    assert worst == "C_t 6.2 % larger and C_r 7.7 % smaller"
    stiffness = nuisance_parameters(START, {}, ("omega_yr",), ())[0]
    for change, words in (
        (8.7e-12, "E (Young's modulus) is what was given (0.0 σ)"),
        (math.log(0.6), "E (Young's modulus) is 40 % below what was given (5.1 σ)"),
        (math.log(2.24), "E (Young's modulus) is 124 % above what was given (8.1 σ)"),
    ):
        assert Pull(stiffness, change, 0.1, change, 0.1, change / 0.1, False).words == words


@pytest.mark.parametrize(
    ("unit", "shown", "words"),
    [
        ("1", 1.0, "0.05"),
        ("cm/s", 100.0, "5 cm/s"),
        ("1/h", 1.0, "0.05 per h"),
        ("8π μ0 R³", 1.0, "0.05 × 8π μ0 R³"),
        ("μ0 a² l", 1.0, "0.05 × μ0 a² l"),
        ("L, forward", 1.0, "0.05 L, forward"),
    ],
)
def test_the_size_of_an_effect_has_its_unit(unit: str, shown: float, words: str) -> None:
    effect = {"given": 0.0, "bounds": [-1.0, 2.0], "unit": unit, "shown": shown}
    assert size(0.05, effect) == words
    assert detectable(1e150, effect) == "–"
    assert detectable(6.2e6, effect) == "beyond its range"
