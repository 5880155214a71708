"""The tests of the residual: their products, their scores, and their p-values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibration.statistics.fit import fit
from calibration.statistics.residual_tests import Directions, FixedColumns, _kernel, examine_residual
from calibration.statistics.statistical_model import (
    Noise,
    changes,
    features,
    precisions,
    repeat_covariance,
    start_values,
    sums,
)
from calibration.statistics.study import DRAWS, Study, middle_session
from sim.arrays import Floats
from tests.calibration.toy_tables import calibrated, toy_swimmer, toy_table


@pytest.mark.parametrize(
    "weights", [np.ones(7), np.array([1.0, 0.1, 1.0, 0.4, 0.02, 0.7, 1.0])], ids=["equal", "weighted"]
)
def test_a_design_makes_the_same_products_for_many_residuals(weights: Floats) -> None:
    """Each residual has its own S; against columns that are whitened one residual after the other."""
    rng = np.random.default_rng(3)
    session = np.array([0, 0, 1, 1, 1, 2, 2])
    columns, residuals = rng.normal(size=(7, 3, 4)), rng.normal(size=(5, 7, 3))
    roots = np.linalg.inv(np.linalg.cholesky([np.eye(3) + np.outer(v, v) for v in rng.normal(size=(5, 3))]))
    scale = np.sqrt(weights)
    rows = scale[:, None, None]
    precision = np.swapaxes(roots, -1, -2) @ roots
    products = FixedColumns(columns * rows, session, scale).sums(precision, residuals * rows[..., 0])
    for i, (root, residual) in enumerate(zip(roots, residuals, strict=True)):
        expected = sums(root @ np.concatenate([columns, residual[..., None]], -1), session, 3, scale)
        assert products.within[i] == pytest.approx(expected.within)
        assert products.between[i] == pytest.approx(expected.between)


@pytest.mark.usefixtures("toy_model")
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


@pytest.mark.rates
@pytest.mark.usefixtures("toy_model")
def test_p_values_of_nulls_are_spread_evenly() -> None:
    """The bootstrap accounts for the fit: p-values of pure noise are neither small nor large on the whole."""
    table = toy_table(11)
    model = toy_swimmer(table)
    data = model.runs
    used = ~middle_session(data)
    base = calibrated(table, draws=DRAWS).base
    rng = np.random.default_rng(0)
    p = []
    for seed in range(40):
        noise = rng.multivariate_normal(np.zeros(len(data.outputs)), base.noise.run, size=len(data))
        drawn = replace(model, runs=replace(data, y=base.prediction + noise))
        study = Study.fitted_to(drawn, used, level=0.05, seed=seed, draws=100)
        p.append(examine_residual(study, base, Directions.plain(np.zeros((*data.y.shape, 0)))))
    kernel = np.array([m.general_p for m in p])
    assert 0.3 < kernel.mean() < 0.7
    assert (kernel < 0.1).mean() < 0.25


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
