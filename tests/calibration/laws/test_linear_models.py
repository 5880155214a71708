"""The linear models of a search against generalised least squares with dense matrices."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from calibration.laws.linear_models import LinearModels
from calibration.statistics.gls import SESSION_SHARE, Noise, repeat_covariance
from sim.arrays import Floats

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


def dense(models: LinearModels, residual: Floats, columns: Floats) -> tuple[float, float, Floats, Floats]:
    """Fit columns (n, k, q) by the definitions; return the deviance, ρ, all weights, their covariance."""
    run = repeat_covariance(residual, CONDITION)
    table = np.concatenate([models.absorbed, columns], -1).reshape(residual.size, -1)
    prior = np.diag(np.r_[PRECISION, np.zeros(columns.shape[-1])])
    best = None
    for share in np.expm1(np.linspace(0, math.log1p(SESSION_SHARE * 9), 200)) / 9:
        covariance = Noise(run, share).covariance(SESSION)
        inverse = np.linalg.inv(covariance)
        normal = table.T @ inverse @ table + prior
        toward = table.T @ inverse @ residual.ravel()
        weights = np.linalg.solve(normal, toward)
        independent = np.kron(np.eye(len(SESSION)), run)
        determinant = np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(independent)[1]
        deviance = float(residual.ravel() @ inverse @ residual.ravel() - toward @ weights + determinant)
        restricted = deviance + np.linalg.slogdet(normal)[1]
        if best is None or restricted < best[0]:
            best = restricted, deviance, share, weights, np.linalg.inv(normal)
    assert best is not None
    return best[1:]


@pytest.mark.slow
def test_gains_weights_and_shares_are_those_of_dense_matrices() -> None:
    models, residual = design(), residuals(60)
    fits = models.fit(residual)
    single = design(np.zeros_like(SESSION)).fit(residual[:2])  # of a single session ρ is the largest
    assert np.concatenate([single.base_share[:, None], single.share], 1) == pytest.approx(SESSION_SHARE)
    for b, one in enumerate(residual[:1]):
        alone = models.fit(one[None])
        np.testing.assert_allclose(fits.gain[b], alone.gain[0], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(fits.weights[b], alone.weights[0], rtol=1e-7, atol=1e-12)
        without = dense(models, one, np.empty((*one.shape, 0)))
        assert fits.base_share[b] == pytest.approx(without[1], abs=0.03)
        for m, (place, chosen) in enumerate(MODELS):
            deviance, share, weights, covariance = dense(models, one, models.columns[:, :, place, list(chosen)])
            gain = without[0] - deviance - len(chosen) * math.log(one.size)
            assert fits.gain[b, m] == pytest.approx(gain, abs=0.1)
            assert fits.share[b, m] == pytest.approx(share, abs=0.03)
            errors = np.sqrt(np.diag(covariance))[-len(chosen) :]
            np.testing.assert_allclose(fits.errors[b, m, list(chosen)], errors, rtol=0.03)
            np.testing.assert_allclose(
                fits.weights[b, m, list(chosen)], weights[-len(chosen) :], atol=0.05 * errors.min()
            )
            absent = [j for j in range(COLUMNS) if j not in chosen]
            assert not fits.weights[b, m, absent].any()
            assert np.isinf(fits.errors[b, m, absent]).all()


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
