"""Fits: what is held out, weights of mis-tracked runs, the noise that is left, and where a search ends."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom

from calibration.attribution import effects
from calibration.linear.gls import repeat_covariance
from calibration.statistics import budget
from calibration.statistics.budget import (
    Work,
    count_predictions,
    limited,
    limited_as_one,
    seconds_left,
    skipped,
    spent,
    stopped_by_interrupt,
    work_done,
)
from calibration.statistics.fit import Fit, fit
from calibration.statistics.forward import derivatives
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.statistical_model import Parameter, Parameters, Predict, start_values
from calibration.statistics.study import (
    Study,
    error_interval,
    errors,
    find_outliers,
    middle_session,
)
from calibration.statistics.weights import (
    caveat_of_weights,
    estimate,
    fit_weighted,
    noise_of_any_run,
    rows_of_little_weight,
)
from calibration.table.excluded import Excluded, caveat_of_excluded, count_of_rows, summary_of_excluded
from calibration.table.runs import Runs
from calibration.words.render import next_steps
from common.arrays import Flags, Floats, Integers
from tests.calibration.own_model.test_faults import hand_made
from tests.calibration.toy_tables import DRAG, FEW_CANDIDATES, calibrated, effect, toy_table

COUNT, NOISE = 192, 0.025
TRUTH = {"a": 2.0, "b": 0.5}


def runs_of(y: Floats, session: Integers) -> Runs:
    """Pairs of repeats at inputs from 0 to 1."""
    half = np.arange(len(y)) // 2
    return Runs(
        y=y, outputs=tuple("xyz"[: y.shape[1]]), condition=half, session=session,
        session_names=tuple(map(str, range(session.max() + 1))), inputs=(half[:, None] + 0.5) / len(y) * 2,
        input_names=("x",), rows=np.arange(len(y)) + 1, excluded=(), caveats=(),
    )  # fmt: skip


@dataclass(frozen=True)
class Line:
    """Three outputs that are linear in two coefficients."""

    runs: Runs
    coefficients: tuple[Parameter, ...] = (
        Parameter("a", "a", 1.0, (-9.0, 9.0), 1.0),
        Parameter("b", "b", 0.0, (-9.0, 9.0), 1.0),
    )
    nuisances: tuple[Parameter, ...] = ()
    effects: tuple[Parameter, ...] = ()

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        x = self.runs.inputs[:, 0]
        a, b = np.stack([x, 1 - x, x], -1), np.stack([x**2] * 3, -1)
        return np.array([p["a"] * a + p["b"] * b for p in sets])

    def linearised(self, at: Parameters, along: Sequence[Parameter], **_: Any) -> Predict:
        return self.predict


def line(seed: int, *, mistracked: float = 0.0) -> tuple[Line, Floats]:
    """Make two repeats of 96 conditions in four sessions; with what was added to each run."""
    rng = np.random.default_rng(seed)
    runs = runs_of(np.zeros((COUNT, 3)), session=np.arange(COUNT) // 2 % 4)
    off = rng.uniform(0.1, 0.3, size=COUNT) * (rng.random(COUNT) < mistracked)
    exact = Line(runs).predict([TRUTH])[0]
    y = exact + NOISE * rng.normal(size=(COUNT, 3)) + off[:, None] * np.array([1.0, 0.0, 0.0])
    return Line(replace(runs, y=y)), off


def study_of(model: Line, seed: int = 0) -> Study:
    return Study.fitted_to(model, ~middle_session(model.runs), seed=seed, draws=100)


class LineWithGaps(Line):
    """The same where some runs lack outputs."""

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        return self.runs.compared(super().predict(sets))


def test_a_run_with_a_gap_counts_by_what_was_measured_alone() -> None:
    rng = np.random.default_rng(6)
    runs = line(6)[0].runs
    y = runs.y + NOISE * rng.normal(size=(COUNT, 1))  # correlated
    gaps = rng.random((COUNT, 3)) < 0.05
    whole = ~gaps.any(1)
    pairs = np.repeat(whole[::2] & whole[1::2], 2)
    S = repeat_covariance(y[pairs], runs.condition[pairs])
    completion = np.eye(3) * ~gaps[:, :, None]
    for T, gap in zip(completion, gaps, strict=True):
        T[np.ix_(gap, ~gap)] = S[np.ix_(gap, ~gap)] @ np.linalg.inv(S[np.ix_(~gap, ~gap)])
    rows, fits = np.ones(COUNT, dtype=bool), []
    for standing in (0.0, 7.0):  # what stands in a gap does not matter
        model = LineWithGaps(replace(runs, y=np.where(gaps, standing, y), completion=completion))
        fits.append(fit(model, start_values(model), ("a", "b"), rows, title=""))
        assert fits[-1].noise.run_covariance == pytest.approx(S)  # of whole runs
        normal = fits[-1].products(model.runs, rows).at(0.0)
        J = derivatives(Line(runs), TRUTH, ("a", "b"))[1]
        measured = [(J[i][~g], np.linalg.inv(S[np.ix_(~g, ~g)])) for i, g in enumerate(gaps)]
        assert normal[:2, :2] == pytest.approx(sum(j.T @ inverse @ j for j, inverse in measured))
        assert model.runs.values(rows) == (~gaps).sum()
        each = errors(model.runs, fits[-1].prediction, rows)[1]
        left = np.where(gaps, np.nan, y - Line(runs).predict([fits[-1].parameters])[0])
        assert list(each.values()) == pytest.approx(np.sqrt(np.nanmean(left**2, 0)))
    assert fits[0].parameters == pytest.approx(fits[1].parameters)
    assert fits[0].parameters == pytest.approx(TRUTH, abs=0.03)


def test_noise_alone_is_no_misfit_where_runs_have_gaps() -> None:
    """The drawn noise has the same gaps: with a tenth of the values missing p-values stay uniform."""
    p_values = []
    for seed in range(24):
        runs = line(seed)[0].runs
        gaps = np.random.default_rng(seed).random((COUNT, 3)) < 0.15
        gaps[: COUNT // 3] = False
        model = LineWithGaps(replace(runs, completion=np.eye(3) * ~gaps[:, :, None]))
        study = study_of(model, seed)
        fitted = fit(model, start_values(model), ("a", "b"), study.split.fitted, title="")
        none = Directions.plain(np.empty((COUNT, 3, 0)))
        p_values.append(examine_residual(study, fitted, none).p_value)
    assert 0.25 < np.mean(p_values) < 0.75
    assert np.less(p_values, 0.05).sum() <= 5


def test_without_mistracked_runs_the_fit_is_the_plain_one() -> None:
    study = study_of(line(0)[0])
    again, fitted = fit_weighted(study, start_values(study.model))
    plain = fit(study.model, start_values(study.model), ("a", "b"), study.split.fitted, title="")
    assert again is study
    assert fitted.parameters == plain.parameters
    assert (fitted.covariance == plain.covariance).all()
    assert rows_of_little_weight(again) == ()
    assert noise_of_any_run(again, fitted.noise).run_covariance == pytest.approx(fitted.noise.run_covariance)
    assert caveat_of_weights((), 96) == ()
    (one,), (many,) = caveat_of_weights((7,), 96), caveat_of_weights(tuple(range(1, 15)), 96)
    assert one.startswith("1 of 96 runs has a weight below one half (row 7)")
    assert many.startswith("14 of 96 runs have a weight below one half (rows 1, 2, ")
    assert caveat_of_weights((1, 2, 3), 96, "N = 4")[0].endswith("All of them have N = 4: check that")
    assert "10 and 4 more" in many


def test_mistracked_runs_do_not_raise_the_noise() -> None:
    """All of them are off to one side."""
    found, hidden, plain_noises = 0, 0, []
    plain_errors, weighted_errors, inside, held_out, noises = [], [], [], [], []
    for seed in range(10):
        model, off = line(seed, mistracked=0.08)
        study, fitted = fit_weighted(study_of(model), start_values(model))
        plain = fit(model, start_values(model), ("a", "b"), study.split.fitted, title="")
        plain_errors.append(plain.parameters["a"] - TRUTH["a"])
        weighted_errors.append(fitted.parameters["a"] - TRUTH["a"])
        inside += [low <= TRUTH[n] <= high for n in TRUTH for low, high in [fitted.interval(n)]]
        little = np.array(rows_of_little_weight(study), dtype=int) - 1
        assert (off[little] > 0).mean() > 0.9
        found, hidden = found + len(little), hidden + int((off > 0).sum())
        plain_noises.append(float(np.sqrt(np.trace(plain.noise.run_covariance) / 3)))
        noise = float(np.sqrt(np.trace(fitted.noise.run_covariance) / 3))
        noises.append(noise)
        held_out.append(errors(study.model.runs, fitted.prediction, study.split.test)[0] / noise)
        assert np.trace(noise_of_any_run(study, fitted.noise).run_covariance) > 1.5 * np.trace(
            fitted.noise.run_covariance
        )
    assert found > 0.6 * hidden
    assert np.linalg.norm(weighted_errors) < np.linalg.norm(plain_errors)
    assert np.mean(plain_noises) > 1.4 * NOISE
    assert np.mean(inside) >= 0.8
    assert np.mean(noises) == pytest.approx(NOISE, rel=0.1)
    assert np.mean(held_out) == pytest.approx(1, abs=0.15)


@pytest.mark.slow
def test_p_values_with_mistracked_runs_are_spread_evenly() -> None:
    p_values = []
    for seed in range(30):
        model, _ = line(seed, mistracked=0.05)
        study, fitted = fit_weighted(study_of(model, seed), start_values(model))
        none = Directions.plain(np.empty((*model.runs.y.shape, 0)))
        p_values.append(examine_residual(study, fitted, none).p_value)
    assert np.mean(np.array(p_values) < 0.25) < 0.5
    assert np.mean(np.array(p_values) > 0.5) > 0.25


@pytest.mark.parametrize(("count", "most"), [(3, 3), (8, 7)])
def test_the_interval_of_the_held_out_error_holds_95_percent_of_the_draws(count: int, most: int) -> None:
    """Few conditions, one of 3 or 4 of 8 in error by 1: the number of those drawn is binomial."""
    data = line(0)[0].runs.subset(np.arange(count))
    data = replace(data, condition=np.arange(count))
    wrong = np.arange(count) < (1 if count == 3 else 4)
    prediction = data.y + wrong[:, None]
    share = float(wrong.mean())
    least, largest = binom.ppf([0.025, 0.975], count, share)
    assert largest == most
    low, high = error_interval(data, prediction, np.ones(count, bool), seed=0)
    assert (low, high) == pytest.approx((np.sqrt(least / count), np.sqrt(largest / count)))


def residuals(
    seed: int, *, share: float = 0.0, repeats: int = 2, conditions: int = 72, lack: float = 0.0
) -> tuple[Floats, Integers, Flags]:
    """Draw residuals of five outputs; a share of the runs is off by 10 to 30 %, in one output or in all."""
    rng = np.random.default_rng(seed)
    condition = np.repeat(np.arange(conditions), repeats)
    noise = NOISE * rng.normal(size=(len(condition), 5))
    bad = rng.random(len(condition)) < share
    for run in np.flatnonzero(bad):
        outputs = slice(None) if rng.random() < 0.5 else [rng.integers(5)]
        noise[run, outputs] += rng.uniform(0.1, 0.3) * rng.choice((-1, 1))
    return noise + NOISE * lack * rng.normal(size=(conditions, 5))[condition], condition, bad


@pytest.mark.parametrize("repeats", [2, 3])
def test_normal_noise_has_one_distribution(repeats: int) -> None:
    """However far whole conditions are from the model."""
    for lack, seed in product((0.0, 2.0, 10.0), range(6)):
        residual, condition, _ = residuals(seed, repeats=repeats, lack=lack)
        assert estimate(residual, condition) is None


def test_a_departure_of_whole_conditions_costs_no_weight_in_any_order_of_the_runs() -> None:
    """An effect that acts on a few conditions only, beside runs that were mis-tracked."""
    residual, condition, bad = residuals(5, share=0.05)
    local = condition % 12 == 0
    residual[local] += 0.1
    order = np.random.default_rng(0).permutation(len(condition))
    one, other = estimate(residual, condition), estimate(residual[order], condition[order])
    weights = one.weights(residual, condition)
    assert weights[local & ~bad].mean() > 0.9
    assert other.run == pytest.approx(one.run, rel=1e-6, abs=1e-12)
    assert other.weights(residual[order], condition[order]) == pytest.approx(weights[order], abs=1e-4)


FEW = 60


class Valley:
    """Outputs 0.01 a² and 10 (b − a²): a narrow bent valley, along which a fit creeps."""

    coefficients = (Parameter("a", "a", 3.0, (-50.0, 50.0), 1.0), Parameter("b", "b", 9.0, (-5e3, 5e3), 1.0))
    nuisances = effects = ()

    def __init__(self, offset: float):
        """Take an offset of the data, which no parameter can remove."""
        self.calls: list[float] = []
        half = np.arange(FEW) // 2
        y = 0.1 * np.random.default_rng(3).normal(size=(FEW, 2))
        y[:, 0] += offset * np.where(half % 2, 1.0, -1.0)
        self.runs = runs_of(y, session=half % 3)

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        return np.array([np.tile([0.01 * p["a"] ** 2, 10 * (p["b"] - p["a"] ** 2)], (FEW, 1)) for p in sets])

    def linearised(self, at: Parameters, along: Sequence[Parameter], **_: Any) -> Predict:
        self.calls.append(at["a"])
        return self.predict


def valley_fit(model: Any, target: float = np.inf) -> Fit:
    return fit(model, {"a": 3.0, "b": 9.0}, ("a", "b"), np.ones(FEW, bool), target=target, title="")


def test_the_search_of_a_fit_ends_where_it_cannot_reach_the_noise_and_nowhere_else() -> None:
    free, ended = Valley(5.0), Valley(5.0)
    target = Study.fitted_to(free, np.ones(FEW, bool)).noise_at_most(2)
    best, given_up = valley_fit(free), valley_fit(ended, target)
    assert len(ended.calls) < len(free.calls)
    assert given_up.deviance == pytest.approx(best.deviance, rel=0.05)
    free, aimed = Valley(0.0), Valley(0.0)
    one, other = valley_fit(free), valley_fit(aimed, target)
    assert one.deviance < target
    assert other.parameters == one.parameters
    assert aimed.calls == free.calls


def test_noise_alone_stays_below_the_deviance_that_ends_a_search_also_with_few_repeats() -> None:
    """Of 24 conditions 12 are repeated, in five outputs: a bound without the error of S is exceeded."""
    rng, condition = np.random.default_rng(0), np.r_[np.arange(24), np.arange(12)]
    runs = replace(runs_of(np.zeros((36, 5)), session=np.zeros(36, int)), condition=condition)
    study = Study.fitted_to(Line(runs), np.ones(36, bool))
    most, deviances = study.noise_at_most(5), []
    for _ in range(2000):
        y = rng.normal(size=(36, 5))
        left = y - y.mean(0)
        deviances.append((left @ np.linalg.inv(repeat_covariance(y, condition)) * left).sum())
    values = study.values - 5
    assert np.mean(np.array(deviances) > values + 6 * np.sqrt(2 * values)) > 0.2
    assert np.mean(np.array(deviances) > most) < 0.01
    assert most < 4 * np.mean(deviances)


@pytest.mark.parametrize(
    ("sizes", "held_out"),
    [
        ([32] * 4, [2]),
        ([7] * 12, [6]),
        ([1] * 96, [44, 45, 46, 47, 48, 49, 50, 51]),  # one run, whose error says nothing, used to be held out
        ([30, 30, 2, 30, 30], [1, 2]),
    ],
    ids=["four", "twelve", "of one run each", "a short one in the middle"],
)
def test_neighbours_join_short_sessions(sizes: list[int], held_out: list[int]) -> None:
    session = np.repeat(np.arange(len(sizes)), sizes)
    held = middle_session(runs_of(np.zeros((len(session), 1)), session))
    assert sorted(set(session[held].tolist())) == held_out
    assert not set(session[held]) & set(session[~held])


def repeats_of(condition: Any, seed: int) -> Any:
    """Runs of some conditions (n,), with two outputs of unit noise."""
    y = np.random.default_rng(seed).normal(size=(len(condition), 2))
    return SimpleNamespace(
        y=y, condition=condition, session=0 * condition, row_name="row {}".format, outputs=("R_yr", "theta"),
        unit_checked={}, trace=None, gaps=np.zeros(y.shape, dtype=bool),
    )  # fmt: skip


def test_a_condition_that_scatters_more_than_others_is_not_excluded_run_by_run() -> None:
    """Of 22 readings near the limit of an assay 16 were taken for outliers; two wrong ones among 22 are some."""
    runs = repeats_of(np.repeat(np.arange(8), 22), 0)
    runs.y[:22] *= 30.0
    runs.y[[30, 31]] += 40.0
    bad, reasons = find_outliers(runs, np.zeros_like(runs.y))
    assert np.flatnonzero(bad).tolist() == [30, 31]
    assert len(reasons) == 2


def test_runs_that_were_mistracked_are_excluded_and_clean_ones_are_not() -> None:
    pairs = np.repeat(np.arange(200), 2)
    runs, effect = repeats_of(pairs, 0), repeats_of(pairs, 1)
    mistracked = np.arange(0, 400, 40)
    assert not find_outliers(runs, np.zeros_like(runs.y))[0].any()
    runs.y[mistracked, 1] += 16.0
    bad, reasons = find_outliers(runs, np.zeros_like(runs.y))
    assert set(np.flatnonzero(bad)) <= set(mistracked)
    assert bad.sum() >= 8
    assert all(each.reason.startswith("theta is") for each in reasons)
    assert runs.y[~bad].std(0) == pytest.approx([1, 1], abs=0.12)
    effect.y[:200] += 15.0  # it changes all repeats
    assert not find_outliers(effect, np.zeros_like(effect.y))[0].any()


def test_excluded_rows_of_one_reason_are_one_line() -> None:
    sign = "has the wrong sign for its omega_rpm"
    excluded = (
        Excluded("theta_deg{} is not a finite number", "row 9", " = inf"),
        *(Excluded(f"omega_h_rpm{{}} {sign}", f"row {i}", f" = {i / 7:g}") for i in (2, 3, 5, 8)),
        *(Excluded("a copy of an earlier row{}", f"row {i} (line {i + 1})", f" (row {i - 10})") for i in (11, 12)),
        Excluded("column colour: not known, left out"),
    )
    assert summary_of_excluded(excluded, 40) == [
        f"4 of 40 rows (rows 2, 3, 5 and 1 more): omega_h_rpm {sign}",
        "2 of 40 rows (rows 11 (line 12), 12 (line 13)): a copy of an earlier row",
        "row 9: theta_deg = inf is not a finite number",
        "column colour: not known, left out",
    ]
    assert summary_of_excluded((), 40) == []
    assert count_of_rows(excluded) == 7
    assert caveat_of_excluded(excluded, 35) == ()  # a fifth
    assert caveat_of_excluded(excluded, 34)[0].startswith("7 of 34 rows (21 %) were excluded")


def test_limits_end_with_those_around_them() -> None:
    with limited(Work(1000, 1e6)) as outer:
        for limit in (Work(seconds=-1.0), Work(predictions=0)):
            with limited(limit):
                assert spent()
                assert skipped("a drag")
                assert skipped("a drag")
        assert not skipped("a couple")
        with limited(Work(), 0.5), limited_as_one():
            count_predictions(999)
            assert not spent()
            count_predictions(1)
            assert skipped("a couple")
    assert outer.not_tried == {
        "a drag": "after 1,000,000 s of processor time",
        "a couple": "after 1,000 predictions of a run",
    }
    assert not spent()


def test_one_fit_has_a_third_of_what_is_left() -> None:
    with limited(Work(1500)) as outer:
        count_predictions(100)
        with limited(Work(1500), 2 / 3, outer.began):
            with limited_as_one():
                count_predictions(299)
                assert not spent()
                count_predictions(1)
                assert spent()
            assert not spent()
            count_predictions(600)
            assert spent()
        assert not spent()


def test_the_time_to_the_limit_is_told_by_the_pace(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0.0
    monkeypatch.setattr(budget, "clock", lambda: now)
    began = work_done()
    assert seconds_left(began) == math.inf
    with limited(Work(1000, 60)):
        count_predictions(100)
        now = 2.0
        assert seconds_left(began) == pytest.approx(18)
        now = 50.0
        assert seconds_left(began) == 10


def test_a_limit_of_predictions_ends_at_the_same_place_on_a_slow_machine(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    table = toy_table(5, **{DRAG: 5.0})
    before = work_done()
    calibrated(table, few=FEW_CANDIDATES)
    limit = Work(0.7 * (work_done() - before).predictions)
    quick = calibrated(table, few=FEW_CANDIDATES, limit=limit)
    monkeypatch.setattr(budget, "clock", lambda: 1e6 * time.process_time())
    slow = calibrated(table, few=FEW_CANDIDATES, limit=limit)
    assert quick.not_tried
    assert slow.facts == quick.facts


@pytest.mark.parametrize(
    ("limit", "ended"),
    [
        (Work(predictions=2), "after 2 predictions of a run"),
        (Work(seconds=1e-9), "after 0 s of processor time"),
        (Work(), "at Ctrl-C"),
    ],
    ids=["without predictions", "without time", "interrupted"],
)
def test_a_search_that_ends_early_leaves_a_provisional_verdict(
    limit: Work, ended: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*arguments: Any, **options: Any) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        return fit(*arguments, **options)

    interrupts = limit == Work()
    if interrupts:
        monkeypatch.setattr(effects, "fit", interrupted)
    with stopped_by_interrupt():
        verdict = calibrated(toy_table(5, **{DRAG: 5.0}), few=FEW_CANDIDATES, limit=limit)
    assert verdict.verdict == "unexplained"
    assert verdict.caveats[0].startswith(f"provisional: the search ended {ended}")
    assert next_steps(verdict.facts)
    if not interrupts:
        assert any("end-over-end" in what for what in verdict.not_tried)
        assert all(c.fit is None for c in verdict.attribution.candidates)
        assert not effect().not_tried


def test_further_interrupts_and_those_outside_a_search_end_the_program() -> None:
    before = signal.getsignal(signal.SIGINT)
    with stopped_by_interrupt():
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        with limited(Work(seconds=1e6)):
            os.kill(os.getpid(), signal.SIGINT)
            assert spent()
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_steps_that_are_refused_one_after_another_get_shorter_faster() -> None:
    """Not far beyond its start the model cannot be solved quickly."""
    tried = []

    def change(y: Any, sets: Any) -> Any:
        tried.append(float(sets[0]["v1"]))
        return np.where(tried[-1] > 102.5, np.nan, y)

    model = hand_made(change=change)
    fitted = fit(model, {"v1": 100.0, "wall": 0.0}, ("v1",), np.ones(len(model.runs.y), dtype=bool), title="")
    assert 100.0 <= fitted.parameters["v1"] <= 102.5
    assert len(set(tried)) < 20


def test_derivatives_follow_predictions_where_the_model_could_not_be_solved(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They cost several predictions, and where a step is refused nobody needs them."""
    refused = []

    def noted(model: Any, at: Any, names: Sequence[Any], **options: Any) -> tuple[Floats, Floats]:
        prediction, table = derivatives(model, at, names, **options)
        if not np.isfinite(prediction).all():
            refused.append(len(names))
        return prediction, table

    monkeypatch.setattr("calibration.statistics.fit.derivatives", noted)
    model = hand_made(change=lambda y, sets: np.where(float(sets[0]["v1"]) > 102.5, np.nan, y))
    fit(model, {"v1": 100.0, "wall": 0.0}, ("v1",), np.ones(len(model.runs.y), dtype=bool), title="")
    assert len(refused) > 2
    assert sum(refused) <= 1
