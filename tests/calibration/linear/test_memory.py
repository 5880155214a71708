"""Noise with a memory, against dense matrices."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibration.linear.memory import Memory, Repeats, estimate_memory

TRACE = np.repeat([0, 1, 2], [7, 5, 9])
TIME = np.concatenate([np.sort(np.random.default_rng(4).uniform(0, 10, count)) for count in (7, 5, 9)])


def dense(trace, time, share, tau):
    """Return R."""
    same = trace[:, None] == trace
    white = (1 - share) * np.eye(len(time))
    return same * (white + share * np.exp(-np.abs(time[:, None] - time) / tau))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.95])
def test_whitening_is_that_of_the_cholesky_factor(share):
    root = np.linalg.cholesky(dense(TRACE, TIME, share, 3.0))
    memory, table = Memory(TRACE, TIME, share, 3.0), np.random.default_rng(0).normal(size=(21, 2, 3))
    solved = np.linalg.solve(root, table.reshape(21, -1)).reshape(table.shape)
    assert_allclose(memory.whiten(table), solved, rtol=1e-6, atol=1e-8)
    assert_allclose(memory.colour(memory.whiten(table)), table, rtol=1e-10)
    assert memory.whiten(table[..., :0]).shape == memory.colour(table[..., :0]).shape == (21, 2, 0)
    assert_allclose(memory.log_determinant, 2 * np.log(np.diag(root)).sum(), rtol=1e-6, atol=1e-8)
    assert_allclose(memory.level, np.linalg.solve(root, np.ones(21)), rtol=1e-6)


def test_two_readings_at_one_time_are_repeats():
    time = np.array([0.0, 1.0, 1.0, 2.0])
    root = np.linalg.cholesky(dense(np.zeros(4), time, 0.6, 2.0))
    white = Memory(np.zeros(4, dtype=int), time, 0.6, 2.0).whiten(np.arange(4.0))
    assert_allclose(white, np.linalg.solve(root, np.arange(4.0)), rtol=1e-6)


def drawn(rng, pairs, share, tau, length=60, scale=1.0):
    """Draw repeated traces (2 pairs, length), and say which are repeats."""
    time = 30.0 * np.arange(length)
    root = scale * np.linalg.cholesky(dense(np.zeros(length), time, share, tau))
    table = np.concatenate([root @ rng.normal(size=length) for _ in range(2 * pairs)])
    contrast = np.array([[1.0, -1.0]]) / np.sqrt(2)
    absorbed = np.column_stack([np.ones(length), np.exp(-time / 900)])
    rows = [np.arange(2 * length).reshape(2, length) + 2 * length * pair for pair in range(pairs)]
    return [Repeats(each, contrast, time, absorbed) for each in rows], table[:, None]


def test_the_memory_is_found_in_repeats_with_levels_and_shapes_of_their_own():
    found = []
    for seed in range(12):
        repeats, table = drawn(np.random.default_rng(seed), 8, 0.8, 240.0, scale=0.3)
        shape = np.exp(-30.0 * np.arange(60) / 900)
        table += np.repeat(np.random.default_rng(seed).normal(size=16), 60)[:, None]  # a level
        table += np.concatenate([amount * shape for amount in np.linspace(-5, 5, 16)])[:, None]
        noise = estimate_memory(repeats, table)
        found.append((noise.run_covariance[0, 0] / 0.09, noise.share, noise.tau / 240))
        assert noise.freedom == 8 * 58
    size, share, tau = np.median(found, 0)
    assert size == pytest.approx(1, abs=0.25)
    assert share == pytest.approx(0.8, abs=0.1)
    assert tau == pytest.approx(1, abs=0.4)


def test_white_noise_has_no_memory_that_matters():
    repeats, table = drawn(np.random.default_rng(0), 8, 0.0, 240.0)
    noise = estimate_memory(repeats, table)
    neighbours = noise.share * np.exp(-30.0 / noise.tau)
    assert neighbours < 0.1
    assert noise.run_covariance[0, 0] == pytest.approx(1, abs=0.2)


def test_draws_are_judged_among_what_the_repeats_allow():
    rng = np.random.default_rng(1)
    repeats, table = drawn(rng, 3, 0.9, 300.0)
    noise = estimate_memory(repeats, table)
    assert noise.as_likely[0] == (noise.share, noise.tau)
    assert len(noise.as_likely) > 5  # three repeats tell little
    place, covariance = noise.estimated(table[:, None])
    assert place.tolist() == [0]  # nothing is more likely than the estimate
    assert_allclose(covariance[0], noise.run_covariance)
    many, long_table = drawn(rng, 40, 0.9, 300.0, length=120)
    assert len(estimate_memory(many, long_table).as_likely) == 1  # forty tell it well enough
