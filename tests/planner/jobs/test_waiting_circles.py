"""Waiting circles lead back to where they began, in the prediction and in the simulator."""

from __future__ import annotations

import math

import numpy as np
import pytest

from planner.goal.to_goal import to_goal
from planner.jobs.waiting_circles import WaitingCircle, circle_reference, with_circles
from planner.paths.path import circle
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.vehicle.calibration_table import CalibrationKnowledge
from sim.model.presets import PRESETS

CONTROL = PRESETS["paper-control"]


@pytest.fixture(scope="module")
def straight() -> Plan:
    return plan([[0, 0], [2.5, 0]], CONTROL)


@pytest.mark.parametrize("side", [1, -1])
def test_a_circle_ends_where_it_began(straight: Plan, side: int) -> None:
    reference = straight.declared.reference
    around = circle_reference(straight, WaitingCircle(60, side))
    assert around.q[0] == pytest.approx(reference.q[60])
    assert around.q[-1] == pytest.approx(around.q[0], abs=1e-9)
    assert around.p[-1] == pytest.approx(reference.p[60], abs=1e-9)
    assert around.heading[-1] - around.heading[0] == pytest.approx(side * math.tau)
    assert np.abs(around.curvature).max() * straight.tracked.vehicle.pivot_radius < 0.71


@pytest.mark.parametrize("place", [0, 60, -1])
def test_the_robot_follows_circles_anywhere_on_its_path(straight: Plan, place: int) -> None:
    index = place % len(straight.declared.reference.q)
    once = with_circles(straight, [WaitingCircle(index, 1)])
    twice = with_circles(straight, [WaitingCircle(index, 1), WaitingCircle(index, -1)])
    assert once.predicted_max < straight.predicted_max + 0.01
    assert twice.predicted_max < straight.predicted_max + 0.01
    longer = once.duration - straight.duration
    assert longer > 100
    assert twice.duration - once.duration == pytest.approx(longer, rel=0.03)
    assert once.poses[-1, :2] == pytest.approx(straight.poses[-1, :2], abs=0.05)
    assert (once.dwells[:-1] >= straight.minimum_dwell * 0.999).all()


def test_a_plan_without_circles_stays_as_it_is(straight: Plan) -> None:
    assert with_circles(straight, []) is straight


@pytest.mark.rest
def test_a_robot_with_a_goal_still_ends_there() -> None:
    trip = to_goal((0, 0, 0), (3, 1, 1), CONTROL)
    waiting = with_circles(trip.plan, [WaitingCircle(50, -1)], trip.goal)
    x, y, heading = waiting.poses[-1]
    assert (x, y) == pytest.approx((3, 1), abs=2e-3)
    assert math.remainder(heading - 1, math.tau) == pytest.approx(0, abs=2e-3)
    assert waiting.start == trip.plan.start


def test_a_closed_path_and_a_current() -> None:
    known = CalibrationKnowledge(current=(5e-5, 0.0))
    lap = plan(circle(1.5), CONTROL, knowledge=known)
    waiting = with_circles(lap, [WaitingCircle(100, 1)])
    assert waiting.predicted_max < lap.predicted_max + 0.03
    assert waiting.duration > lap.duration + 100
