"""Paths: smoothing removes noise and keeps the ends."""

from __future__ import annotations

import numpy as np
import pytest

from planner.paths.path import Path2D, circle, resample, smoothed
from planner.planning.plan import plan
from sim.io.errors import InputError
from sim.model.presets import PRESETS

CONTROL = PRESETS["paper-control"]


def test_smoothing_takes_camera_noise_out_and_says_what_it_moves() -> None:
    rng = np.random.default_rng(0)
    clean = circle(2.0)
    noisy = Path2D.of(clean.points + 0.02 * rng.normal(size=clean.points.shape), closed=True)
    found, moved = smoothed(noisy, 0.5)
    assert np.abs(np.hypot(*found.points.T) - 2.0).max() < 0.03
    assert 0.01 < moved < 0.15
    assert plan(found, CONTROL).declared.missed < 0.05
    with pytest.raises(InputError, match="smoothing over"):
        smoothed(noisy, -1.0)


def test_an_open_path_keeps_its_ends() -> None:
    found, _ = smoothed(Path2D.of([[0, 0], [2, 0], [2, 3]]), 0.4)
    assert found.points[[0, -1]] == pytest.approx(np.array([[0.0, 0.0], [2.0, 3.0]]))


def test_the_last_bit_of_a_length_does_not_choose_the_number_of_points() -> None:
    for length in (12.0, np.nextafter(12.0, 0.0), np.nextafter(12.0, 20.0)):
        assert len(resample(np.array([[0.0, 0.0], [length, 0.0]]), 0.02)) == 601
