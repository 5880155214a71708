"""The report: the lab's units, what to do next, and nothing that a person would have to decode."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from calibration.attribution.halved_tolerances import notable_gains
from calibration.report.quantities import detectable, direction_in_words, plain, size, with_error
from calibration.report.report import write_report
from calibration.statistics.pull import Pull
from calibration.statistics.statistical_model import Parameter
from calibration.swimmer.measured_table import Measurements
from calibration.swimmer.nuisance_numbers import nuisance_parameters
from calibration.verdict.contents import Next
from calibration.verdict.next_steps import next_steps
from calibration.verdict.verdict import Verdict
from calibration.verdict.verdict_json import verdict_record
from tests.calibration.toy_tables import (
    START,
    calibrated,
    calibrated_toy,
    install_few_candidates,
    install_toy,
    toy_swimmer,
    toy_table,
)
from tests.page_text import PageText

ONE_LENGTH = {"lengths_cm": (8.0,), "end_over_end_drag": 4.0}


@pytest.fixture(scope="module")
def number() -> tuple[Verdict, Measurements]:
    """A table whose camera scale is off by six of its standard deviations, few candidates, and its verdict."""
    with pytest.MonkeyPatch.context() as patch:
        install_toy(patch)
        install_few_candidates(patch)
        table = toy_table(4)
        table["R_yr_cm"] *= 1.06
        return calibrated(table), toy_swimmer(table).runs


def ambiguous() -> tuple[Verdict, Measurements]:
    with pytest.MonkeyPatch.context() as patch:
        install_toy(patch)
        runs = toy_swimmer(toy_table(1, **ONE_LENGTH)).runs  # type: ignore[arg-type]
    return calibrated_toy(1, **ONE_LENGTH), runs  # type: ignore[arg-type]


def runs_of_toy(seed: int) -> Measurements:
    with pytest.MonkeyPatch.context() as patch:
        install_toy(patch)
        return toy_swimmer(toy_table(seed)).runs


def page(result: Verdict, runs: Measurements, folder: Path) -> PageText:
    write_report(result, runs, folder / "report.html", title="t.csv")
    return PageText(folder / "report.html")


def with_errors(result: Verdict, *, before: float, after: float, p_value: float = 0.5) -> Verdict:
    rms = {**result.errors.rms, "before": before, "after": after}
    return replace(result, errors=replace(result.errors, rms=rms, p_value=p_value))


def test_what_was_given_is_in_the_units_of_a_lab(number: tuple[Verdict, Measurements], tmp_path: Path) -> None:
    """The column used to be called "given [SI]", with 1.2e+06 for Young's modulus."""
    seen = page(*number, tmp_path)
    assert "SI" not in seen.text
    for value in ("1.2 MPa", "1.49 Pa s", "3.2 mm", "1.6 cm", "6 cm", "± 1 mm", "± 1°"):
        assert value in seen.text, value
    assert "1.600 ± 0.016 cm" in seen.text  # fitted: it used to be "1.3e-08 % below"


def test_nothing_is_written_for_machines(number: tuple[Verdict, Measurements], tmp_path: Path) -> None:
    """No exponents ("8.7e-10 % above"), no products of powers ("C_t^0.66 C_r^0.49"), no names of outputs."""
    seen = page(*number, tmp_path)
    assert re.findall(r"\d[eE][-+]\d\d", seen.text) == []
    assert "^" not in seen.text
    assert re.findall(r"omega_\w+|R_yr|theta", seen.text) == []
    assert re.search(r"one standard deviation is C_t [\d.]+ % \w+, C_r [\d.]+ % \w+ and C_yr", seen.text)


def test_what_to_do_next_comes_first(number: tuple[Verdict, Measurements], tmp_path: Path) -> None:
    seen = page(*number, tmp_path)
    assert seen.headings[0] == "What to do next"
    assert "Measure again: " in seen.text
    assert "scale of the camera" in seen.text


def test_the_units_of_the_table_do_not_change_the_numbers(number: tuple[Verdict, Measurements]) -> None:
    """verdict.json stays in SI units; only what is shown has others."""
    record = verdict_record(number[0], table="t")
    given = {entry["name"]: entry["given"] for entry in record["numbers_as_given"]}
    assert given["youngs_modulus"] == START.youngs_modulus
    assert given["head_length"] == START.head_length
    assert record["next_steps"] == next_steps(number[0])


def test_a_corrected_robot_that_does_not_lower_the_error_is_not_advised(
    number: tuple[Verdict, Measurements],
) -> None:
    given = number[0].error_uncalibrated
    for result in (with_errors(number[0], before=given, after=given), replace(number[0], verdict="none")):
        worse = with_errors(result, before=given, after=1.1 * given)
        first, *others = next_steps(worse)
        assert first.startswith("Plan with the robot as given: the corrected one does not lower the error")
        assert not [step for step in others if "corrected" in step]
        assert "corrected.toml" in " ".join(next_steps(with_errors(result, before=given, after=0.9 * given)))


@pytest.mark.slow
def test_a_claim_that_does_not_lower_the_error_says_so_first(tmp_path: Path) -> None:
    """In the verdict's first sentence, which verdict.json and the report have, too, and in what to do next."""
    result, runs = ambiguous()
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
    seen = page(risen, runs, tmp_path)
    assert words in seen.text
    assert [c.effect.name for c in risen.evidence.candidates if f"({c.effect.name})" not in seen.text] == []
    assert f"({risen.explaining[0].effect.name})" in risen.sentence  # as one types it
    assert next_steps(risen)[0].startswith("Do not rely on this claim yet")
    assert not next_steps(fallen)[0].startswith("Do not rely")


def test_a_wrong_number_that_does_not_lower_the_error_says_so_first(number: tuple[Verdict, Measurements]) -> None:
    risen = with_errors(number[0], before=0.03, after=0.031)
    first = risen.sentence.split(" No effect is claimed.")[0]
    assert first.startswith("A nuisance parameter is wrong: ")
    assert first.endswith("does not fall with it (3.00 % without, 3.10 % with it).")
    assert "without measuring it" in next_steps(risen)[0]
    assert next_steps(risen)[-1].startswith("Until then, plan with the robot as given")


@pytest.mark.slow
def test_where_nothing_is_claimed_nothing_can_fall() -> None:
    none = with_errors(calibrated_toy(3), before=0.03, after=0.03)
    assert none.held_out_error_falls is None
    assert "does not fall" not in none.sentence
    assert verdict_record(none, table="t")["held_out_error_falls"] is None
    assert next_steps(none)[0].startswith("Plan with the corrected robot: `softflagella plan ")
    odd = with_errors(none, before=0.03, after=0.03, p_value=0.001)
    assert next_steps(odd)[0].startswith("Find out what is different about the held-out runs")


@pytest.mark.slow
def test_rivals_are_told_apart_by_runs_and_a_command(tmp_path: Path) -> None:
    result, runs = ambiguous()
    batch = result.next.batch
    assert batch is not None
    often, seldom = (
        replace(result, next=replace(result.next, batch=replace(batch, decides=share))) for share in (0.8, 0.1)
    )
    assert next_steps(often)[0].startswith("Make the 8 runs of the table below")
    assert "`softflagella calibration decide " in next_steps(often)[1]
    assert next_steps(seldom)[0].startswith("Do not make runs with these settings")
    assert "--own" in next_steps(seldom)[0]
    seen = page(often, runs, tmp_path)
    assert "Runs to make next" in seen.text
    assert "`" not in seen.text


@pytest.mark.slow
def test_runs_that_seldom_decide_are_not_offered(tmp_path: Path) -> None:
    """Batches that decide in 14 % of cases stood in the report like good ones."""
    result, runs = ambiguous()
    batch, run = result.next.batch, result.next.runs[0]
    assert batch is not None
    poor = Next(result.next.explanations, (replace(run, decides=0.14),), replace(batch, decides=0.14))
    seen = page(replace(result, next=poor), runs, tmp_path)
    assert "decide in 14 % of cases only" in seen.text
    assert "Runs to make next" not in seen.text
    assert "Single settings" not in seen.text
    record = verdict_record(replace(result, next=poor), table="t")
    assert record["next_batch"]["worth_making"] is False
    assert [entry["worth_making"] for entry in record["next_runs"]] == [False]
    mixed = Next(poor.explanations, (replace(run, decides=0.93), *poor.runs), replace(batch, decides=0.95))
    seen = page(replace(result, next=mixed), runs, tmp_path)
    assert "Runs to make next" in seen.text
    assert "93 %" in seen.text
    assert "14 %" not in seen.text


@pytest.mark.slow
def test_a_pull_that_is_not_taken_to_be_wrong_has_its_reason(tmp_path: Path) -> None:
    """Pulls of +19 stood beside a text that did not name them."""
    runs = runs_of_toy(3)
    plain = calibrated_toy(3)
    first, second, *others = plain.fits.pulls
    pulled = (replace(first, z=19.0), second, *others)
    for verdict, words in (
        ("unexplained", f"pull beyond 3: {first.parameter.title}. Nothing explains the residual, so none of them"),
        ("none", f"Taken to be wrong: {first.parameter.title}."),
    ):
        seen = page(replace(plain, verdict=verdict, fits=replace(plain.fits, pulls=pulled)), runs, tmp_path)
        assert "+19.0 (beyond 3)" in seen.text
        assert words in seen.text
        assert "None is taken to be wrong" not in seen.text
        assert seen.text.count("(beyond 3)") == 1
    assert "None is taken to be wrong" in page(plain, runs, tmp_path).text


@pytest.mark.slow
def test_a_report_without_a_claim_compares_no_model_with_itself(tmp_path: Path) -> None:
    """Residuals before and after were the same picture twice."""
    runs = runs_of_toy(3)
    seen = page(calibrated_toy(3), runs, tmp_path)
    assert "with the verdict's effects" not in seen.text
    assert seen.text.count("tail length [cm]") == 1


@pytest.mark.slow
def test_the_number_to_measure_better_is_listed_with_what_it_would_show(tmp_path: Path) -> None:
    runs = runs_of_toy(2)
    result = calibrated_toy(2)
    seen = page(result, runs, tmp_path).text
    title, entry = "Which number, measured better, would show what", result.halved_tolerances
    best = next(p.title for p in result.base.fitted if p.name == next(iter(entry)))
    assert f"by: {best} (" in seen[seen.index(title) :]
    halved = notable_gains(result.evidence.candidates)[0]
    assert detectable(halved.effect.effect, halved.halved) in seen[seen.index(title) :]


def test_a_change_of_nothing_is_said_in_words() -> None:
    """It used to be "8.7e-10 % above what was given"."""
    stiffness = nuisance_parameters(START, {}, ("omega_yr",))[0]
    assert stiffness.name == "youngs_modulus"

    def words(change: float) -> str:
        return Pull(stiffness, change, 0.1, change, 0.1, change / 0.1, False).words

    assert words(8.7e-12) == "E (Young's modulus) is what was given (0.0 σ)"
    assert words(math.log(0.6)) == "E (Young's modulus) is 40 % below what was given (5.1 σ)"
    assert words(math.log(2.24)) == "E (Young's modulus) is 124 % above what was given (8.1 σ)"


def test_numbers_are_written_without_exponents() -> None:
    assert [plain(v) for v in (1.2e6, 3.2e-3, 8.7e-10, 0.0, 12.0)] == [
        "1200000", "0.0032", "0.00000000087", "0", "12",
    ]  # fmt: skip
    assert with_error(1.3456, 0.0932, "MPa") == "1.346 ± 0.093 MPa"
    assert with_error(-1e-9, 0.84, "mm", signed=True) == "0.00 ± 0.84 mm"
    assert with_error(0.63, 0.26, "°", signed=True) == "+0.63 ± 0.26°"


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
    effect = Parameter("e", "an effect", 0.0, (-1.0, 2.0), 0.1, unit=unit, shown=shown)
    assert size(effect, 0.05) == words
    assert detectable(effect, 1e150) == "–"
    assert detectable(effect, 6.2e6) == "beyond its range"  # it used to be "6.2e+06"


def test_the_direction_that_is_determined_worst_is_said_in_words() -> None:
    words = direction_in_words({"C_t": 0.6, "C_r": -0.8, "C_yr": 0.01}, 0.1)
    assert words == "C_t 6.2 % larger and C_r 7.7 % smaller"
