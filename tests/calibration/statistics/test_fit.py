"""Fits: their weights where runs were mis-tracked, the noise that is left, and where their search ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import pytest
from scipy.stats import binom

from calibration.statistics.fit import Fit, fit
from calibration.statistics.gls import repeat_covariance
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.statistical_model import Parameter, Parameters, Runs, start_values
from calibration.statistics.study import Study, error_interval, errors, middle_session
from calibration.statistics.weights import (
    caveat_of_weights,
    estimate,
    fit_weighted,
    noise_of_any_run,
    rows_of_little_weight,
)
from sim.arrays import Flags, Floats, Integers

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
        return np.array([self.derivatives(p, ["a", "b"])[0] for p in sets])

    def derivatives(
        self, parameters: Parameters, names: Sequence[str], *, title: str = "", quick: bool = False
    ) -> tuple[Floats, Floats]:
        x = self.runs.inputs
        slopes = {"a": np.stack([x[:, 0], 1 - x[:, 0], x[:, 0]], -1), "b": np.stack([x[:, 0] ** 2] * 3, -1)}
        table = np.array([slopes[n] for n in names]).reshape(-1, *self.runs.y.shape)
        return np.asarray(sum(parameters[n] * s for n, s in slopes.items())), np.moveaxis(table, 0, -1)


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


def test_without_mistracked_runs_the_fit_is_the_plain_one() -> None:
    study = study_of(line(0)[0])
    again, fitted = fit_weighted(study, start_values(study.model))
    plain = fit(study.model, start_values(study.model), ("a", "b"), study.split.fitted, title="")
    assert again is study
    assert fitted.parameters == plain.parameters
    assert (fitted.covariance == plain.covariance).all()
    assert rows_of_little_weight(again) == ()
    assert noise_of_any_run(again, fitted.noise).run == pytest.approx(fitted.noise.run)
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
        plain_noises.append(float(np.sqrt(np.trace(plain.noise.run) / 3)))
        noise = float(np.sqrt(np.trace(fitted.noise.run) / 3))
        noises.append(noise)
        held_out.append(errors(study.model.runs, fitted.prediction, study.split.test)[0] / noise)
        assert np.trace(noise_of_any_run(study, fitted.noise).run) > 1.5 * np.trace(fitted.noise.run)
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
    assert one is not None
    assert other is not None
    weights = one.weights(residual, condition)
    assert weights[local & ~bad].mean() > 0.9
    assert other.run == pytest.approx(one.run, rel=1e-6, abs=1e-12)
    assert other.weights(residual[order], condition[order]) == pytest.approx(weights[order], abs=1e-4)


FEW = 60


@dataclass
class Valley:
    """One output y = x + curvature (b − a²) + 0.01 a: a narrow bent valley, along which a fit creeps."""

    offset: float  # of the data, which no parameter can remove
    calls: list[float] = field(default_factory=list)

    coefficients = (Parameter("a", "a", 3.0, (-50.0, 50.0), 1.0), Parameter("b", "b", 9.0, (-5e3, 5e3), 1.0))
    nuisances: tuple[Parameter, ...] = ()
    effects: tuple[Parameter, ...] = ()
    untestable: dict[str, str] = field(default_factory=dict)

    @property
    def runs(self) -> Runs:
        half = np.arange(FEW) // 2
        y = 0.1 * np.random.default_rng(3).normal(size=(FEW, 2))
        y[:, 0] += self.offset * np.where(half % 2, 1.0, -1.0)
        return runs_of(y, session=half % 3)

    def predict(self, sets: list[Parameters], *, title: str = "") -> Floats:
        return np.array([self._at(p["a"], p["b"]) for p in sets])

    def derivatives(
        self, parameters: Parameters, names: list[str], *, title: str = "", quick: bool = False
    ) -> tuple[Floats, Floats]:
        a, b = parameters["a"], parameters["b"]
        self.calls.append(a)
        slopes = {"a": np.array([0.02 * a, -20 * a]), "b": np.array([0.0, 10.0])}
        table = np.array([np.tile(slopes[name], (FEW, 1)) for name in names]).reshape(-1, FEW, 2)
        return self._at(a, b), np.moveaxis(table, 0, -1)

    def _at(self, a: float, b: float) -> Floats:
        return np.tile([0.01 * a**2, 10 * (b - a**2)], (FEW, 1))


def valley_fit(model: Valley, target: float = np.inf) -> Fit:
    used = np.ones(FEW, dtype=bool)
    return fit(model, {"a": 3.0, "b": 9.0}, ("a", "b"), used, target=target, title="")  # type: ignore[arg-type]


def test_the_search_of_a_fit_ends_where_it_cannot_reach_the_noise_and_nowhere_else() -> None:
    free, ended = Valley(5.0), Valley(5.0)
    target = Study.fitted_to(free, np.ones(FEW, bool)).noise_at_most(2)  # type: ignore[arg-type]
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
