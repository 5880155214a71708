"""The tests of the residual: noise from repeats and sessions, scores, and p-values."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.statistics.fit import fit
from calibration.statistics.residual_tests import Directions, _kernel, examine_residual
from calibration.statistics.statistical_model import (
    Noise,
    changes,
    features,
    inverse_root,
    least_squares,
    precisions,
    repeat_covariance,
    start_values,
    sums,
)
from calibration.statistics.study import Study, middle_session
from sim.arrays import Floats
from tests.calibration.toy_tables import toy_swimmer, toy_table


def test_scores_along_features_are_those_of_least_squares() -> None:
    """One output along one feature: its coefficient over its error, with coefficients and numbers beside it."""
    model = toy_swimmer(toy_table(8))
    used = ~middle_session(model.runs)
    names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    fitted = fit(model, start_values(model), names, used, title="")
    none = Directions(np.zeros((*model.runs.y.shape, 0)), np.zeros(0, int), np.zeros(0))
    scores = examine_residual(Study.fitted_to(model, used, draws=50), fitted, none).scores
    _, table = features(model.runs, used)
    J = fitted.jacobian[used]
    residual = (model.runs.y - fitted.prediction)[used] + J @ changes(fitted.fitted, fitted.parameters)
    noise = Noise(repeat_covariance(residual, model.runs.condition[used]), float(scores.share))
    white = noise.whitener(model.runs.session[used])
    prior = np.diag(np.sqrt(precisions(fitted.fitted)))
    for output, feature in ((0, 0), (2, 3), (4, 1)):
        feature_column = np.zeros_like(residual)
        feature_column[:, output] = table[used][:, feature]
        columns = np.concatenate([J, feature_column[..., None]], -1)
        rows = np.concatenate([white(columns), np.pad(prior, ((0, 0), (0, 1)))])
        values = np.concatenate([white(residual), np.zeros(len(prior))])
        step = np.linalg.lstsq(rows, values, rcond=None)[0]
        error = np.sqrt(np.linalg.inv(rows.T @ rows)[-1, -1])
        assert scores.shapes[output, feature] == pytest.approx(step[-1] / error, rel=1e-6)


def test_the_kernel_of_repeats_is_that_of_all_runs() -> None:
    """Runs with equal inputs share a row of the kernel: 20,000 runs of 96 conditions used to take gigabytes."""
    rng = np.random.default_rng(0)
    inputs = rng.normal(size=(20, 3))[rng.integers(0, 20, 200)]
    white = rng.normal(size=(4, 200, 5))
    distance = ((inputs[:, None] - inputs[None]) ** 2).sum(-1)
    expected = np.einsum("bnk,nm,bmk->b", white, np.exp(-distance / 2), white)
    places, kernel = _kernel(inputs)
    assert places.shape == (20, 200)
    added = places @ white
    assert np.einsum("bik,ij,bjk->b", added, kernel, added) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("scale", [None, np.sqrt([1.0, 0.1, 1.0, 0.4, 0.02])], ids=["equal", "weighted"])
def test_whitener_is_the_inverse_root_of_the_block_covariance(scale: Floats | None) -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(3, 3))
    noise = Noise(root @ root.T + np.eye(3), 0.7)
    session = np.array([0, 0, 1, 1, 1])
    same = (session[:, None] == session[None]).astype(float)
    factors = np.eye(5) if scale is None else np.diag(scale**-2)
    covariance = np.kron(factors + noise.share * same, noise.run)
    whiten = noise.whitener(session, scale)
    W = whiten(np.eye(15).reshape(5, 3, 15))
    assert W @ covariance @ W.T == pytest.approx(np.eye(15), abs=1e-10)


def test_noise_is_recovered_from_repeats_and_sessions() -> None:
    """Without bias, though the fit takes degrees of freedom from the means of the sessions; with weights, too."""
    rng = np.random.default_rng(1)
    session = np.repeat(np.arange(4), 30)
    condition = np.arange(120) // 2
    J = rng.normal(size=(120, 2, 1)) + 1.0
    scale = np.where(np.arange(120) % 7 == 0, 0.2, 1.0)
    shares, covariances = [], []
    for _ in range(300):
        scatter = rng.normal(scale=[0.03, 0.05], size=(120, 2)) / scale[:, None]
        shift = np.sqrt(0.1) * rng.normal(scale=[0.03, 0.05], size=(4, 2))[session]
        y = rng.normal(size=(60, 2))[condition] + scatter + shift
        covariances.append(repeat_covariance(y, condition, scale))
        root = inverse_root(covariances[-1])
        columns = root @ np.concatenate([J, (scatter + shift)[..., None]], -1)
        shares.append(least_squares(sums(columns, session, 2, scale), passes=3).share)
    assert np.sqrt(np.diag(np.mean(covariances, 0))) == pytest.approx([0.03, 0.05], rel=0.02)
    assert np.mean(shares) == pytest.approx(0.1, rel=0.1)
