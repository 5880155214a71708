"""A share of runs with a larger variance: its estimate, and the weights of the runs."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.statistics.contaminated_normal import estimate
from calibration.statistics.statistical_model import repeat_covariance
from sim.arrays import Flags, Floats, Integers

SCATTER = 0.025


def residuals(
    seed: int, *, share: float = 0.0, repeats: int = 2, conditions: int = 72, lack: float = 0.0
) -> tuple[Floats, Integers, Flags]:
    """Draw residuals of five outputs; a share of the runs is off by 10 to 30 %, in one output or in all."""
    rng = np.random.default_rng(seed)
    condition = np.repeat(np.arange(conditions), repeats)
    noise = SCATTER * rng.normal(size=(len(condition), 5))
    bad = rng.random(len(condition)) < share
    for run in np.flatnonzero(bad):
        outputs = slice(None) if rng.random() < 0.5 else [rng.integers(5)]
        noise[run, outputs] += rng.uniform(0.1, 0.3) * rng.choice((-1, 1))
    return noise + SCATTER * lack * rng.normal(size=(conditions, 5))[condition], condition, bad


def stated(run: Floats) -> float:
    return float(np.sqrt(np.trace(run) / len(run)))


@pytest.mark.parametrize("lack", [0.0, 2.0, 10.0])
@pytest.mark.parametrize("repeats", [2, 3])
def test_normal_noise_has_one_distribution(repeats: int, lack: float) -> None:
    """However far whole conditions are from the model."""
    for seed in range(12):
        residual, condition, _ = residuals(seed, repeats=repeats, lack=lack)
        assert estimate(residual, condition) is None


@pytest.mark.parametrize(("share", "repeats"), [(0.02, 2), (0.05, 2), (0.10, 2), (0.05, 3)])
def test_mistracked_runs_do_not_raise_the_noise(share: float, repeats: int) -> None:
    plain, weighted = [], []
    for seed in range(12):
        residual, condition, bad = residuals(seed, share=share, repeats=repeats, conditions=144 // repeats)
        noise = estimate(residual, condition)
        weight = np.ones(len(bad)) if noise is None else noise.weights(residual, condition)
        plain.append(stated(repeat_covariance(residual, condition)))
        weighted.append(stated(repeat_covariance(residual, condition, np.sqrt(weight))))
        assert weight[~bad].mean() > 0.95
    assert np.mean(plain) > 1.25 * SCATTER
    assert np.mean(weighted) == pytest.approx(SCATTER, rel=0.12)


def test_the_run_that_is_farther_from_the_model_loses_its_weight() -> None:
    residual, condition, _ = residuals(3)
    residual[20::40] += 0.2  # the first of two repeats
    noise = estimate(residual, condition)
    assert noise is not None
    weight = noise.weights(residual, condition)
    assert (weight[20::40] < 0.2).all()
    assert (weight[21::40] > 0.8).all()
    assert noise.spread > 1


def test_a_departure_of_whole_conditions_costs_no_weight() -> None:
    """An effect that acts on a few conditions only, beside runs that were mis-tracked."""
    residual, condition, bad = residuals(5, share=0.05)
    local = condition % 12 == 0
    residual[local] += 0.1
    noise = estimate(residual, condition)
    assert noise is not None
    assert noise.weights(residual, condition)[local & ~bad].mean() > 0.9


def test_the_order_of_the_runs_does_not_matter() -> None:
    residual, condition, _ = residuals(7, share=0.05)
    order = np.random.default_rng(0).permutation(len(condition))
    one, other = estimate(residual, condition), estimate(residual[order], condition[order])
    assert one is not None
    assert other is not None
    assert other.run == pytest.approx(one.run, rel=1e-6, abs=1e-12)
    weights = one.weights(residual, condition)
    assert other.weights(residual[order], condition[order]) == pytest.approx(weights[order], abs=1e-4)
