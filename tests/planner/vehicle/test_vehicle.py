"""The vehicle with memory, against direct formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner.vehicle.vehicle import BEFORE_KNOTS, TIMES, lag_table
from sim.mechanics import planar
from sim.model.response import BEFORE, DWELLS, memory_after
from tests.planner.vehicles import vehicle


def test_lags_are_those_of_the_curves() -> None:
    """At the dwells of the table exactly; between lengths of the dwell before, as `memory_after` says."""
    rng = np.random.default_rng(0)
    lag = rng.normal(size=(len(DWELLS), 3))
    memory = np.exp(-BEFORE / 0.3)[:, None, None] * rng.normal(size=(len(DWELLS), 3))
    table = lag_table(lag, memory)
    car = replace(vehicle(), lag=np.stack([table, table * planar.MIRROR]))
    at = DWELLS[TIMES[-1] > DWELLS][-1]
    i = int(np.flatnonzero(at == DWELLS)[0])
    for before in (0.2, 0.27, 0.42, 0.7, 1.1, 1.4, 3.0):
        expected = lag[i] + memory_after(memory, before)[i]
        near = car.lag_after(1, before, np.array([at - 0.01, at + 0.01]))
        assert car.lag_after(1, before, at) == pytest.approx(expected, abs=2 * np.abs(np.diff(near, axis=0)).max())
        assert car.lag_after(-1, before, at) == pytest.approx(car.lag_after(1, before, at) * planar.MIRROR)


def test_nothing_has_happened_at_a_flip_and_nothing_changes_after_settling() -> None:
    car = vehicle()
    for before in (None, 0.3, 2.0):
        assert car.lag_after(1, before, 0.0) == pytest.approx(np.zeros(3))
        assert car.lag_after(1, before, 50.0) == pytest.approx(car.lag_after(1, before, TIMES[-1]))


def test_the_longest_memory_is_none() -> None:
    car = vehicle()
    assert car.lag_after(1, float(BEFORE_KNOTS[-1]), 0.5) == pytest.approx(car.lag_after(1, 9.0, 0.5))


@pytest.mark.parametrize("seed", range(12))
def test_the_pivot_moves_as_a_slip_free_car(seed: int) -> None:
    """q = p − a e(φ) has no sideways velocity on any sequence of arcs."""
    rng = np.random.default_rng(seed)
    car = vehicle(lag=0.0)
    pose = rng.normal(size=3)
    for _ in range(10):
        sense = 1 if rng.random() < 0.5 else -1
        times = np.linspace(0, rng.uniform(0.5, 5), 2001)
        poses = planar.compose(pose, car.motion(sense, 1.0, times))
        q = planar.compose(poses, np.array([-car.pivot_distance, 0.0, 0.0]))
        velocity = np.diff(q[:, :2], axis=0)
        middle = (poses[1:, 2] + poses[:-1, 2]) / 2
        sideways = velocity[:, 1] * np.cos(middle) - velocity[:, 0] * np.sin(middle)
        assert np.abs(sideways).max() < 1e-13
        assert np.linalg.norm(velocity, axis=1).sum() == pytest.approx(car.twist[0, 0] * times[-1], rel=1e-6)
        pose = poses[-1]
