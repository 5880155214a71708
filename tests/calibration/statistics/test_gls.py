"""Generalised least squares against dense matrices."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.statistics.gls import Gls, Noise, eliminated, inverse_root, repeat_covariance, solved
from sim.arrays import Floats

SESSION = np.array([0, 0, 1, 1, 1, 2, 2, 2])
SCALE = np.sqrt([1.0, 0.1, 1.0, 0.4, 0.02, 1.0, 2.0, 1.0])


def dense(run: Floats, share: Floats) -> Floats:
    """Σ, for shares that may differ between the outputs."""
    axes = np.linalg.inv(inverse_root(run))
    assert axes @ axes.T == pytest.approx(run)
    same = SESSION[:, None] == SESSION
    return np.kron(np.diag(SCALE**-2), run) + np.kron(same, (axes * share) @ axes.T)


def test_steps_and_what_is_left_are_those_of_dense_matrices() -> None:
    """With weights, and priors of the first two of three columns, for residuals each in its own covariance."""
    rng = np.random.default_rng(0)
    columns, residual = rng.normal(size=(8, 2, 3)), rng.normal(size=(4, 8, 2))
    condition, precision, change = np.arange(8) // 2, np.array([0.0, 4.0]), np.array([0.0, 0.3])
    share = np.array([0.7, 0.2])
    linear = Gls(columns, precision, SESSION, SCALE, condition)
    together = linear.products(residual, change=change).at(np.tile(share, (4, 1)))
    step, covariance = solved(together)
    left = eliminated(together, 2)
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
    drawn = Gls(columns, np.array([0.0, 4.0]), SESSION, SCALE).draw(rng, run, np.tile(share, (40_000, 1)))
    expected = dense(run, share)
    expected += np.outer(columns[..., 1], columns[..., 1]) / 4
    scatter = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.cov(drawn.reshape(len(drawn), -1).T) / scatter == pytest.approx(expected / scatter, abs=0.03)


@pytest.mark.parametrize("scale", [None, np.sqrt([1.0, 0.1, 1.0, 0.4, 0.02])], ids=["equal", "weighted"])
def test_whitener_is_the_inverse_root_of_the_block_covariance(scale: Floats | None) -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(3, 3))
    noise = Noise(root @ root.T + np.eye(3), np.array([0.7, 0.0, 0.3]))
    session = np.array([0, 0, 1, 1, 1])
    factors = np.zeros((5, 5)) if scale is None else np.diag(scale**-2) - np.eye(5)
    covariance = noise.covariance(session) + np.kron(factors, noise.run)
    whiten = noise.whitener(session, scale)
    W = whiten(np.eye(15).reshape(5, 3, 15))
    assert W @ covariance @ W.T == pytest.approx(np.eye(15), abs=1e-10)


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
        linear = Gls(J, np.zeros(1), session, scale)
        shares.append(linear.products(scatter + shift, covariances[-1]).share(passes=3))
    assert np.sqrt(np.diag(np.mean(covariances, 0))) == pytest.approx([0.03, 0.05], rel=0.02)
    assert np.mean(shares, 0) == pytest.approx([0.25, 0.15], rel=0.12)
