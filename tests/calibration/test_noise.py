"""Noise from repeats and sessions, and tests of fit on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibration.statistics.fit import fit
from calibration.statistics.forward_model import start_values
from calibration.statistics.input_features import features
from calibration.statistics.noise import FixedColumns, Noise, inverse_root, least_squares, repeat_covariance, sums
from calibration.statistics.priors import changes, precisions
from calibration.statistics.residual_tests import examine_residual
from calibration.statistics.score_directions import Directions
from calibration.statistics.splits import middle_session
from calibration.statistics.study import Study
from tests.calibration.toy_tables import closed, toy_swimmer, toy_table


def test_whitener_is_the_inverse_root_of_the_block_covariance() -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(3, 3))
    noise = Noise(root @ root.T + np.eye(3), 0.7)
    session = np.array([0, 0, 1, 1, 1])
    same = (session[:, None] == session[None]).astype(float)
    covariance = np.kron(np.eye(5) + noise.share * same, noise.run)
    whiten = noise.whitener(session)
    W = whiten(np.eye(15).reshape(5, 3, 15))
    assert W @ covariance @ W.T == pytest.approx(np.eye(15), abs=1e-10)


def test_products_of_columns_are_those_of_white_columns() -> None:
    """The sums that hold for any ρ against whitening for one."""
    rng = np.random.default_rng(2)
    session = np.array([0, 0, 1, 1, 1, 2])
    table = rng.normal(size=(6, 3, 4))
    noise = Noise(np.eye(3), 0.4)
    flat = noise.whitener(session)(table)
    found = sums(table, session, 3)
    assert found.at(np.array(0.4)) == pytest.approx(flat.T @ flat)
    picked = found.take(np.array([[0, 3], [2, 1]]))
    assert picked.at(np.array([0.4, 0.4]))[1] == pytest.approx((flat.T @ flat)[np.ix_([2, 1], [2, 1])])
    fitted = least_squares(found, passes=0)
    plain = table.reshape(18, 4)
    assert fitted.step == pytest.approx(np.linalg.lstsq(plain[:, :3], plain[:, 3], rcond=None)[0])


def test_a_design_makes_the_same_products_for_many_residuals() -> None:
    """Each residual has its own S; against columns that are whitened one residual after the other."""
    rng = np.random.default_rng(3)
    session = np.array([0, 0, 1, 1, 1, 2, 2])
    columns, residuals = rng.normal(size=(7, 3, 4)), rng.normal(size=(5, 7, 3))
    roots = np.linalg.inv(np.linalg.cholesky([np.eye(3) + np.outer(v, v) for v in rng.normal(size=(5, 3))]))
    found = FixedColumns(columns, session).sums(np.swapaxes(roots, -1, -2) @ roots, residuals)
    for i, (root, residual) in enumerate(zip(roots, residuals, strict=True)):
        own = sums(root @ np.concatenate([columns, residual[..., None]], -1), session, 3)
        assert found.within[i] == pytest.approx(own.within)
        assert found.between[i] == pytest.approx(own.between)


@pytest.mark.usefixtures("toy_model")
def test_scores_along_features_are_those_of_least_squares() -> None:
    """One output along one feature: its coefficient over its error, with coefficients and numbers beside it."""
    model = toy_swimmer(toy_table(8))
    used = ~middle_session(model.runs)
    names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    fitted = fit(model, start_values(model), names, used, title="")
    none = Directions(np.zeros((*model.runs.y.shape, 0)), np.zeros(0, int), np.zeros(0))
    found = examine_residual(Study.fitted_to(model, used, draws=50), fitted, none).scores
    _, table = features(model.runs, used)
    J = fitted.jacobian[used]
    residual = (model.runs.y - fitted.prediction)[used] + J @ changes(fitted.fitted, fitted.parameters)
    noise = Noise(repeat_covariance(residual, model.runs.condition[used]), float(found.share))
    white = noise.whitener(model.runs.session[used])
    prior = np.diag(np.sqrt(precisions(fitted.fitted)))
    for output, feature in ((0, 0), (2, 3), (4, 1)):
        along = np.zeros_like(residual)
        along[:, output] = table[used][:, feature]
        columns = np.concatenate([J, along[..., None]], -1)
        rows = np.concatenate([white(columns), np.pad(prior, ((0, 0), (0, 1)))])
        values = np.concatenate([white(residual), np.zeros(len(prior))])
        step = np.linalg.lstsq(rows, values, rcond=None)[0]
        error = np.sqrt(np.linalg.inv(rows.T @ rows)[-1, -1])
        assert found.shapes[output, feature] == pytest.approx(step[-1] / error, rel=1e-6)


def test_noise_is_recovered_from_repeats_and_sessions() -> None:
    """Without bias, though the fit takes degrees of freedom from the means of the sessions."""
    rng = np.random.default_rng(1)
    session = np.repeat(np.arange(4), 30)
    condition = np.arange(120) // 2
    J = rng.normal(size=(120, 2, 1)) + 1.0
    shares, covariances = [], []
    for _ in range(300):
        scatter = rng.normal(scale=[0.03, 0.05], size=(120, 2))
        shift = np.sqrt(0.1) * rng.normal(scale=[0.03, 0.05], size=(4, 2))[session]
        y = rng.normal(size=(60, 2))[condition] + scatter + shift
        covariances.append(repeat_covariance(y, condition))
        root = inverse_root(covariances[-1])
        columns = root @ np.concatenate([J, (scatter + shift)[..., None]], -1)
        shares.append(least_squares(sums(columns, session, 2), passes=3).share)
    assert np.sqrt(np.diag(np.mean(covariances, 0))) == pytest.approx([0.03, 0.05], rel=0.02)
    assert np.mean(shares) == pytest.approx(0.1, rel=0.1)


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_p_values_of_nulls_are_spread_evenly() -> None:
    """The bootstrap accounts for the fit: p-values of pure noise are neither small nor large on the whole."""
    table = toy_table(11)
    model = toy_swimmer(table)
    data = model.runs
    used = ~middle_session(data)
    base = closed(table).base
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
