"""The vehicle with memory: against direct formulas, and the follower's plain numbers against it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner.paths.path import circle
from planner.paths.tractrix import Drift, reference
from planner.planning.schedule import follow
from planner.planning.stated_error import look_ahead
from planner.vehicle.rollout import Switches, poses_at_flips, trace
from planner.vehicle.vehicle import BEFORE_KNOTS, TIMES, lag_table
from planner.vehicle.zigzag import zigzag
from sim.mechanics import planar
from sim.model.response import BEFORE, DWELLS, memory_after
from tests.planner.vehicles import plain_guidance, vehicle


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


@pytest.mark.parametrize("bias", [0.0, 0.2])
def test_the_schedule_predicts_what_the_vehicle_does(bias: float) -> None:
    """Poses found switch by switch in plain numbers, against the chain of pose changes, current included."""
    car = replace(vehicle(bias=bias), current=np.array([0.001, -0.0005]))
    ref = reference(circle(2.0), car.pivot_distance + 0.3, 0.02, Drift(0.0, (0.05, -0.03)))
    switches = follow(ref, car, plain_guidance(car, 0.4, look_ahead(car, 0.3)), 0.3)
    pose = switches.poses[0]
    before = None
    for i, dwell in enumerate(switches.dwells[:40]):
        pose = planar.compose(pose, car.motion(switches.first_direction * (-1) ** i, before, dwell))
        pose = pose + np.append(car.current * dwell, 0.0)
        assert switches.poses[i + 1] == pytest.approx(pose, abs=1e-9)
        before = dwell
    assert poses_at_flips(car, switches) == pytest.approx(switches.poses, abs=1e-8)
    assert trace(car, switches, 0.0)[::8] == pytest.approx(switches.poses[:, :2], abs=1e-8)


def test_the_longest_memory_is_none() -> None:
    car = vehicle()
    assert car.lag_after(1, float(BEFORE_KNOTS[-1]), 0.5) == pytest.approx(car.lag_after(1, 9.0, 0.5))


def test_an_even_robot_swims_straight_and_a_lopsided_one_at_an_angle() -> None:
    even, odd = zigzag(vehicle(), 0.8), zigzag(vehicle(bias=0.3), 0.8)
    assert even.drift == pytest.approx(0.0, abs=1e-12)
    assert even.dwells == pytest.approx((0.8, 0.8))
    assert odd.dwells[0] == pytest.approx(0.8)
    assert odd.dwells[1] / odd.dwells[0] == pytest.approx(1.3 / 0.7, rel=0.02)
    # With (T+, T−) that turn as far, the mean sideways speed is (Ω− v+ − Ω+ v−)/(Ω+ + Ω−), v without lags.
    assert odd.drift == pytest.approx(0.0424 * (0.7 - 1.3) / 2, rel=0.05)


def test_the_zigzag_is_that_of_arcs() -> None:
    """Without lags: net speed V cos θ sinc(ΩT/2), and the same arcs seen from their mean line."""
    car = vehicle(lag=0.0)
    found = zigzag(car, 2.0)
    angle = 0.0489 * 2.0 / 2
    assert found.net_speed == pytest.approx(0.0179 * np.sin(angle) / angle, rel=1e-6)
    pair = Switches(1, np.array([2.0, 2.0]), np.array([[0.0, 0.0, -angle]]))
    across = trace(car, pair, 0.0, samples=400)[:-1, 1]
    assert found.rms == pytest.approx(across.std(), rel=0.02)
