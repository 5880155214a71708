"""The filter is the Cholesky factor of the covariance of poses, and its sizes are found again."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from calibration.swim.pose_noise import PoseNoise, Sizes, estimate_noise
from common.arrays import Floats
from tests.processes import LIMIT, ROOT

SIZES = Sizes(np.array([0.03, 0.01]), np.array([0.05, 0.02]), np.array([0.01, 0.03]), 10.0)


def noise_of(count: int, sizes: Sizes, *, first: int, seed: int = 0) -> PoseNoise:
    """Make the noise of two parts at irregular times."""
    rng = np.random.default_rng(seed)
    time, part = np.cumsum(rng.uniform(0.3, 0.7, count)), (np.arange(count) >= first).astype(np.int64)
    return PoseNoise(part, time, rng.poisson(0.4, count), rng.normal(size=(count, 2)) * 0.2, sizes)


def covariance(noise: PoseNoise) -> Floats:
    """Add up the covariance of all poses (3 n, 3 n), source by source."""
    count, (white, slow, step) = len(noise.time), (np.array([s[0], s[0], s[1]]) for s in noise.sizes[:3])
    place, total = np.cumsum(noise.moved, 0), np.diag(np.tile(white**2, count))
    for part in np.unique(noise.part):
        rows = np.flatnonzero(noise.part == part)
        near = np.exp(-np.abs(noise.time[rows][:, None] - noise.time[rows]) / noise.sizes.tau)
        for axis in range(3):
            total[np.ix_(3 * rows + axis, 3 * rows + axis)] += slow[axis] ** 2 * near
        for i in rows[1:]:  # a step carries all that follows
            later, moved = rows[rows >= i], np.zeros((3, count, 3))
            lever = place[later] - place[i - 1]
            moved[[0, 1, 2], later[:, None], [0, 1, 2]] = 1.0
            moved[2, later, 0], moved[2, later, 1] = -lever[:, 1], lever[:, 0]
            for axis in range(3):
                effect = step[axis] * moved[axis].ravel()
                total += noise.flips[i] * np.outer(effect, effect)
    return total


@pytest.mark.parametrize("step", [0.0, 1.0, 100.0])
def test_the_filter_is_the_cholesky_factor(step: float) -> None:
    noise = noise_of(120, SIZES._replace(step=step * SIZES.step), first=70)
    K, poses = covariance(noise), np.random.default_rng(1).normal(size=(120, 3, 4))
    white = np.linalg.solve(np.linalg.cholesky(K), poses.reshape(360, 4))
    scale = np.abs(white).max()
    np.testing.assert_allclose(noise.whiten(poses).reshape(360, 4) / scale, white / scale, atol=1e-9)
    np.testing.assert_allclose(noise.colour(noise.whiten(poses)), poses, atol=1e-9)
    assert noise.log_determinant == pytest.approx(np.linalg.slogdet(K)[1] / 2, abs=1e-6)


def test_of_some_poses_the_noise_is_a_part_of_it() -> None:
    noise = noise_of(60, SIZES, first=40)
    rows = (np.arange(60) < 30) | ((np.arange(60) >= 40) & (np.arange(60) < 50))
    picked = np.repeat(rows, 3)
    np.testing.assert_allclose(covariance(noise.of(rows)), covariance(noise)[np.ix_(picked, picked)])


@pytest.mark.filterwarnings("error")
def test_each_swim_has_a_clock_of_its_own() -> None:
    noise, poses = noise_of(60, SIZES, first=40), np.random.default_rng(2).normal(size=(60, 3, 1))
    anew = replace(noise, time=noise.time - 1e5 * noise.part)
    np.testing.assert_allclose(anew.whiten(poses), noise.whiten(poses), rtol=1e-8)


def test_without_steps_poses_are_compared_and_with_large_ones_their_changes() -> None:
    """A turn of the whole path is seen in all poses, or in none but the first after it."""
    bent = np.zeros((100, 3, 1))
    bent[50:, 2] = 0.1
    plain = noise_of(100, SIZES._replace(slow=np.full(2, 1e-6), step=np.full(2, 1e-9)), first=100)
    assert np.linalg.norm(plain.whiten(bent)) > 10 * np.sqrt(40)
    jumping = noise_of(100, SIZES._replace(slow=np.full(2, 1e-6), step=np.full(2, 10.0)), first=100)
    assert np.linalg.norm(jumping.whiten(bent)) < 10 * np.sqrt(5)


@pytest.mark.slow
def test_the_sizes_are_found_again() -> None:
    """Of ten tables with 1,500 poses and 20 columns that may be anything, within 15 % on average."""
    found = []
    for seed in range(10):
        rng, noise = np.random.default_rng(seed), noise_of(1500, SIZES, first=1500, seed=seed)
        columns = rng.normal(size=(1500, 3, 20)).cumsum(0)
        drawn = noise.colour(rng.normal(size=(1500, 3))) + columns @ rng.normal(size=20)
        rough = noise_of(1500, SIZES._replace(tau=3.0), first=1500, seed=seed)
        found.append(np.concatenate([*estimate_noise(rough, drawn, columns).sizes[:3]]))
    truth = np.concatenate(SIZES[:3])
    assert np.abs(np.log(np.array(found) / truth).mean(0)).max() < 0.15


_COMPILED = """
from calibration.__main__ import main
from calibration.swim import pose_noise as swim
from tests.calibration.swim.test_pose_noise import SIZES, noise_of
main(["compile"])
before = [loop.kernel.signatures[:] for loop in (swim._gains, swim._filtered)]
noise = noise_of(60, SIZES, first=40)
noise.colour(noise.whiten(swim.np.ones((60, 3, 4))))
assert all(before) and [loop.kernel.signatures for loop in (swim._gains, swim._filtered)] == before
"""


def test_a_swim_needs_no_loops_but_those_that_are_compiled_beforehand() -> None:
    command = [sys.executable, "-c", _COMPILED]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT)
    assert done.returncode == 0, done.stderr
