"""The tests of the residual: noise from repeats and sessions, scores, and p-values."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.statistics.fit import fit
from calibration.statistics.gls import Noise, repeat_covariance
from calibration.statistics.residual_tests import Directions, _kernel, examine_residual
from calibration.statistics.statistical_model import changes, features, precisions, start_values
from calibration.statistics.study import Study, middle_session
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
    noise = Noise(repeat_covariance(residual, model.runs.condition[used]), scores.share)
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
