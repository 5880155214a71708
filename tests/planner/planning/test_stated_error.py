"""The stated error, against vehicles drawn and carried through one by one, and its parts; with feedback, too."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from common.errors import InputError
from planner.guidance.line_of_sight import follow, look_ahead
from planner.paths.distance import distance_to
from planner.paths.path import Path2D, circle
from planner.paths.tractrix import Reference, reference
from planner.planning.request import Camera
from planner.planning.stated_error import (
    WOBBLE,
    ErrorGrowth,
    Predicted,
    error_growth,
    feedback_error,
    predicted_error,
    rms_in_time,
    stated_error,
)
from planner.vehicle.vehicle import BEFORE_KNOTS, TIMES, Mode, Rollout, Switches, Vehicle, roll_out
from sim.mechanics import planar
from sim.motion.replay import replay
from surrogate.table_file import load
from tests.oracles.unseen_robots import carried
from tests.planner.plans import planned as plan_of
from tests.planner.vehicles import plain_guidance, vehicle
from tracking.swim import swim
from tracking.tracker import Tracker

CIRCLE, LINE = circle(1.0), Path2D.of([[0, 0], [25, 0]])
JITTER = np.tile([0.0, 0.0, 1e-3], (2, len(TIMES), 1))  # of the lag, over the disc's phase
FLAT = np.full(41, 0.05)
DWELLS = np.full(10, 1.0)


def planned(car: Vehicle, path: Path2D) -> tuple[Switches, Reference, Rollout]:
    ref = reference(path, car.pivot_distance, 0.02)
    ahead = look_ahead(car, float(np.abs(ref.curvature).max()))
    switches = follow(ref, car, plain_guidance(car, 0.8, ahead))
    return switches, ref, roll_out(car, switches, 0.0)


def stated_for(car: Vehicle, switches: Switches, rollout: Rollout, error: Predicted) -> float:
    growth = error_growth(car, switches, rollout)
    return stated_error(growth, error)


def wavy(car: Vehicle) -> Vehicle:
    """Give a vehicle errors of heading that vary with the dwell, mirrored between the directions."""
    rise = np.minimum(TIMES / 0.2, 1.0)
    modes = []
    for waves in (0.0, 1.0, 2.0):
        curve = np.zeros((2, len(BEFORE_KNOTS), len(TIMES), 3))
        curve[0, ..., 2] = 4e-4 * rise * np.cos(waves * np.pi * TIMES)
        curve[1, ..., 2] = -curve[0, ..., 2]
        modes.append(Mode(f"table: {waves:g}", np.zeros((2, 3)), curve))
    return replace(car, modes=tuple(modes))


@pytest.mark.parametrize(
    ("path", "car"),
    [
        pytest.param(CIRCLE, vehicle(errors=4.0), id="circle"),
        pytest.param(CIRCLE, vehicle(), id="circle, certain", marks=pytest.mark.rest),
        pytest.param(LINE, vehicle(), id="line, certain", marks=pytest.mark.rates),
        pytest.param(LINE, vehicle(errors=4.0), id="line", marks=pytest.mark.rates),
        pytest.param(circle(2.0), wavy(vehicle()), id="response", marks=pytest.mark.rest),
    ],
)
def test_it_is_the_quantile_over_drawn_vehicles(path: Path2D, car: Vehicle) -> None:
    """Errors of twists, and errors of the response, which add up on curves."""
    switches, ref, rollout = planned(car, path)
    error = predicted_error(ref.p, rollout.track, closed=path.closed)
    stated = stated_for(car, switches, rollout, error)
    rng = np.random.default_rng(5)
    worst = [distance_to(ref.p, roll_out(car.drawn(rng), switches, 0.0).track).max() for _ in range(300)]
    assert np.mean(np.array(worst) + WOBBLE <= stated) == pytest.approx(0.95, abs=0.035)
    assert stated > (2 if car.modes[0].lag is not None else 1) * error.largest


def test_without_uncertainty_it_is_the_predicted_error_and_the_motion_within_a_revolution() -> None:
    car = replace(vehicle(), modes=())
    switches, ref, rollout = planned(car, circle(2.0))
    error = predicted_error(ref.p, rollout.track, closed=True)
    assert stated_for(car, switches, rollout, error) == pytest.approx(error.largest + WOBBLE)


@pytest.mark.parametrize(("closed", "expected"), [(False, 1.645), (True, 0.0)])
def test_a_robot_that_swims_past_an_open_end_is_off_its_path(closed: bool, expected: float) -> None:
    """One mode, a way along the path that is too long or too short: half of the robots stop before the end."""
    x = np.arange(3.0)
    along = np.stack([0.1 * x, 0 * x], 1)[:, None]
    growth = ErrorGrowth(np.arange(3), along, np.zeros((3, 1)))
    predicted = Predicted(np.zeros(3), np.zeros(3), np.tile([0.0, 1.0], (3, 1)), closed)
    assert stated_error(growth, predicted) == pytest.approx(expected * 0.2, rel=0.15, abs=0.01)


def test_phases_that_differ_average_out() -> None:
    """With unequal dwells, the disc flips at ever other phases."""
    car = replace(vehicle(errors=0.0), spread=JITTER, phase_rate=np.array([40.0, -40.0]))
    switches, ref, rollout = planned(car, circle(2.0))
    error = predicted_error(ref.p, rollout.track, closed=True)
    excess = stated_for(car, switches, rollout, error) - error.largest
    returning = replace(car, phase_rate=np.zeros(2))
    assert 0 < excess < 0.1 * (stated_for(returning, switches, rollout, error) - error.largest)


def test_the_modes_of_the_phase_are_lags() -> None:
    """A deviation is that of a vehicle with other lags at each flip."""
    car = replace(vehicle(errors=0.0), spread=JITTER, phase_rate=np.array([3.0, -3.1]), modes=())
    dwells = np.array([0.5, 0.7, 0.4, 0.9, 0.6])
    switches = Switches(-1, dwells, np.zeros((6, 3)))
    rollout = roll_out(car, switches, 0.0)
    growth = error_growth(car, switches, rollout)
    phase = np.concatenate([[0.0], np.cumsum(dwells * [-3.1, 3.0, -3.1, 3.0, -3.1])[:-1]])
    second = np.arange(5) % 2 == 0  # dwells of the second direction
    waves = [~second * np.cos(phase), ~second * np.sin(phase), second * np.cos(phase), second * np.sin(phase)]
    for mode, wave in enumerate(waves):
        pose, heading = np.zeros(3), 0.0
        for i in range(5):
            arc = planar.arc(car.twist[int(second[i])], dwells[i])
            lag = planar.compose(rollout.changes[i], planar.inverse(arc))
            pose = planar.compose(pose, planar.compose(lag + np.array([0.0, 0.0, 1e-3 * wave[i]]), arc))
            heading += 1e-3 * wave[i]
        assert growth.turned[-1, mode] == pytest.approx(heading, rel=1e-9, abs=1e-15)
        assert growth.deviation[-1, mode] == pytest.approx(pose[:2] - rollout.poses[-1, :2], abs=3e-7)


@pytest.mark.rest
def test_a_straight_line_of_two_tails_bends_as_stated() -> None:
    """With equal dwells the disc's phase adds to the heading at each pair."""
    result = plan_of(((0.0, 0.0), (12.0, 0.0)), dwell=1.8)
    track = replay(result.schedule())
    aside = np.abs(track["y_over_l"]).max()
    assert 1.5 * result.predicted_max < aside < result.stated_error


def test_the_rms_error_is_a_mean_over_time() -> None:
    """Three time units at a distance of 1, one at 3."""
    distance = np.array([0.0, 1.0, 1.0, 3.0, 3.0])
    assert rms_in_time(distance, np.array([3.0, 1.0])) == pytest.approx(math.sqrt((3 * 1 + 1 * 9) / 4))


@pytest.mark.rates
def test_it_holds_for_unseen_robots_and_paths() -> None:
    """24 robots, most with long schedules. With 95 % coverage, five miss in one of 200."""
    lookup = load()
    plans = []
    for seed in range(7000, 7024):
        with suppress(InputError):  # a robot that cannot follow its path
            plans.append(carried(seed, lookup))
    assert len(plans) >= 20
    assert sum(not one.held for one in plans) <= 4
    assert np.median([one.own_stated / one.found for one in plans]) < 1.6


@pytest.mark.parametrize(
    "camera",
    [
        Camera(),
        pytest.param(Camera(noise=(0.003, 0.003), delay_s=0.0, lost=0.0), marks=pytest.mark.rest),
        pytest.param(Camera(noise=(0.03, 0.03)), marks=pytest.mark.rest),
    ],
    ids=["documented", "fine", "rough"],
)
def test_the_tracker_keeps_it_in_95_percent_of_the_time(camera: Camera) -> None:
    result = plan_of("circle:1.6l", "paper-triangle", camera=camera)
    tracker = Tracker(result, noise=camera.noise)
    assert swim(tracker, result.tracked.vehicle, camera).within(result.feedback_error) > 0.95


def test_a_worse_camera_means_a_larger_error() -> None:
    """Noise, rate, delay and losses count; poses older than the tracker remembers are worth nothing."""
    best = feedback_error(FLAT, DWELLS, 0.02, 2.0, Camera(), 1.0)
    for worse in ({"noise": (0.02, 0.02)}, {"every_s": 5.0}, {"delay_s": 10.0}, {"lost": 0.8}):
        assert feedback_error(FLAT, DWELLS, 0.02, 2.0, Camera(**worse), 1.0) > 1.02 * best  # type: ignore[arg-type]
    for useless in (Camera(delay_s=30.0), Camera(lost=1.0)):
        assert feedback_error(FLAT, DWELLS, 0.02, 2.0, useless, 1.0) == 1.0
