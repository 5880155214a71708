"""Fits along bent and rough valleys: where a search is at rest, a lower minimum, and ends of intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from calibration.attribution.effects import scores
from calibration.statistics.fit import Fit, beyond_its_ends, fit, profile_intervals
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.statistical_model import Parameter, Parameters, Predict
from calibration.statistics.study import Study
from calibration.table.runs import Runs
from common.arrays import Floats
from tests.calibration.statistics.test_fit import NOISE, runs_of

COUNT = 96
ALL = np.ones(COUNT, dtype=bool)
PRIOR = 2.0
RISE = 3.841459  # of the deviance, at the ends of a 95 % interval


@dataclass(frozen=True)
class BentValley:
    """One output tells b + bend (a − 1)², another a function of a, in σ of all runs; a has a prior."""

    runs: Runs
    told: Callable[[Any], Any]
    bend: float = 0.0
    jump: float = 0.0  # added everywhere but at the first set of numbers that is predicted
    first: tuple[float, ...] = ()
    prior: float = PRIOR
    nuisances: tuple[Parameter, ...] = ()
    effects: tuple[Parameter, ...] = ()
    rough: BentValley | None = None

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        return (
            Parameter("a", "a", 1.0, (-9.0, 9.0), 1.0, sigma=self.prior),
            Parameter("b", "b", 0.0, (-9.0, 9.0), 1.0),
        )

    def smooth(self, sets: Sequence[Parameters]) -> Floats:
        ones = NOISE * np.where(np.arange(COUNT) // 2 % 2, 1, -1)
        return np.array([
            np.stack([100 * (p["b"] + self.bend * (p["a"] - 1) ** 2) * ones,
                      self.told(p["a"]) / np.sqrt(COUNT) * ones, 0 * ones], -1)
            for p in sets
        ])  # fmt: skip

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        rough = np.array([0.0 if (p["a"], p["b"]) == self.first else self.jump for p in sets])
        ripple = np.where(np.arange(COUNT) % 2, 1, -1)[:, None] * np.array([0.0, 0.0, NOISE])
        return self.smooth(sets) + rough[:, None, None] * ripple

    def linearised(self, at: Parameters, along: Sequence[Parameter], **_: Any) -> Predict:
        jump = self.predict([at])[0] - self.smooth([at])[0]
        return lambda sets: self.smooth(sets) + jump


def model_of(told: Callable[[Any], Any], **changes: Any) -> BentValley:
    """Make a model whose data are those of a true a with told(a) = 0."""
    runs = replace(
        runs_of(np.zeros((COUNT, 3)), session=np.arange(COUNT) // 2 % 4),
        session=np.zeros(COUNT, int),
        sigma=np.full(3, NOISE),
    )
    return BentValley(runs, told, **changes)


def fitted_at(model: BentValley, a: float, b: float = 0.0) -> Fit:
    return fit(model, {"a": a, "b": b}, ("a", "b"), ALL, title="")


@pytest.mark.parametrize(("away", "converged"), [(0.5, True), (1.6, True), (3.0, False)])
def test_a_search_that_no_step_improves_has_converged_unless_much_is_promised(
    away: float, converged: bool
) -> None:
    """Near the minimum each step meets a jump, which is larger than what is left to gain."""
    model = model_of(lambda a: 10 * (a - 1), jump=0.5, first=(1 + away / 10, 0.0))
    fitted = fitted_at(model, 1 + away / 10)
    assert fitted.parameters["a"] == 1 + away / 10
    assert fitted.converged is converged


def test_a_lower_minimum_is_found_at_the_end_of_what_is_determined_worst() -> None:
    """A narrow minimum near a = 0.1 lies beside that of data and prior, near 1.3."""
    model = model_of(lambda a: 2 - a - 1.2 * np.exp(-((a / 0.3) ** 2)), bend=0.5, prior=0.7)
    nearest = fitted_at(model, 0.1)
    assert nearest.parameters["a"] == pytest.approx(0.1, abs=0.1)
    lowest = beyond_its_ends(nearest, ALL)
    assert lowest.parameters["a"] == pytest.approx(1.33, abs=0.03)  # of (2 − a)² + (a − 1)² / 0.7²
    assert lowest.deviance < nearest.deviance
    assert beyond_its_ends(lowest, ALL).parameters == lowest.parameters


def test_intervals_along_a_bent_valley_are_those_of_the_deviance_with_all_else_refitted() -> None:
    """The reference has b in closed form, for each a."""

    def told(a: float) -> float:
        return float(5.0 * (np.exp(0.4 * (a - 1)) - 1))

    def deviance(a: float) -> float:  # the best b takes all of the first output
        return told(a) ** 2 + ((a - 1) / PRIOR) ** 2

    model = model_of(told, bend=3.0)
    fitted = fitted_at(model, 1.0)
    low, high = profile_intervals(model, fitted, ALL)["a"]
    ends = brentq(lambda a: deviance(a) - RISE, -8, 1), brentq(lambda a: deviance(a) - RISE, 1, 8)
    assert (low, high) == pytest.approx(ends, abs=0.1)
    assert fitted.interval("a") != pytest.approx(ends, abs=0.1)  # the covariance says something else


def test_an_end_at_which_the_deviance_is_no_parabola_is_found_by_further_fits() -> None:
    """The covariance puts it where the deviance has risen by more than twice as much as it should."""

    def told(a: float) -> float:
        return float(2.5 * (np.exp(0.8 * (a - 1)) - 1))

    model = model_of(told, bend=3.0)
    fitted = fitted_at(model, 1.0)
    end = brentq(lambda a: told(a) ** 2 + ((a - 1) / PRIOR) ** 2 - RISE, 1, 8)
    assert told(fitted.interval("a")[1]) ** 2 > 2 * RISE
    assert profile_intervals(model, fitted, ALL)["a"][1] == pytest.approx(end, abs=0.05)
    assert profile_intervals(model, fitted, ALL, in_valleys=False)["a"][1] != pytest.approx(end, abs=0.05)


@pytest.mark.parametrize("far", [False, True])
def test_a_fit_is_scored_where_it_ended_unless_it_is_far_above_the_noise(far: bool) -> None:
    """Where it is far, the rough model says what is missing; that a search has not converged is no reason."""
    model = model_of(lambda a: 10 * (a - 1))
    y = model.runs.y + far * 3 * NOISE * np.where(np.arange(COUNT) % 2, 1, -1)[:, None]
    model = replace(model, runs=replace(model.runs, y=y))
    model = replace(model, rough=model)
    ended = replace(fitted_at(model, 1.2), converged=False)
    assert ended.far is far
    study, none = Study.fitted_to(model, ALL, draws=50), Directions.plain(np.empty((COUNT, 3, 0)))
    of_the_fit = examine_residual(study, ended, none)
    misfit, at = scores(study, ended, (), none, of_the_fit)
    assert (at is ended) is not far
    assert (misfit is of_the_fit) is not far
