"""What runs say without a model: each fault is named, and nothing is where there is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calibration.attribution.hypothesis import Hypothesis, Origin
from calibration.findings.next_runs import Explanation
from calibration.report.report import sections
from calibration.statistics.offsets import Offsets, with_differences
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import LEVEL
from calibration.swimmer.measured_table import Measurements, read_measurements
from calibration.table.between_repeats import Difference, find_differences, usable
from calibration.words.render import next_steps
from tests.calibration.toy_tables import calibrated, fit_all, toy_swimmer, toy_table, verdict_of
from tests.oracles.misread_tables import CASES, Case, make_table

MEASURED = Path(__file__).parents[3] / "shared/measured"


def _found(runs: Measurements) -> tuple[Difference, ...]:
    return find_differences(runs, level=LEVEL)


def _case(words: str) -> Case:
    return next(case for case in CASES if words in case.label)


@pytest.mark.parametrize("case", [case for case in CASES if any(case.named)], ids=lambda case: case.label)
def test_each_fault_is_named(case: Case):
    tables = [_found(read_measurements(make_table(case, seed))) for seed in (0, 1, 2)]
    assert sum(case.named in [(d.output, d.column) for d in found] for found in tables) >= 2


@pytest.mark.parametrize("case", [case for case in CASES if not any(case.named)], ids=lambda case: case.label)
def test_nothing_is_found_where_there_is_nothing(case: Case):
    assert [_found(read_measurements(make_table(case, seed))) for seed in range(4)] == [()] * 4


def test_sizes_are_those_of_the_fault():
    found = {d.column: d for d in _found(read_measurements(make_table(_case("5 % low"), 3)))}
    driver = _found(read_measurements(make_table(_case("driver"), 1)))[0]
    assert found["operator"].size == pytest.approx(np.log(0.95), abs=0.02)
    assert (found["operator"].where, found["operator"].against) == ("operator B", "operator A")
    assert driver.where in ("where motor speed is above 90 rpm", "where motor speed is above 115 rpm")
    assert driver.size == pytest.approx(-np.log(1.15), abs=0.02)


def test_an_offset_follows_what_is_read():
    """A watch that is stopped late reads fast turns lower than slow ones."""
    found = _found(read_measurements(make_table(_case("watch"), 56)))
    assert [(d.output, d.of_reading, d.size < 0) for d in found] == [
        ("omega_yr", False, True),
        ("omega_yr", True, True),
    ]


def test_what_the_model_knows_is_left_to_it():
    """Drift with the time of the runs, and sessions that differ, are no differences with an unknown column."""
    table = make_table(CASES[0], 5).assign(elapsed_min=lambda t: 4.0 * np.arange(len(t)))
    drifting = table.assign(omega_yr_rad_s=table.omega_yr_rad_s * np.exp(0.2 * table.elapsed_min / 768))
    shifted = table.assign(R_yr_cm=table.R_yr_cm * np.where(table.session == "2", 1.1, 1), v_cm_s=np.nan)
    assert not [d for d in _found(read_measurements(drifting)) if d.numbers]
    assert not [d for d in _found(read_measurements(shifted.drop(columns="v_cm_s"))) if d.numbers]


def test_order_of_runs_is_tested_where_the_time_is_not_noted():
    table = make_table(CASES[0], 5).assign(v_cm_s=np.nan)
    drifting = table.assign(omega_yr_rad_s=table.omega_yr_rad_s * np.exp(0.4 * np.linspace(0, 1, len(table))))
    assert [(d.output, d.column) for d in _found(read_measurements(drifting))] == [
        ("omega_yr", "order of the runs")
    ]


def test_notes_that_say_the_same_are_named_together():
    table = make_table(_case("5 % low"), 3)
    table["watch"] = np.where(table["operator"] == "B", "old", "new")
    (found,) = (d for d in _found(read_measurements(table)) if not d.of_reading)
    assert {found.column, *found.instead} == {"operator", "watch"}


def test_a_column_of_an_unknown_name_is_a_note_if_it_can_be_tested():
    table = toy_table(3)
    table = table.assign(operator=["A", "B"] * (len(table) // 2), Nr=range(len(table)), colour="red")
    table["remark"] = [f"run {i}" for i in range(len(table))]
    data = read_measurements(table)
    assert list(data.notes) == ["operator"]
    assert "column operator: not known, tested as a grouping" in data.converted
    assert [str(e) for e in data.excluded] == [
        f"column {n}: not known, left out" for n in ("Nr", "colour", "remark")
    ]
    assert data.subset(np.arange(3)).notes["operator"].tolist() == ["A", "B", "A"]


def test_missing_notes_are_not_tested():
    assert [usable(np.array(v)) for v in ([1.0, np.nan, 3.0, 2.0], ["A", "", "B"])] == [True, True]
    assert [usable(np.array(v)) for v in ([1.0, np.nan, 2.0, 3.0], ["A", "", "A"])] == [False, False]


def _misread(seed: int) -> pd.DataFrame:
    """A table in which operator B reads yaw rates 10 % low."""
    table = toy_table(seed)
    table["operator"] = np.where(np.random.default_rng(seed).random(len(table)) < 0.4, "B", "A")
    return table.assign(omega_yr_rad_s=table.omega_yr_rad_s * np.where(table.operator == "B", 0.9, 1.0))


def test_a_difference_becomes_a_number_of_the_fit_and_no_noise():
    plain = toy_swimmer(_misread(3))
    model, found = with_differences(plain, None, level=LEVEL)
    name = "omega_yr, operator B"
    fitted, without = fit_all(model), fit_all(plain)
    assert isinstance(model, Offsets)
    assert [list(d.numbers) for d in found] == [[name]]
    assert fitted.parameters[name] == pytest.approx(np.log(0.9), abs=0.03)
    yaw = model.runs.outputs.index("omega_yr")
    assert fitted.noise.run_covariance[yaw, yaw] < 0.8 * without.noise.run_covariance[yaw, yaw]


def test_the_linear_model_has_the_offset_at_gaps_too():
    table = _misread(3)
    table.loc[table.index[5], "omega_yr_rad_s"] = np.nan
    model, _ = with_differences(toy_swimmer(table), None, level=LEVEL)
    at = {**start_values(model), "omega_yr, operator B": -0.1}
    linear = model.linearised(at, model.coefficients)([at])
    assert linear == pytest.approx(model.predict([at]), abs=1e-6)
    possible, settings = model.possible()
    assert possible.predict([at]) == pytest.approx(toy_swimmer(table).possible()[0].predict([start_values(model)]))
    assert len(possible.runs) == len(settings)


def test_the_verdict_begins_with_the_difference_and_hands_on_no_offset():
    verdict = calibrated(_misread(3), few=True)
    record = verdict.facts
    assert verdict.sentence.startswith("Without any model: the yaw rate of operator B is")
    assert "below that of operator A" in verdict.sentence
    assert next_steps(record)[0].startswith("Check operator: the yaw rate of operator B is")
    assert set(record["differences"][0]) >= {"words", "output", "column", "size", "z", "p"}
    assert record["differences"][0]["numbers"] == ["omega_yr, operator B"]
    report = sections(verdict.to_dict(), {})
    assert "<h2>Without any model</h2>" in report
    assert "<td>yaw rate</td><td>operator</td>" in report
    robot = verdict_of(verdict)
    assert verdict.verdict == "none"
    assert "operator" not in "".join(robot.knowledge.names)
    assert robot.corrected.C_yr == pytest.approx(4.4, rel=0.1)


def test_runs_that_decide_need_no_offset():
    model, _ = with_differences(toy_swimmer(_misread(3)), None, level=LEVEL)
    explanation = Explanation.of(Hypothesis(Origin.NUMBER, (), fitted := fit_all(model)))
    assert set(fitted.names) - set(explanation.parameters) == {"omega_yr, operator B"}
    assert explanation.covariance.shape == (len(fitted.names) - 1,) * 2


def test_measured_tables_are_quiet():
    if not MEASURED.exists():
        pytest.skip("measured tables are not part of the project")
    for name in ("bench-a", "bench-b", "bench-c", "bench-d", "bench-e", "bench-f", "run01", "run04"):
        assert not _found(read_measurements(MEASURED / f"{name}.csv"))


def test_held_out_runs_alone_give_no_number():
    table = _misread(3)
    runs = read_measurements(table)
    held_out = runs.notes["operator"] == "B"
    model, found = with_differences(toy_swimmer(table), held_out, level=LEVEL)
    assert found
    assert not isinstance(model, Offsets)
