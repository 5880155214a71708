"""The tracker's guidance: its reference changes with the drift that the tracker learns."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from planner.paths.path import Path2D
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.tracking.guidance import LearnedDrift, TrackerGuidance
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.dwell_choice import Objective
from planner.vehicle.vehicle import Vehicle
from sim.model.presets import PRESETS
from tests.planner.compiled import CompiledTracker
from tests.planner.vehicles import PROMPT, drawn_vehicle, root_mean_square

ROBOT = PRESETS["paper-control"]
CURRENT = (0.0, 0.0015)  # l per time unit, a tenth of the net speed


@cache
def eight(current: tuple[float, float] = (0.0, 0.0)) -> Plan:
    t = np.linspace(0, 2 * math.pi, 401)[:-1]
    path = Path2D.of(np.stack([2.05 * np.sin(t), 1.13 * np.sin(2 * t)], 1), closed=True)
    x, y = (value * ROBOT.tail_length / ROBOT.time_scale for value in current)
    return plan(path, ROBOT, minimum_dwell=0.7, knowledge=CalibrationKnowledge(current=(x, y)))


def test_a_learned_current_is_used() -> None:
    """It was learned to 1 %, yet the error stayed at three times that of a plan that knows it."""
    truth = replace(eight().tracked.vehicle, current=np.array(CURRENT))
    learning = swim(Tracker(eight()), eight(), truth, PROMPT).distance
    knowing = swim(Tracker(eight(CURRENT)), eight(CURRENT), truth, PROMPT).distance
    half = len(learning) // 2
    assert root_mean_square(knowing) < 0.015
    assert root_mean_square(learning[half:]) < 1.2 * root_mean_square(knowing)
    assert root_mean_square(learning) < 1.5 * root_mean_square(knowing)


def test_a_drift_that_the_plan_knows_does_not_turn_the_reference() -> None:
    planned = eight(CURRENT)
    guidance = TrackerGuidance(planned)
    for place in (50, 200, 350):
        guidance.place = place
        guidance.integrate(planned.start, 1)
    assert guidance._lean == pytest.approx(0.0, abs=1e-15)


def test_on_a_straight_line_the_reference_turns_against_the_slip() -> None:
    """The other side: the robot heads into the current by the angle at which the two velocities add up."""
    share = np.linspace(0, 1, 100)
    line = plan(np.stack([12 * share, 0 * share], 1), ROBOT, minimum_dwell=0.7)
    guidance = TrackerGuidance(line)
    guidance.update_drift(LearnedDrift(0.0, 0.0, 0.2))
    for x in np.linspace(0, 11, 300):
        guidance.integrate((float(x), 0.0, 0.0), 1)
    assert math.sin(-guidance._lean) == pytest.approx(0.2, rel=1e-3)


def drawn(planned: Plan, rng: np.random.Generator, current: float) -> Vehicle:
    """Draw a vehicle within the plan's uncertainty, and a current of this size."""
    angle = rng.uniform(0, 2 * math.pi)
    car = drawn_vehicle(planned.tracked.vehicle, rng)
    return replace(car, current=current * np.array([math.cos(angle), math.sin(angle)]))


@pytest.mark.parametrize("current", [0.0, 0.001])
def test_the_robot_is_as_near_to_its_path_as_the_tracker_says(current: float) -> None:
    """It was in 73 % of the time; in a current of a tenth of the net speed in half of it."""
    rng, within = np.random.default_rng(3), []
    for seed in range(3):
        camera = replace(PROMPT, seed=seed)
        result = swim(Tracker(eight()), eight(), drawn(eight(), rng, current), camera)
        within.append(result.distance <= result.errors)
    assert 0.9 < np.concatenate(within).mean() < 0.98


@pytest.mark.rest
@pytest.mark.parametrize(("robot", "objective"), [("paper-control", "flips"), ("paper-triangle", "error")])
def test_the_same_where_the_swings_are_large(robot: str, objective: Objective, tmp_path: Path) -> None:
    """It was in 87 % of the time with few flips, and in 86 % on a wave of a robot with four tails."""
    share = np.linspace(0, 1, 200)
    wave = np.stack([6 * share, 0.8 * np.sin(7.5 * share)], 1)
    planned, rng, within = plan(wave, PRESETS[robot], objective=objective), np.random.default_rng(4), []
    tracker = CompiledTracker(planned, tmp_path)
    for current in (0.0, 0.001) * 4:
        tracker.restart()
        result = swim(tracker, planned, drawn(planned, rng, current), replace(PROMPT, seed=rng))
        within.append(result.distance <= result.errors)
    assert 0.9 < np.concatenate(within).mean() < 0.98
