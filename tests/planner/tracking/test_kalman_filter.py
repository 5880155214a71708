"""The tracker's estimate: its derivatives, against differences; late poses; numbers stay within bounds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from planner.paths.path import circle
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.tracking.guidance import TrackerGuidance
from planner.tracking.kalman_filter import MOST, STATES, Dwell, Estimate
from sim.mechanics import planar
from sim.model.presets import PRESETS

STATE = [0.3, -0.2, 1.1, 0.03, -0.02, 0.04, -0.05, 0.003, 2e-4, -1e-4, 0.02, -0.03, 0.2]
PAST = [Dwell(0.0, 1, None, 0.9), Dwell(0.9, -1, 0.9, 0.8), Dwell(1.7, 1, 0.8, 1.1)]
NOW = Dwell(2.8, -1, 1.1, 0.0)


@pytest.fixture(scope="module")
def planned() -> Plan:
    return plan(circle(2.0), PRESETS["paper-control"])


@pytest.fixture
def estimate(planned: Plan) -> Estimate:
    found = Estimate(planned, TrackerGuidance(planned), (0.01, 0.01))
    found.state = list(STATE)
    return found


def differences(estimate: Estimate, seen: Callable[[], np.ndarray]) -> np.ndarray:
    """Compute the derivatives (3, 10) by central differences."""
    columns = []
    for k in range(STATES):
        ends = []
        for step in (1e-5, -1e-5):
            estimate.state = list(STATE)
            estimate.state[k] += step
            ends.append(seen())
        columns.append((ends[0] - ends[1]) / 2e-5)
    estimate.state = list(STATE)
    return np.array(columns).T


@pytest.mark.parametrize("when", [3.4, 2.8, 2.1, 1.0, 0.2])
def test_derivatives_of_an_expected_pose(estimate: Estimate, when: float) -> None:
    expected = estimate.seen_from(when, NOW, PAST)
    assert expected is not None

    def seen() -> np.ndarray:
        again = estimate.seen_from(when, NOW, PAST)
        assert again is not None
        return np.array(again[0])

    assert np.array(expected[1]) == pytest.approx(differences(estimate, seen), abs=1e-8)


def test_counting_back_and_going_forward_end_at_the_same_pose(estimate: Estimate, planned: Plan) -> None:
    """The other side: the vehicle of the plan with the learned numbers, composed forward."""
    expected = estimate.seen_from(0.2, NOW, PAST)
    assert expected is not None
    state = np.array(STATE)
    car = planned.tracked.vehicle
    twist = car.twist * np.array([[1.04, 0.95, 1.03], [1.04, 0.95, 0.98]])

    def change(dwell: Dwell, time: float) -> np.ndarray:
        lag = car.lag_after(dwell.sense, dwell.before, time) + np.array([0, 0, dwell.sense * state[7]])
        return planar.compose(lag, planar.arc(twist[0 if dwell.sense > 0 else 1], time))

    def drift(time: float) -> np.ndarray:
        return np.append(state[8:10] * time, 0.0)  # the current moves the robot in the lab

    marker = planar.inverse(state[10:])  # from the marker to the head's centre
    pose = planar.compose(
        planar.compose(np.array(expected[0]), marker) - drift(0.2), planar.inverse(change(PAST[0], 0.2))
    )
    for dwell in PAST:
        pose = planar.compose(pose, change(dwell, dwell.length)) + drift(dwell.length)
    assert pose == pytest.approx(state[:3], abs=1e-9)


def test_a_pose_from_before_the_kept_dwells_is_not_used(estimate: Estimate) -> None:
    assert estimate.seen_from(0.5, NOW, PAST[1:]) is None


def test_an_update_is_that_of_the_textbook(estimate: Estimate) -> None:
    """One pose by three single numbers equals one step with matrices."""
    P = np.array(estimate.covariance)
    found = estimate.seen_from(3.0, NOW, PAST)
    assert found is not None
    H = np.array(found[1])
    left = (0.01, -0.02, 0.015)
    size = estimate.update(left, found[1], 1e9)
    S = H @ P @ H.T + np.diag([1e-4] * 3)
    gain = P @ H.T @ np.linalg.inv(S)
    assert size == pytest.approx(float(np.array(left) @ np.linalg.solve(S, left)), rel=1e-9)
    assert np.array(estimate.state) == pytest.approx(np.array(STATE) + gain @ left, abs=1e-12)
    assert np.array(estimate.covariance) == pytest.approx(P - gain @ H @ P, abs=1e-12)


def test_the_guidance_swims_with_the_learned_robot(estimate: Estimate) -> None:
    """The current among it, with its sign: guidance and filter expect one pose at the end of a dwell."""
    learned = estimate._law
    estimate.apply()
    for dwell in PAST:
        expected = estimate.moved(estimate.pose, dwell)
        found = learned.pose_after(estimate.pose, dwell.sense, dwell.before, dwell.length)
        assert found == pytest.approx(expected, abs=1e-12)
    speed = estimate._speed * (1 + STATE[5])
    assert learned._drift[1:] == pytest.approx((STATE[8] / speed, STATE[9] / speed))


def test_numbers_stay_within_bounds(estimate: Estimate) -> None:
    H = [[0.0] * STATES for _ in range(3)]
    H[0][3] = H[1][4] = H[2][5] = 1.0
    estimate.update((9.0, -9.0, 9.0), H, 1e9)
    assert [estimate.state[3], estimate.state[4], estimate.state[5]] == pytest.approx([MOST[0], -MOST[1], MOST[2]])
