"""What moved, when, and on which specimen: numbers that differ in some runs are named, and nothing else."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from calibration.attribution.hypothesis import Hypothesis, Origin
from calibration.attribution.moves import find_moves, groups_that_may_differ
from calibration.findings.next_runs import Explanation, standings
from calibration.linear.gls import repeat_count, repeat_covariance
from calibration.robot.robot_verdict import RobotVerdict
from calibration.statistics.fit import fit
from calibration.statistics.forward import by_differences, derivatives
from calibration.statistics.shifted import Shift, Shifted
from calibration.statistics.statistical_model import Parameter, start_values
from calibration.statistics.study import Study
from calibration.statistics.weights import alike
from calibration.swimmer.influences import CURRENT
from calibration.swimmer.measured_table import read_measurements
from calibration.words.render import next_steps
from common.arrays import Floats
from common.units import Sigma
from sim.inputs import load_robot
from sim.model.uncertainty import DEFAULTS
from softflagella.closed_loop import calibrate
from tests.calibration.own_model.test_faults import DIAMETER, ROUND, TABLE, hand_made
from tests.calibration.toy_tables import (
    DRAG,
    LENGTHS_CM,
    START,
    TRUTH,
    calibrated,
    on_the_toy,
    toy_swimmer,
    toy_table,
)
from tests.shared import shared

MEASURED = Path(__file__).parents[4] / "shared" / "measured"
DAYS, TWO_CM = 4, (5.0, 11.0)
KNOWN = replace(START, sigmas=dict.fromkeys(DEFAULTS, Sigma(0.0, False)))  # with few numbers that could differ


def in_days(table: pd.DataFrame, column: str = "session") -> pd.DataFrame:
    """Put runs of every kind into each of some days; repeats are on different ones."""
    kind, repeat = np.divmod(np.arange(len(table)), 2)
    day = (kind + repeat * (1 + kind // DAYS % 3)) % DAYS + 1
    return table.assign(**{column: [f"day {d}" for d in day]})


def of_two(column: str, other: str, lengths_cm: tuple[float, ...] = TWO_CM, **changed: float) -> pd.DataFrame:
    """A table in days, or on robots, of which those called `other` are of another truth."""
    table = in_days(toy_table(3, lengths_cm=lengths_cm), column)
    moved = in_days(toy_table(3, lengths_cm=lengths_cm, truth=replace(TRUTH, **changed)), column)
    return table.where(table[column] != other, moved)


@shared
def moved_on(day: int, **changed: float) -> RobotVerdict:
    lengths, robot = (LENGTHS_CM, START) if day == 2 else (TWO_CM, KNOWN)
    table = of_two("session", f"day {day}", lengths, **changed)
    with on_the_toy(few=True):
        return calibrate(table, robot, laws=False, progress=False)


def test_sessions_of_one_number_of_tails_each_are_no_groups() -> None:
    """There a shift is no different from an effect of N."""
    table = toy_table(3)
    assert groups_that_may_differ(read_measurements(table)) == []
    names = [words for words, _ in groups_that_may_differ(read_measurements(in_days(table)))]
    assert names == [*(f"in session day {d}" for d in range(1, 5)), "since session day 3"]


def test_a_part_of_the_runs_may_lack_a_session() -> None:
    runs = read_measurements(in_days(toy_table(3)))
    part = runs.subset(runs.session != 1)
    names = [words for words, _ in groups_that_may_differ(part)]
    assert names == [f"in session day {d}" for d in (1, 3, 4)]


def test_the_noise_of_repeats_in_several_sessions_is_without_the_shifts_of_sessions() -> None:
    rng = np.random.default_rng(0)
    condition, session = np.repeat(np.arange(60), 2), in_days(pd.DataFrame({"run": range(120)}))["session"]
    session = session.str[-1].astype(int).to_numpy() - 1
    noise, shift = 0.02 * rng.normal(size=(2000, 120, 1)), np.array([0.3, -0.2, 0.5, 0.0])[session][:, None]
    design = 1.0 * np.column_stack([factor[:, None] == np.unique(factor) for factor in (condition, session)])
    assert repeat_count(design) == 120 - 60 - 3
    estimates = repeat_covariance(noise + shift + condition[:, None], design)[:, 0, 0]
    assert estimates.mean() == pytest.approx(0.02**2, rel=0.02)
    assert repeat_covariance(noise, design[:, :60]) == pytest.approx(repeat_covariance(noise, condition))


def test_derivatives_along_a_change_are_those_of_differences() -> None:
    with on_the_toy():
        model = toy_swimmer(in_days(toy_table(3)))
        rows = model.runs.session == 1
        numbers = (model.coefficients[1], model.nuisances[0])
        moved = Shifted(model, tuple(Shift(number, rows, "in session day 2") for number in numbers))
        names = ["C_r", *(shift.change.name for shift in moved.shifts)]
        at = {**start_values(moved), **{name: 0.1 for name in names[1:]}}
        close = by_differences(moved, at, names)[1]
        assert derivatives(moved, at, names)[1] == pytest.approx(close, abs=0.02 * np.abs(close).max())


def test_a_change_of_these_runs_is_no_part_of_an_explanation_of_new_ones() -> None:
    """New runs have sessions of their own, so nothing can be asked of what differs in one that was."""
    with on_the_toy():
        model = toy_swimmer(in_days(toy_table(3)))
        shift = Shift(model.coefficients[1], model.runs.session == 1, "in session day 2")
        moved, used = Shifted(model, (shift,)), np.ones(len(model.runs), dtype=bool)
        fitted = fit(moved, start_values(moved), ["C_t", "C_r", shift.change.name], used, title="")
        explanation = Explanation.of(Hypothesis(Origin.EFFECT, model.effects[:1], fitted))
        assert list(explanation.parameters) == ["C_t", "C_r"]
        standing = standings(model, [explanation], model.runs.session == 3)
    assert np.isfinite(standing[0].behind)


@pytest.mark.slow
@pytest.mark.parametrize("day", [2, 3])
def test_a_coefficient_that_differs_on_a_day_is_named(day: int) -> None:
    """On day 3 it is in the held-out session."""
    result = moved_on(day, C_r=0.8 * TRUTH.C_r)
    assert result.effects == ()
    assert len(result.moves) == 1
    (record,) = result.facts["moves"]
    assert (record["number"], record["where"]) == ("C_r", f"in session day {day}")
    low, high = record["interval"]
    assert low < np.log(0.8) < high
    assert result.corrected.C_r == pytest.approx(TRUTH.C_r, rel=0.05)
    held_out = "The held-out runs (day 3) do not agree with the model"
    assert result.sentence.startswith(held_out if day == 3 else "C_r in session day 2 is ")
    assert f"C_r in session day {day} is" in result.sentence
    advice, first, *_ = next_steps(result.facts)
    assert first.startswith(f"Find out what changed in session day {day}")
    assert advice.startswith("Plan with the corrected robot")
    assert result.to_dict()["moves"] == [record]


def test_rows_of_little_weight_are_looked_at_together() -> None:
    runs = read_measurements(in_days(toy_table(3)))
    rows = np.flatnonzero((runs.tails == 4) & (runs.length > 0.1))
    assert alike(runs, runs.rows[rows]) == "N = 4, tail length = 11 cm"
    assert alike(runs, runs.rows[runs.session == 1]) == "session day 2"
    assert alike(runs, runs.rows[[0, 43, 82]]) == ""
    assert alike(runs, runs.rows[rows[:2]]) == ""


@pytest.mark.slow
def test_nothing_differs_where_nothing_did() -> None:
    assert moved_on(2).moves == ()
    assert moved_on(2).verdict == "none"


@pytest.mark.slow
def test_an_effect_in_all_sessions_is_no_move() -> None:
    with on_the_toy(few=True):
        table = in_days(toy_table(5, lengths_cm=TWO_CM, **{DRAG: 5.0}))
        result = calibrate(table, KNOWN, laws=False, progress=False)
    assert result.effects == (DRAG,)
    assert result.moves == ()


@pytest.mark.slow
def test_another_robot_is_named() -> None:
    table = of_two("robot", "day 2", C_yr=0.85 * TRUTH.C_yr)
    table["robot"] = table["robot"].where(table["robot"] == "day 2", "A").replace({"day 2": "B"})
    with on_the_toy(few=True):
        turned = in_days(table.iloc[::-1].reset_index(drop=True))
        result = calibrate(turned, KNOWN, laws=False, progress=False)
    assert result.effects == ()
    (move,) = result.facts["moves"]
    assert re.search(r"on specimen [AB] is 1", move["words"])
    assert "C_yr on specimen" in move["words"]


def _along_and_left(course: Floats) -> Floats:
    """Return the parts of a unit vector along x that are along a path and to its left, (2, n)."""
    return np.stack([np.cos(np.radians(course)), -np.sin(np.radians(course))])


@pytest.mark.parametrize(("day", "turn"), [(3, 90), (2, 90), pytest.param(1, 180, marks=pytest.mark.rest)])
def test_a_camera_that_turns_on_a_day_is_named_whether_that_day_is_held_out_or_fitted(day: int, turn: int) -> None:
    """On day 3 it is in the held-out session."""
    table = in_days(toy_table(3, lengths_cm=(5.0, 7.0, 9.0)))
    course = np.random.default_rng(0).uniform(0, 360, len(table))
    yaw, side = table["omega_yr_rad_s"].abs(), np.sign(table["omega_rpm"])
    own, (along, left) = table["R_yr_cm"] * yaw, 0.6 * _along_and_left(course - 30)  # [cm/s]
    table["R_yr_cm"] = (along + np.sqrt(own**2 - left**2)) / yaw
    table["theta_deg"] += side * np.degrees(np.arcsin(left / own))
    table["course_deg"] = course + turn * (table["session"] == f"day {day}")
    result = calibrated(table, few=(*CURRENT, DRAG))
    assert set(result.effects) == set(CURRENT)
    (record,) = result.facts["moves"]
    words = record["words"]
    assert (record["number"], record["where"]) == ("course_zero", f"in session day {day}")
    assert abs(record["change"]) == pytest.approx(math.radians(turn), abs=0.2)
    assert words.startswith(f"zero of the course in session day {day} is")
    stated = re.search(r"is ([\d.]+) ° \(", words)
    assert stated
    assert float(stated[1]) == pytest.approx(math.degrees(abs(record["change"])), rel=0.05)


@pytest.mark.rest
@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured tables are not on this machine")
@pytest.mark.parametrize(
    ("name", "effects", "said"),
    [
        ("bench-c.csv", (), ["C_r in session day3 is 20 %"]),
        ("bench-d.csv", (), ["C_yr since session B1", "E (Young's modulus) since session B1"]),
        ("bench-e.csv", CURRENT, ["Zero of the course in session day3 is 89"]),
    ],
)
def test_what_moved_on_a_bench_is_named(name: str, effects: tuple[str, ...], said: list[str]) -> None:
    """Bubbles on day 3 (C_r 20 % lower); two robots (E 25 % higher, C_yr 15 % lower); a current, and the camera
    turned on day 3."""
    robot = load_robot(MEASURED / "bench-robot.toml")
    result = calibrate(MEASURED / name, robot, laws=False, progress=False)
    assert set(result.effects) == set(effects)
    assert all(words in result.sentence for words in said)


@pytest.mark.parametrize(("size", "moved"), [(1e-4, []), (0.3, ["zero since session round 4"])])
def test_a_number_with_a_grid_is_no_move_by_the_score_of_another(size: float, moved: list[str]) -> None:
    """A slope that differs since round 4 would be off by 100 tolerances; a zero there gains by itself or not."""
    tilt = (DIAMETER - DIAMETER.mean())[:, None]
    bend = size * ((tilt / tilt.std()) ** 2 - 1)

    def change(y: Floats, sets: Sequence[Any]) -> Floats:
        return y + np.array([p["slope"] * tilt.T + p["zero"] * bend.T for p in sets]).reshape(y.shape)

    slope = Parameter("slope", "slope", 0.0, (-9.0, 9.0), 1.0, sigma=0.02)
    zero = Parameter("zero", "zero", 0.0, (-9.0, 9.0), 1.0, sigma=1.0, grid=(0.5,), plausible=(-999.0, 999.0))
    y = np.log(TABLE["v"] * (1 + 2.1 * DIAMETER)).to_numpy()[:, None] + (2.0 * tilt + bend) * (ROUND > 2)[:, None]
    plain = hand_made(nuisances=(slope, zero), change=change, y=y)
    model = replace(plain, runs=replace(plain.runs, sigma=np.array([0.02])))
    study = Study.fitted_to(model, np.ones(len(ROUND), dtype=bool))
    base = fit(model, start_values(model), ("v1", "slope", "zero"), study.split.fitted, title="")
    assert [move.effect.name for move in find_moves(study, base)[2]] == moved
