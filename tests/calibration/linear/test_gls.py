"""Generalised least squares and the tests of the residual, against dense matrices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibration.linear.gls import (
    Noise,
    Regression,
    inverse_root,
    repeat_count,
    repeat_covariance,
    schur_complement,
    solve_normal,
)
from calibration.statistics.residual_tests import Directions, directions, examine_residual, kernel_factor
from calibration.statistics.statistical_model import precisions, prior_offsets
from calibration.statistics.study import Study, middle_session
from calibration.table.runs import features
from common.arrays import Floats
from tests.calibration.toy_tables import fit_all, toy_swimmer, toy_table
from tests.oracles.dense_noise import dense_covariance

SESSION = np.array([0, 0, 1, 1, 1, 2, 2, 2])
SCALE = np.sqrt([1.0, 0.1, 1.0, 0.4, 0.02, 1.0, 2.0, 1.0])


def dense(run: Floats, share: Floats) -> Floats:
    """Σ, for shares that may differ between the outputs."""
    axes = np.linalg.inv(inverse_root(run))
    assert axes @ axes.T == pytest.approx(run)
    same = SESSION[:, None] == SESSION
    return np.kron(np.diag(SCALE**-2), run) + np.kron(same, (axes * share) @ axes.T)


def test_a_design_of_repeats_is_decomposed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(7)
    y, design = rng.normal(size=(40, 2)), rng.normal(size=(40, 5))
    first = repeat_covariance(y, design)
    monkeypatch.setattr(np.linalg, "svd", None)
    assert repeat_count(design) == 35
    assert (repeat_covariance(y, design.copy()) == first).all()


def test_steps_and_what_is_left_are_those_of_dense_matrices() -> None:
    """With weights, and priors of the first two of three columns, for residuals each in its own covariance."""
    rng = np.random.default_rng(0)
    columns, residual = rng.normal(size=(8, 2, 3)), rng.normal(size=(4, 8, 2))
    condition, precision, change = np.arange(8) // 2, np.array([0.0, 4.0]), np.array([0.0, 0.3])
    share = np.array([0.7, 0.2])
    linear = Regression(columns, precision, SESSION, SCALE, condition)
    together = linear.products(residual, change=change).at(np.tile(share, (4, 1)))
    step, covariance = solve_normal(together)
    left = schur_complement(together, 2)
    for b, y in enumerate(residual):
        run = repeat_covariance(y, condition, SCALE)
        inverse = np.linalg.inv(dense(run, share))
        flat = np.column_stack([columns.reshape(16, 3), y.ravel()])
        normal = flat.T @ inverse @ flat
        normal[:2, :2] += np.diag(precision)
        normal[:2, 3] -= precision * change
        normal[3, :2] -= precision * change
        normal[3, 3] += precision @ change**2
        assert together[b] == pytest.approx(normal, rel=1e-10)
        assert step[b] == pytest.approx(np.linalg.solve(normal[:3, :3], normal[:3, 3]), rel=1e-8)
        assert covariance[b] == pytest.approx(np.linalg.inv(normal[:3, :3]), rel=1e-8)
        assert left[b] == pytest.approx(np.linalg.inv(np.linalg.inv(normal)[2:, 2:]), rel=1e-8)
        assert linear.products(y, run, change).at(share) == pytest.approx(normal, rel=1e-10)


def test_draws_have_the_covariance_of_runs_sessions_and_priors() -> None:
    rng = np.random.default_rng(0)
    columns, run, share = rng.normal(size=(8, 2, 2)), np.array([[1.0, 0.4], [0.4, 0.8]]), np.array([0.5, 0.1])
    drawn = Regression(columns, np.array([0.0, 4.0]), SESSION, SCALE).draw(rng, run, np.tile(share, (40_000, 1)))
    expected = dense(run, share) + np.outer(columns[..., 1], columns[..., 1]) / 4
    scatter = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.cov(drawn.reshape(len(drawn), -1).T) / scatter == pytest.approx(expected / scatter, abs=0.03)


@pytest.mark.parametrize("scale", [None, SCALE], ids=["equal", "weighted"])
def test_whitener_is_the_inverse_root_of_the_block_covariance(scale: Floats | None) -> None:
    root = np.random.default_rng(0).normal(size=(3, 3))
    noise = Noise(root @ root.T + np.eye(3), np.array([0.7, 0.0, 0.3]))
    factors = np.zeros((8, 8)) if scale is None else np.diag(scale**-2) - np.eye(8)
    W = noise.whitener(SESSION, scale)(np.eye(24).reshape(8, 3, 24))
    covariance = dense_covariance(noise, SESSION) + np.kron(factors, noise.run_covariance)
    assert W @ covariance @ W.T == pytest.approx(np.eye(24), abs=1e-10)
    if scale is None:
        assert noise.log_determinant(SESSION, np.ones(8)) == pytest.approx(np.linalg.slogdet(covariance)[1])


def test_noise_is_recovered_from_repeats_and_sessions() -> None:
    """Without bias, though the fit takes degrees of freedom from the means of the sessions; with weights, too.

    Each ratio is half its own and half that of all outputs.
    """
    rng = np.random.default_rng(1)
    session = np.repeat(np.arange(4), 30)
    condition = np.arange(120) // 2
    J = rng.normal(size=(120, 2, 1)) + 1.0
    scale = np.where(np.arange(120) % 7 == 0, 0.2, 1.0)
    shares, covariances = [], []
    for _ in range(300):
        scatter = rng.normal(scale=[0.03, 0.05], size=(120, 2)) / scale[:, None]
        shift = np.sqrt([0.3, 0.1]) * rng.normal(scale=[0.03, 0.05], size=(4, 2))[session]
        y = rng.normal(size=(60, 2))[condition] + scatter + shift
        covariances.append(repeat_covariance(y, condition, scale))
        linear = Regression(J, np.zeros(1), session, scale)
        shares.append(linear.products(scatter + shift, covariances[-1]).session_ratio(passes=3))
    assert np.sqrt(np.diag(np.mean(covariances, 0))) == pytest.approx([0.03, 0.05], rel=0.02)
    assert np.mean(shares, 0) == pytest.approx([0.25, 0.15], rel=0.12)


def test_scores_along_features_are_those_of_least_squares() -> None:
    """One output along one feature: its coefficient over its error, with coefficients and numbers beside it."""
    model = toy_swimmer(toy_table(8))
    used = ~middle_session(model.runs)
    fitted = fit_all(model, used)
    none = Directions.plain(np.zeros((*model.runs.y.shape, 0)))
    scores = examine_residual(Study.fitted_to(model, used, draws=50), fitted, none).scores
    _, table = features(model.runs, used)
    J = fitted.jacobian[used]
    residual = (model.runs.y - fitted.prediction)[used] + J @ prior_offsets(fitted.fitted, fitted.parameters)
    noise = Noise(repeat_covariance(residual, model.runs.condition[used]), scores.session_ratio)
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
    factor = kernel_factor(inputs)
    assert factor.shape == (200, 20)
    assert ((factor.T @ white) ** 2).sum((1, 2)) == pytest.approx(expected, rel=1e-9)


def test_the_kernel_of_many_inputs_has_the_columns_that_are_no_rounding_error() -> None:
    """Readings of traces: 600 columns of 624 were rounding errors, and each was whitened again and again."""
    inputs = np.random.default_rng(0).uniform(-2, 2, (624, 1))
    factor = kernel_factor(inputs)
    assert factor.shape[1] < 30
    assert np.abs(factor @ factor.T - np.exp(-((inputs - inputs.T) ** 2) / 2)).max() < 1e-9


def test_the_kernel_of_many_inputs_is_nearly_that_of_all() -> None:
    inputs = np.random.default_rng(0).uniform(-2, 2, (1500, 2))
    factor = kernel_factor(inputs)
    distance = ((inputs[:, None] - inputs[None]) ** 2).sum(-1)
    assert factor.shape[1] < 100
    assert np.abs(factor @ factor.T - np.exp(-distance / 2)).max() < 0.1


def test_lengths_are_those_of_a_dense_covariance() -> None:
    """Σ + G P Gᵀ formed and the coefficients projected out; of one session, so that ρ is 1 for every effect."""
    model = toy_swimmer(toy_table(3).assign(session="one"))
    used = np.ones(len(model.runs), dtype=bool)
    fitted = fit_all(model, used)
    tangents = directions(model, fitted.parameters, model.effects)
    misfit = examine_residual(Study.fitted_to(model, used, seed=1), fitted, tangents, draws=200)
    chosen = [
        next(m for m in np.flatnonzero(tangents.owner == j) if tangents.second[m] == second or np.isnan(second))
        for j, second in enumerate(misfit.second)
    ]
    flat = fitted.jacobian.reshape(used.size * 5, -1)
    bound = [p.sigma is not None for p in fitted.fitted]

    covariance = dense_covariance(replace(fitted.noise, session_ratio=1.0), model.runs.session)
    for p, column in zip(fitted.fitted, flat.T, strict=True):
        covariance += (p.sigma or 0.0) ** 2 * np.outer(column, column)
    white = np.linalg.inv(np.linalg.cholesky(covariance))
    free, seen = white @ flat[:, ~np.array(bound)], white @ tangents.table[..., chosen].reshape(len(flat), -1)
    lengths = np.linalg.norm(seen - free @ np.linalg.lstsq(free, seen, rcond=None)[0], axis=0)
    shown = np.asarray(misfit.scores.survived) > model.runs.least_surviving
    assert shown.sum() > 5
    assert misfit.scores.length[shown] == pytest.approx(lengths[shown], rel=1e-4)


def test_without_a_repeat_no_scatter_is_seen() -> None:
    """And nothing is divided by zero."""
    assert repeat_covariance(np.array([[1.0], [3.0]]), np.arange(2)) == 0
    assert repeat_covariance(np.array([[1.0], [3.0]]), np.zeros(2, dtype=np.int64))[0, 0] == pytest.approx(2.0)
