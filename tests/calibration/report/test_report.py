"""The report: the lab's units, what to do next, and nothing that a person would have to decode."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from calibration.attribution.halved_tolerances import notable_gains
from calibration.report.report import write_report
from calibration.statistics.pull import Pull
from calibration.swimmer.nuisance_numbers import nuisance_parameters
from calibration.verdict.record import facts, shown, verdict_record
from calibration.verdict.verdict import Next, Verdict
from calibration.words.quantities import detectable, direction_in_words, plain, size, with_error
from calibration.words.render import next_steps
from tests.calibration.toy_tables import (
    START,
    ambiguous,
    calibrated_toy,
    none,
    number,
)
from tests.page_text import PageText


def page(result: Verdict, folder: Path) -> PageText:
    write_report(result, folder / "report.html", title="t.csv")
    return PageText(folder / "report.html")


def with_errors(result: Verdict, *, before: float, after: float, p_value: float = 0.5) -> Verdict:
    rms = {**result.errors.rms, "before": before, "after": after}
    return replace(result, errors=replace(result.errors, rms=rms, p_value=p_value))


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
    record = verdict_record(result, table="t")
    given = {entry["name"]: entry["given"] for entry in record["numbers_as_given"]}
    assert given["youngs_modulus"] == START.youngs_modulus
    assert given["head_length"] == START.head_length
    assert record["next_steps"] == next_steps(facts(result))


@pytest.mark.slow
def test_a_claim_that_does_not_lower_the_error_says_so_first(tmp_path: Path) -> None:
    """In the verdict's first sentence, which verdict.json and the report have, too, and in what to do next."""
    result = ambiguous()
    fallen, risen = (with_errors(result, before=0.03, after=after) for after in (0.02, 0.031))
    assert fallen.held_out_error_falls is True
    assert "does not fall" not in fallen.sentence
    assert risen.held_out_error_falls is False
    words = "but the error on the held-out runs does not fall with it (3.00 % without, 3.10 % with it)."
    assert risen.sentence.startswith("The residual ")
    assert risen.sentence.endswith(words)
    record = verdict_record(risen, table="t")
    assert record["sentence"] == risen.sentence
    assert record["held_out_error_falls"] is False
    seen = page(risen, tmp_path)
    assert words in seen.text
    assert [c.effect.name for c in risen.evidence.candidates if f"({c.effect.name})" not in seen.text] == []
    assert f"({risen.explaining[0].effect.name})" in risen.sentence  # as one types it
    assert next_steps(facts(risen))[0].startswith("Do not rely on this claim yet")
    assert not next_steps(facts(fallen))[0].startswith("Do not rely")


@pytest.mark.slow
def test_rivals_are_told_apart_by_runs_that_are_worth_making_and_a_command(tmp_path: Path) -> None:
    result = ambiguous()
    batch, run = result.next.batch, result.next.runs[0]
    assert batch is not None

    def proposing(share: float, *shares: float) -> Verdict:
        """The verdict with a batch and single runs that decide in these shares of cases."""
        single = tuple(replace(run, decides=each) for each in shares) or result.next.runs
        return replace(result, next=Next(result.next.explanations, single, replace(batch, decides=share)))

    often, seldom = proposing(0.8), proposing(0.1)
    assert next_steps(facts(often))[0].startswith("Make the 8 runs of the table below")
    assert "`softflagella calibration decide " in next_steps(facts(often))[1]
    assert next_steps(facts(seldom))[0].startswith("Do not make runs with these settings")
    assert "--own" in next_steps(facts(seldom))[0]
    poor = proposing(0.14, 0.14)
    seen = page(poor, tmp_path)
    assert "decide in 14 % of cases only" in seen.text
    assert "Runs to make next" not in seen.text
    assert "Single settings" not in seen.text
    record = verdict_record(poor, table="t")
    assert record["next_batch"]["worth_making"] is False
    assert [entry["worth_making"] for entry in record["next_runs"]] == [False]
    seen = page(proposing(0.95, 0.93, 0.14), tmp_path)
    assert "Runs to make next" in seen.text
    assert "`" not in seen.text
    assert "93 %" in seen.text
    assert "14 %" not in seen.text


@pytest.mark.slow
def test_a_pull_that_is_not_taken_to_be_wrong_has_its_reason(tmp_path: Path) -> None:
    """And a report without a claim compares no model with itself."""
    plain = none()
    first, *others = plain.fits.pulls
    pulled = (replace(first, z=19.0), *others)
    for verdict, words in (
        ("unexplained", f"pull beyond 3: {first.parameter.title}. Nothing explains the residual, so none of them"),
        ("none", f"Taken to be wrong: {first.parameter.title}."),
    ):
        seen = page(replace(plain, verdict=verdict, fits=replace(plain.fits, pulls=pulled)), tmp_path)
        assert "+19.0 (beyond 3)" in seen.text
        assert words in seen.text
        assert "None is taken to be wrong" not in seen.text
        assert seen.text.count("(beyond 3)") == 1
    assert "On a path" not in seen.text
    assert "with the verdict's effects" not in seen.text
    assert seen.text.count("tail length [cm]") == 1


@pytest.mark.slow
def test_the_number_to_measure_better_is_listed_with_what_it_would_show(tmp_path: Path) -> None:
    result = calibrated_toy(2)
    seen = page(result, tmp_path).text
    title = "Which number, measured better, would show what"
    best = next(p.title for p in result.base.fitted if p.name == facts(result)["halved_tolerances"][0]["name"])
    assert f"by: {best} (" in seen[seen.index(title) :]
    halved = notable_gains(result.evidence.candidates)[0]
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
    stiffness = nuisance_parameters(START, {}, ("omega_yr",))[0]
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
