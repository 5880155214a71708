"""A fit with weights of the runs: those that were mis-tracked count less, in the fit, its tests and its errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import binom

from calibration.statistics.fit import fit
from calibration.statistics.held_out import error_interval, errors
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.statistical_model import Parameter, Parameters, Runs, start_values
from calibration.statistics.study import Study, middle_session
from calibration.statistics.weighted_fit import (
    caveat_of_weights,
    fit_weighted,
    noise_of_any_run,
    rows_of_little_weight,
)
from sim.arrays import Floats

COUNT, NOISE = 192, 0.025
TRUTH = {"a": 2.0, "b": 0.5}


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
        return np.asarray(sum(parameters[n] * s for n, s in slopes.items())), np.stack(
            [slopes[n] for n in names], -1
        )


def line(seed: int, *, mistracked: float = 0.0) -> tuple[Line, Floats]:
    """Make two repeats of 96 conditions in four sessions; with what was added to each run."""
    rng = np.random.default_rng(seed)
    half = np.arange(COUNT) // 2
    runs = Runs(
        y=np.zeros((COUNT, 3)), outputs=("x", "y", "z"), condition=half, session=half % 4,
        session_names=tuple("1234"),
        inputs=(half[:, None] + 0.5) / COUNT * 2, input_names=("x",), rows=np.arange(COUNT) + 1, excluded=(),
        caveats=(),
    )  # fmt: skip
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


def test_p_values_with_mistracked_runs_are_spread_evenly() -> None:
    p_values = []
    for seed in range(30):
        model, _ = line(seed, mistracked=0.05)
        study, fitted = fit_weighted(study_of(model, seed), start_values(model))
        none = Directions.plain(np.empty((*model.runs.y.shape, 0)))
        p_values.append(examine_residual(study, fitted, none).p_value)
    assert np.mean(np.array(p_values) < 0.25) < 0.5
    assert np.mean(np.array(p_values) > 0.5) > 0.25


def test_runs_of_little_weight_are_named() -> None:
    assert caveat_of_weights((), 96) == ()
    (one,) = caveat_of_weights((7,), 96)
    assert one.startswith("1 of 96 runs has a weight below one half (row 7)")
    (many,) = caveat_of_weights(tuple(range(1, 15)), 96)
    assert many.startswith("14 of 96 runs have a weight below one half (rows 1, 2, ")
    assert "10 and 4 more" in many


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
