"""Plans arrive when they are asked to; waiting circles lead back to where they began."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.files.saved_plan import restore_plan
from planner.files.tracking_error import tracking_error
from planner.goal.arrive import EXACT
from planner.jobs.arrival_plan import plan_arrival
from planner.jobs.waiting_circles import WaitingCircle, circle_reference, with_circles
from planner.paths.obstacles import Circle, FreeSpace
from planner.paths.path import Path2D, circle
from planner.planning.plan import make_plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from sim.io.errors import InputError, run_command
from sim.motion.replay import replay
from tests.planner.plans import planned, tracked, trip
from tests.planner.vehicles import FINE
from tests.shared import shared

BENT = Path2D.of([[0.0, 0.0], [2.0, 0.0], [3.5, 1.5]])
FEW = PlanRequest(dwell=2.03)  # no flip is at the time of a picture


@shared
def waiting() -> Plan:
    """Plan to arrive after 1.9 times the time that the path takes."""
    own = make_plan(BENT, tracked(), FEW)
    return plan_arrival(BENT, tracked(), FEW, 1.9 * float(own.seconds.sum()))


def check_arrival(plan: Plan) -> None:
    assert plan.arrival is not None
    missed = abs(plan.duration - plan.arrival.wished)
    assert missed <= max(EXACT * plan.arrival.wished, min(plan.straight.dwells) / 2)


@pytest.mark.parametrize("share", [1.0, 1.5])
def test_dwells_decide_when_a_plan_arrives(share: float) -> None:
    fastest = make_plan(BENT, tracked(), PlanRequest(objective="time"))
    plan = plan_arrival(BENT, tracked(), PlanRequest(), share * float(fastest.seconds.sum()))
    assert plan.arrival is not None
    assert plan.arrival.fastest == pytest.approx(fastest.duration)
    check_arrival(plan)
    assert plan.declared.swing is None
    assert "as asked" in repr(plan)


def test_circles_take_time_where_dwells_do_not_suffice() -> None:
    plan = waiting()
    check_arrival(plan)
    assert plan.declared.swing is not None
    assert plan.declared.swing.circles >= 1
    assert plan.declared.missed < 0.1  # circles leave nothing of the path out
    assert plan.predicted_max < 0.15
    content = plan.to_dict()["arrival"]
    assert content["swing"] == list(plan.declared.swing)
    restored = restore_plan(plan.to_dict())
    assert restored.arrival == pytest.approx(plan.arrival)
    assert restored.declared.swing == plan.declared.swing
    assert content["wished_s"] == pytest.approx(float(plan.seconds.sum()), rel=0.01)


def test_a_swing_takes_less_time_than_a_circle() -> None:
    own = make_plan(BENT, tracked(), FEW)
    plan = plan_arrival(BENT, tracked(), FEW, 1.2 * float(own.seconds.sum()))
    check_arrival(plan)
    assert plan.declared.swing is not None
    assert plan.declared.swing.circles == 0


def test_circles_keep_clear_of_obstacles() -> None:
    space = FreeSpace.of([Circle(3.5, 0.3, 0.3)])
    own = make_plan(BENT, tracked(), FEW)
    plan = plan_arrival(BENT, tracked(), FEW, 2.2 * float(own.seconds.sum()), space)
    check_arrival(plan)
    assert plan.kept_clear is not None
    assert plan.kept_clear.clearance > 0
    assert plan.kept_clear.margin >= plan.stated_error


@pytest.mark.rest
def test_the_simulator_follows_swings() -> None:
    plan = waiting()
    track = replay([plan.schedule()])[0]
    assert float(track["time_s"].iloc[-1]) == pytest.approx(float(plan.seconds.sum()))
    error = tracking_error(plan.to_dict(), track)
    assert error.largest < 1.1 * plan.stated_error  # which 95 % of robots keep
    end = track[["x_over_l", "y_over_l"]].iloc[-1].to_numpy(float)
    assert np.hypot(*(end - BENT.points[-1])) < 2 * plan.stated_error


def test_a_tracked_robot_swims_the_circles_and_arrives() -> None:
    car = tracked().vehicle
    result = swim(Tracker(waiting()), waiting(), replace(car, twist=car.twist * np.array([1.02, 1.0, 1.02])), FINE)
    assert result.finished
    assert result.distance.max() < 0.2
    assert result.times[-1] == pytest.approx(waiting().duration, rel=0.03)  # a robot that is 2 % faster


def test_the_command_arrives(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from planner.__main__ import main

    words = ["plan", "circle:1.5l", "--robot", "paper-control", "--out", str(tmp_path / "out")]
    for seconds in (0.0, np.nan, np.inf):
        with pytest.raises(InputError, match="above 0"):
            plan_arrival(circle(1.5), tracked(), PlanRequest(), seconds)
    assert run_command(main, [*words, "--arrive", "25min"]) == 0
    assert "arrives after 25 min as asked" in capsys.readouterr().out
    content = json.loads((tmp_path / "out" / "plan.json").read_text())
    assert sum(content["dwell_s"]) == pytest.approx(1500, rel=0.002)


def straight() -> Plan:
    return planned(((0.0, 0.0), (2.5, 0.0)))


@pytest.mark.parametrize("side", [1, -1])
def test_a_circle_ends_where_it_began(side: int) -> None:
    reference = straight().declared.reference
    around = circle_reference(straight(), WaitingCircle(60, side))
    assert around.q[0] == pytest.approx(reference.q[60])
    assert around.q[-1] == pytest.approx(around.q[0], abs=1e-9)
    assert around.p[-1] == pytest.approx(reference.p[60], abs=1e-9)
    assert around.heading[-1] - around.heading[0] == pytest.approx(side * math.tau)
    assert np.abs(around.curvature).max() * straight().tracked.vehicle.pivot_radius < 0.71


@pytest.mark.parametrize("place", [0, 60, -1])
def test_the_robot_follows_circles_anywhere_on_its_path(place: int) -> None:
    plan = straight()
    index = place % len(plan.declared.reference.q)
    once = with_circles(plan, [WaitingCircle(index, 1)])
    twice = with_circles(plan, [WaitingCircle(index, 1), WaitingCircle(index, -1)])
    assert max(once.predicted_max, twice.predicted_max) < plan.predicted_max + 0.01
    longer = once.duration - plan.duration
    assert longer > 100
    assert twice.duration - once.duration == pytest.approx(longer, rel=0.03)
    assert once.poses[-1, :2] == pytest.approx(plan.poses[-1, :2], abs=0.05)
    assert (once.dwells[:-1] >= plan.minimum_dwell * 0.999).all()
    assert with_circles(plan, []) is plan


def test_a_robot_with_a_goal_still_ends_there() -> None:
    waiting = with_circles(trip().plan, [WaitingCircle(50, -1)], trip().goal)
    x, y, heading = waiting.poses[-1]
    assert (x, y) == pytest.approx(trip().goal[:2], abs=2e-3)
    assert math.remainder(heading - trip().goal[2], math.tau) == pytest.approx(0, abs=2e-3)
    assert waiting.start == trip().plan.start


def test_a_closed_path_and_a_current() -> None:
    lap = planned("circle:1.5l", current=(5e-5, 0.0))
    waiting = with_circles(lap, [WaitingCircle(100, 1)])
    assert waiting.predicted_max < lap.predicted_max + 0.03
    assert waiting.duration > lap.duration + 100
