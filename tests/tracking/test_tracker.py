"""The tracker stays on the path with robots that differ from the model; its clock and its Kalman filter."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from planner.guidance import law
from planner.planning.plan import Plan
from planner.planning.request import Camera
from planner.vehicle.vehicle import Vehicle
from sim.mechanics import planar
from sim.mechanics.planar import POSE
from tests.planner.plans import planned as plan_of
from tests.planner.vehicles import PROMPT
from tracking import tracker
from tracking.guidance import TrackerGuidance
from tracking.kalman_filter import MOST, STATES, Dwell, Estimate
from tracking.swim import swim
from tracking.tracker import CONFIRMED, EARLY, LATE, Clock, Tracker

pytestmark = pytest.mark.slow

REST = pytest.mark.rest


def planned() -> Plan:
    return plan_of("circle:1.2l", minimum_dwell=0.7)


def changed(*, left: float = 1.0, right: float = 1.0, speed: float = 1.0, current: float = 0.0) -> Vehicle:
    car = planned().tracked.vehicle
    twist = car.twist * np.array([[speed, speed, left], [speed, speed, right]])
    return replace(car, twist=twist, current=np.array([current, 0.0]))


ROBOTS: dict[str, dict[str, float]] = {
    "as planned": {},
    "5 % faster turns": {"left": 1.05, "right": 1.05},
    "5 % slower": {"speed": 0.95},
    "3 % asymmetry": {"left": 1.03, "right": 0.97},
    "current": {"current": 0.0006},
}


@pytest.mark.parametrize(
    ("name", "seeds"), [("current", 1), *(pytest.param(name, 3, marks=REST) for name in ROBOTS)]
)
def test_robots_that_differ_stay_on_the_path(name: str, seeds: int) -> None:
    cameras = [replace(PROMPT, seed=seed) for seed in range(seeds)]
    swims = [swim(Tracker(planned()), changed(**ROBOTS[name]), camera) for camera in cameras]
    assert np.mean([each.rms() for each in swims]) < 0.026
    for each in swims:
        assert min(each.dwells[:-1]) >= planned().minimum_dwell * (1 - 1e-9)


@pytest.mark.parametrize(
    "camera",
    [
        pytest.param(replace(PROMPT, delay_s=2.0), marks=REST),
        pytest.param(replace(PROMPT, lost=0.2), marks=REST),
        pytest.param(replace(PROMPT, wrong=0.1), marks=REST),
        replace(PROMPT, every_s=0.3, delay_s=1.0, lost=0.5, wrong=0.05),
    ],
    ids=["late", "gaps", "wrong", "all"],
)
def test_bad_cameras_do_little_harm(camera: Camera) -> None:
    """Without any camera the same robot is lost: what feedback is worth."""
    truth = changed(**ROBOTS["3 % asymmetry"])
    seen, blind = (swim(Tracker(planned()), truth, each) for each in (camera, replace(PROMPT, lost=1.0)))
    assert seen.rms() < 0.03
    assert blind.rms() > 0.09


def test_it_learns_the_robot() -> None:
    """On a circle of many small swings the difference of the turns shows at once; their mean hardly does."""
    tracker = Tracker(planned())
    swim(tracker, changed(left=1.04, right=0.99, speed=0.97), PROMPT)
    assert tracker.learned["yaw rate, left"] - tracker.learned["yaw rate, right"] == pytest.approx(0.05, abs=0.02)
    assert tracker.learned["surge"] == pytest.approx(-0.03, abs=0.02)


def test_an_effect_that_starts_halfway_is_learned() -> None:
    tracker = Tracker(planned())
    result = swim(tracker, changed(), PROMPT, later=changed(left=1.06, right=0.94))
    assert result.rms() < 0.05
    assert tracker.learned["yaw rate, left"] - tracker.learned["yaw rate, right"] > 0.03


@pytest.mark.parametrize(
    "marker",
    [
        (0.05, -0.05, -0.2),
        *(pytest.param(pose, marks=REST) for pose in ((0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.35))),
    ],
    ids=["all", "forward", "left", "askew"],
)
def test_a_marker_off_centre_or_askew_is_found(marker: POSE) -> None:
    tracker = Tracker(planned())
    result = swim(tracker, changed(), replace(PROMPT, marker=marker))
    assert result.rms() < 0.025
    assert not result.alarms
    found = [tracker.learned[f"marker, {name}"] for name in ("forward", "left", "angle")]
    assert found == pytest.approx(marker, abs=0.025)


@REST
def test_alarms_are_rare_for_a_robot_of_the_model_and_come_for_another() -> None:
    for seed in range(4):
        camera = replace(PROMPT, seed=seed)
        assert not swim(Tracker(planned()), changed(left=1.02), camera).alarms
    jerky = replace(changed(), lag=changed().lag + np.array([0.03, 0.0, 0.0]), twist=1.3 * changed().twist)
    assert swim(Tracker(planned()), jerky, PROMPT).alarms


def test_wrong_poses_are_no_alarm() -> None:
    """A camera that is wrong now and then says nothing of the robot."""
    assert not swim(Tracker(planned()), changed(), replace(PROMPT, wrong=0.1)).alarms


def test_a_pose_at_the_time_of_a_flip_announces_the_next_flip() -> None:
    """A call at that time counts as the flip, so the motor turns as ordered; dwells of four units end at poses."""
    line = plan_of(((0.0, 0.0), (3.0, 0.0)), objective="flips")
    distance = swim(Tracker(line), line.tracked.vehicle, PROMPT).distance
    assert distance.max() < line.predicted_max + 0.04
    tracker = Tracker(line)
    first = tracker.command
    second = tracker.update(first.flip_at, line.start, first.flip_at - 1.0)
    assert (second.direction, second.flip_at > first.flip_at + 3.9) == (-first.direction, True)


@pytest.mark.parametrize("late", [0.0, 0.01])
def test_no_flip_just_before_the_end(late: float) -> None:
    """Where the path ends at a flip, the motor is not told to turn the other way for no time at all."""
    tracker = Tracker(plan_of("square:2l", minimum_dwell=0.6, point="head_tip"))
    command = tracker.command
    while not command.finished:
        last, command = command, tracker.update(command.flip_at + late)
        assert command.finished or command.flip_at > last.flip_at + late


VALUES = st.one_of(st.floats(-1e3, 1e3), st.sampled_from([math.nan, math.inf, -math.inf, 1e300, -1e300, 0.0]))


@given(st.lists(st.tuples(st.one_of(st.floats(-5, 20), VALUES), VALUES, VALUES, VALUES, VALUES), max_size=60))
@settings(max_examples=30, deadline=None)
def test_it_never_flips_before_the_shortest_dwell(events: list[tuple[float, float, float, float, float]]) -> None:
    """Any numbers: times that jump and go back, poses from anywhere."""
    tracker = Tracker(planned())
    now, last, direction, began = 0.0, tracker.command, tracker.command.direction, 0.0
    for step, x, y, heading, seen in events:
        now += step if math.isfinite(step) else 0.0
        announced = last.flip_at - tracker._clock.set_by  # in running time: the clock may be set
        command = tracker.update(step if not math.isfinite(step) else now, (x, y, heading), seen)
        if command.finished:
            break
        if command.direction != direction:  # the flip that was announced has happened
            assert announced - began >= planned().minimum_dwell * (1 - 1e-12)
            direction, began = command.direction, announced
        assert math.isfinite(command.flip_at)
        assert command.flip_at - tracker._clock.set_by - began >= planned().minimum_dwell * (1 - 1e-12)
        last = command


def test_poses_at_both_ends_of_the_numbers_are_no_poses() -> None:
    tracker, without = Tracker(planned()), Tracker(planned())
    for k in range(40):
        assert tracker.update(k / 4, (0.0, 0.0, 1.7e308 * (-1) ** k)) == without.update(k / 4)


def test_the_bound_is_a_quantile() -> None:
    """Against random draws: from no swing at all to a swing alone, on both sides of the path and on one."""
    rng = np.random.default_rng(2)
    uniform, normal = rng.random(200_000), rng.standard_normal(200_000)
    for first, last, spread in ((0.0, 0.0, 1.0), (-1.0, 1.0, 0.0), (-1.0, 1.0, 0.4), (1.0, 2.0, 0.0),
                                (1.0, 2.0, 0.5), (-0.1, 1.0, 0.2), (-3.0, -2.0, 1.0)):  # fmt: skip
        drawn = np.abs(first + uniform * (last - first) + spread * normal)
        assert 0.935 < np.mean(drawn <= tracker.bound(first, last, spread)) < 0.955
        assert tracker.bound(-first, -last, spread) == tracker.bound(first, last, spread)


def test_the_gates_are_quantiles() -> None:
    assert pytest.approx(chi2.ppf(1 - tracker.FALSE_ALARM, 3 * tracker.WINDOW), rel=1e-12) == tracker.ALARM_AT
    assert pytest.approx(chi2.ppf(0.9999, 3), rel=1e-12) == tracker.GATE


def test_a_jump_is_refused_until_it_is_confirmed() -> None:
    clock = Clock(0.0)
    assert clock.tell(1.0, 2.0) == 0.0
    for _ in range(5):
        assert clock.tell(300.0, 2.0) == 0.0  # the same message again confirms nothing
        assert clock.now == 1.0
    assert [clock.tell(301.0 + k, 2.0) for k in range(CONFIRMED - 1)] == [0.0, 299.0]
    assert clock.now == 302.0


@pytest.mark.parametrize("now", [math.nan, math.inf, -50.0, 2.1 + LATE])
def test_times_that_cannot_be_are_taken_for_the_last_one(now: float) -> None:
    clock = Clock(1.0)
    assert clock.tell(now, 2.0) == 0.0
    assert clock.now == 1.0


def test_late_messages_are_taken_for_the_last_time() -> None:
    """They overtook each other on the way; however many there are, they do not set the clock back."""
    clock = Clock(5.0)
    for k in range(2 * CONFIRMED):
        assert clock.tell(5.0 - EARLY + 0.1 * k, 6.0) == 0.0
        assert (clock.now, clock.believed) == (5.0, True)
    clock.tell(4.9 - EARLY, 6.0)
    assert not clock.believed


@pytest.mark.parametrize("jump", [140.0, -140.0], ids=["forward", "back"])
@pytest.mark.parametrize("lasts", [1, 1000], ids=["one message", "for good"])
def test_the_flips_go_on(jump: float, lasts: int) -> None:
    tracker = Tracker(plan_of())
    flips, direction = [], tracker.command.direction
    for k in range(200):
        now, jumped = 0.25 * k, 40 <= k < 40 + lasts
        command = tracker.update(now + (jump if jumped else 0.0))
        if command.direction != direction:
            flips.append(now)
            direction = command.direction
    gaps = [late - early for early, late in pairwise(flips)]
    assert len(gaps) > 40
    assert max(gaps) < 3.0
    assert min(gaps) > 0.5


STATE = [0.3, -0.2, 1.1, 0.03, -0.02, 0.04, -0.05, 0.003, 2e-4, -1e-4, 0.02, -0.03, 0.2]
PAST = [Dwell(0.0, 1, law.REST, 0.9), Dwell(0.9, -1, 0.9, 0.8), Dwell(1.7, 1, 0.8, 1.1)]
NOW = Dwell(2.8, -1, 1.1, 0.0)


@pytest.fixture
def estimate() -> Estimate:
    found = Estimate(planned(), TrackerGuidance(planned()), (0.01, 0.01))
    found.state = np.array(STATE)
    return found


def differences(estimate: Estimate, seen: Callable[[], np.ndarray]) -> np.ndarray:
    """Compute the derivatives (3, 13) by central differences."""
    columns = []
    for k in range(STATES):
        ends = []
        for step in (1e-5, -1e-5):
            estimate.state = np.array(STATE)
            estimate.state[k] += step
            ends.append(seen())
        columns.append((ends[0] - ends[1]) / 2e-5)
    estimate.state = np.array(STATE)
    return np.array(columns).T


def test_the_covariance_stays_one_over_many_exact_poses() -> None:
    """Rounding must not make it asymmetric or negative; an estimate of the best poses is the first to fail."""
    estimate = Estimate(planned(), TrackerGuidance(planned()), (0.003, 0.003))
    for flip in range(300):
        dwell = Dwell(0.0, 1 if flip % 2 == 0 else -1, 1.1, 1.1)
        for when in (0.3, 0.7, 1.1):
            seen = estimate.seen_from(when, dwell, [])
            assert seen is not None
            estimate.update((0.0, 0.0, 0.0), seen[1], math.inf)
        estimate.advance(dwell)
    asymmetry = np.abs(estimate.covariance - estimate.covariance.T).max()
    assert asymmetry < 1e-12 * np.abs(estimate.covariance).max()
    assert np.linalg.eigvalsh(estimate.covariance).min() > 0


@pytest.mark.parametrize("when", [3.4, 2.8, 1.0, 0.2])
def test_derivatives_of_an_expected_pose(estimate: Estimate, when: float) -> None:
    expected = estimate.seen_from(when, NOW, PAST)
    assert expected is not None

    def seen() -> np.ndarray:
        again = estimate.seen_from(when, NOW, PAST)
        assert again is not None
        return np.array(again[0])

    assert expected[1] == pytest.approx(differences(estimate, seen), abs=1e-8)
    assert estimate.seen_from(0.5, NOW, PAST[1:]) is None  # before the dwells that are kept


def test_counting_back_and_going_forward_end_at_the_same_pose(estimate: Estimate) -> None:
    """The other side: the vehicle of the plan with the learned numbers, composed forward."""
    expected = estimate.seen_from(0.2, NOW, PAST)
    assert expected is not None
    state = np.array(STATE)
    car = planned().tracked.vehicle
    twist = car.twist * np.array([[1.04, 0.95, 1.03], [1.04, 0.95, 0.98]])

    def change(dwell: Dwell, time: float) -> np.ndarray:
        before = None if math.isnan(dwell.before) else dwell.before
        lag = car.lag_after(dwell.sense, before, time) + np.array([0, 0, dwell.sense * state[7]])
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


def test_an_update_is_that_of_three_numbers_one_after_the_other(estimate: Estimate) -> None:
    P, moved, size, left = estimate.covariance.copy(), np.zeros(STATES), 0.0, (0.01, -0.02, 0.015)
    found = estimate.seen_from(3.0, NOW, PAST)
    assert found is not None
    for h, residual in zip(found[1], left, strict=True):
        gain, innovation = P @ h, residual - h @ moved
        spread = h @ gain + 1e-4
        size += innovation**2 / spread
        moved += gain * innovation / spread
        P = P - np.outer(gain, gain) / spread
    assert estimate.update(left, found[1], 1e9) == pytest.approx(size, rel=1e-9)
    assert estimate.state == pytest.approx(np.array(STATE) + moved, abs=1e-12)
    assert estimate.covariance == pytest.approx(P, abs=1e-12)


def test_the_guidance_swims_with_the_learned_robot(estimate: Estimate) -> None:
    """The current among it, with its sign: guidance and filter expect one pose at the end of a dwell."""
    learned = estimate._law
    estimate.apply()
    for dwell in PAST:
        expected = estimate.moved(estimate.pose, dwell)
        found = learned.pose_after(estimate.pose, dwell.sense, dwell.before, dwell.length)
        assert found == pytest.approx(expected, abs=1e-12)
    speed = estimate._speed * (1 + STATE[5])
    assert learned._drift.current == pytest.approx((STATE[8] / speed, STATE[9] / speed))


def test_numbers_stay_within_bounds(estimate: Estimate) -> None:
    H = np.eye(3, STATES, 3)
    estimate.update((9.0, -9.0, 9.0), H, 1e9)
    assert estimate.state[3:6] == pytest.approx([MOST[0], -MOST[1], MOST[2]])
