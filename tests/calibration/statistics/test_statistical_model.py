"""Noise from repeats and sessions, and least squares in it."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.statistics.statistical_model import (
    Noise,
    inverse_root,
    least_squares,
    repeat_covariance,
    sums,
)
from sim.arrays import Floats


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


@pytest.mark.parametrize(
    "weights", [np.ones(6), np.array([1.0, 0.1, 1.0, 0.4, 0.02, 0.7])], ids=["equal", "weighted"]
)
def test_products_of_columns_are_those_of_white_columns(weights: Floats) -> None:
    """The sums that hold for any ρ against whitening for one."""
    rng = np.random.default_rng(2)
    session = np.array([0, 0, 1, 1, 1, 2])
    table = rng.normal(size=(6, 3, 4))
    noise, scale = Noise(np.eye(3), 0.4), np.sqrt(weights)
    flat = noise.whitener(session, scale)(table)
    products = sums(table, session, 3, scale)
    assert products.at(np.array(0.4)) == pytest.approx(flat.T @ flat)
    picked = products.take(np.array([[0, 3], [2, 1]]))
    assert picked.at(np.array([0.4, 0.4]))[1] == pytest.approx((flat.T @ flat)[np.ix_([2, 1], [2, 1])])
    fitted = least_squares(products, passes=0)
    plain = (table * scale[:, None, None]).reshape(18, 4)
    assert fitted.step == pytest.approx(np.linalg.lstsq(plain[:, :3], plain[:, 3], rcond=None)[0])


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
