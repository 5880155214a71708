"""The linear models of a search against generalised least squares with dense matrices."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from calibration.laws.search import LinearModels
from calibration.linear.gls import UNKNOWN_RATIO, Noise, Regression, repeat_covariance
from common.arrays import Floats
from tests.oracles.dense_noise import dense_covariance

SESSION = np.repeat([0, 1, 2, 3], [6, 8, 6, 4])
CONDITION = np.arange(len(SESSION)) // 2
OUTPUTS, PLACES, COLUMNS = 3, 4, 3
MODELS = [(place, chosen) for place in range(PLACES) for chosen in ((0,), (0, 1), (0, 2), (0, 1, 2))]
PRECISION = np.array([0.0, 0.0, 4.0])


def design(session: np.ndarray = SESSION) -> LinearModels:
    rng = np.random.default_rng(0)
    absorbed = rng.normal(size=(len(SESSION), OUTPUTS, len(PRECISION)))
    columns = rng.normal(size=(len(SESSION), OUTPUTS, PLACES, COLUMNS))
    columns += 2 * rng.normal(size=(session.max() + 1, 1, PLACES, COLUMNS))[session]
    return LinearModels(absorbed, PRECISION, columns, MODELS, session, CONDITION)


def residuals(count: int, *, share: float = 0.3, seed: int = 1) -> Floats:
    rng = np.random.default_rng(seed)
    shape = (count, len(SESSION), OUTPUTS)
    sessions = rng.normal(scale=math.sqrt(share), size=(count, SESSION.max() + 1, OUTPUTS))[:, SESSION]
    return np.asarray((rng.normal(size=shape) + sessions) @ np.array([[1.0, 0.4, 0], [0, 0.8, 0.1], [0, 0, 1.3]]))


def dense(residual: Floats, share: Floats, table: Floats) -> tuple[float, Floats]:
    """Fit columns (n, k, q) with ρ by the definitions; return the deviance and all weights."""
    run = repeat_covariance(residual, CONDITION)
    flat = table.reshape(residual.size, -1)
    covariance = dense_covariance(Noise(run, share), SESSION)
    inverse = np.linalg.inv(covariance)
    normal = flat.T @ inverse @ flat + np.diag(np.r_[PRECISION, np.zeros(flat.shape[1] - len(PRECISION))])
    toward = flat.T @ inverse @ residual.ravel()
    weights = np.linalg.solve(normal, toward)
    determinant = np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(np.kron(np.eye(len(SESSION)), run))[1]
    deviance = residual.ravel() @ inverse @ residual.ravel() - toward @ weights + determinant
    return float(deviance), weights


@pytest.mark.slow
def test_gains_and_weights_are_those_of_dense_matrices() -> None:
    """In the noise that a fit with all columns of the place leaves."""
    models, residual = design(), residuals(60)
    fits = models.fit(residual)
    single = design(np.zeros_like(SESSION)).fit(residual[:2])  # of a single session ρ is the largest
    assert single.base_session_ratio == pytest.approx(UNKNOWN_RATIO)
    absorbed = models.design.columns[..., : len(PRECISION)]
    for b, one in enumerate(residual[:2]):
        alone = models.fit(one[None])
        np.testing.assert_allclose(fits.gain[b], alone.gain[0], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(fits.weights[b], alone.weights[0], rtol=1e-7, atol=1e-12)
        without = dense(one, fits.base_session_ratio[b], absorbed)[0]
        shares = [
            Regression(every, PRECISION, SESSION, None, CONDITION).products(one).solve(passes=3).session_ratio
            for place in range(PLACES)
            for every in [np.concatenate([absorbed, models.columns[:, :, place]], -1)]
        ]
        for m, (place, chosen) in enumerate(MODELS):
            table = np.concatenate([absorbed, models.columns[:, :, place, list(chosen)]], -1)
            deviance, weights = dense(one, shares[place], table)
            gain = without - deviance - len(chosen) * math.log(one.size)
            assert fits.gain[b, m] == pytest.approx(gain, abs=1e-4)
            np.testing.assert_allclose(fits.weights[b, m, list(chosen)], weights[-len(chosen) :], rtol=1e-4)
            absent = [j for j in range(COLUMNS) if j not in chosen]
            assert not fits.weights[b, m, absent].any()


@pytest.mark.parametrize("seed", range(3))
def test_what_others_explain_gains_nothing(seed: int) -> None:
    """A column is a sum of others up to rounding, so that the matrix of the model has no inverse."""
    rng = np.random.default_rng(seed)
    absorbed = rng.normal(size=(len(SESSION), OUTPUTS, len(PRECISION)))
    absorbed[..., 1] = absorbed[..., 0] + 1e-4 * absorbed[..., 1]
    columns = 1e40 * rng.normal(size=(len(SESSION), OUTPUTS, PLACES, COLUMNS))
    columns[..., 1] = 0.3 * columns[..., 0] + 1e40 * absorbed[..., :1]
    columns[..., 2] = 1e40 * absorbed[..., 1:2]
    columns[..., 3, 2] = 0.0
    with np.errstate(all="raise"):
        fits = LinearModels(absorbed, PRECISION, columns, MODELS, SESSION, CONDITION).fit(residuals(3))
    for table in (fits.gain, fits.weights):
        assert np.isfinite(table).all()
    price = math.log(len(SESSION) * OUTPUTS)
    for place, further in itertools.product(range(PLACES), (1, 2)):
        alone, repeated = (MODELS.index((place, chosen)) for chosen in ((0,), (0, further)))
        assert (fits.gain[:, repeated] <= fits.gain[:, alone] - price + 0.2).all()
