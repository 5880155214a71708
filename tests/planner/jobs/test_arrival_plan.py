"""Plans arrive when they are asked to, also in the simulator and with a tracker."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.files.saved_plan import restore_plan
from planner.files.tracking_error import tracking_error
from planner.goal.arrive import EXACT
from planner.jobs.arrival_plan import plan_arrival
from planner.paths.obstacles import Circle, FreeSpace
from planner.paths.path import Path2D, circle
from planner.planning.plan import make_plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from sim.io.errors import InputError, run_command
from sim.model.presets import PRESETS
from sim.motion.replay import replay
from tests.planner.vehicles import FINE

CONTROL = PRESETS["paper-control"]
BENT = Path2D.of([[0.0, 0.0], [2.0, 0.0], [3.5, 1.5]])
FEW = PlanRequest(dwell=2.03)  # no flip is at the time of a picture


@pytest.fixture(scope="module")
def tracked() -> TrackedVehicle:
    return tracked_vehicle(CONTROL, None, "head_centre", None)


@pytest.fixture(scope="module")
def waiting(tracked: TrackedVehicle) -> Plan:
    own = make_plan(BENT, tracked, FEW)
    return plan_arrival(BENT, tracked, FEW, 1.9 * float(own.seconds.sum()))


def missed(plan: Plan) -> float:
    assert plan.arrival is not None
    return abs(plan.duration - plan.arrival.wished)


def near(plan: Plan) -> float:
    assert plan.arrival is not None
    return max(EXACT * plan.arrival.wished, min(plan.straight.dwells) / 2)


@pytest.mark.parametrize("share", [1.0, 1.15, 1.5])
def test_dwells_decide_when_a_plan_arrives(tracked: TrackedVehicle, share: float) -> None:
    fastest = make_plan(BENT, tracked, PlanRequest(objective="time"))
    plan = plan_arrival(BENT, tracked, PlanRequest(), share * float(fastest.seconds.sum()))
    assert plan.arrival is not None
    assert plan.arrival.fastest == pytest.approx(fastest.duration)
    assert missed(plan) <= near(plan)
    assert plan.declared.swing is None
    assert "as asked" in repr(plan)


def test_circles_take_time_where_dwells_do_not_suffice(waiting: Plan) -> None:
    assert missed(waiting) <= near(waiting)
    assert waiting.declared.swing is not None
    assert waiting.declared.swing.circles >= 1
    assert waiting.declared.missed < 0.1  # circles leave nothing of the path out
    assert waiting.predicted_max < 0.15
    content = waiting.to_dict()["arrival"]
    assert content["swing"] == list(waiting.declared.swing)
    restored = restore_plan(waiting.to_dict())
    assert restored.arrival == pytest.approx(waiting.arrival)
    assert restored.declared.swing == waiting.declared.swing
    assert content["wished_s"] == pytest.approx(float(waiting.seconds.sum()), rel=0.01)


def test_a_swing_takes_less_time_than_a_circle(tracked: TrackedVehicle) -> None:
    own = make_plan(BENT, tracked, FEW)
    plan = plan_arrival(BENT, tracked, FEW, 1.2 * float(own.seconds.sum()))
    assert missed(plan) <= near(plan)
    assert plan.declared.swing is not None
    assert plan.declared.swing.circles == 0


def test_circles_keep_clear_of_obstacles(tracked: TrackedVehicle) -> None:
    space = FreeSpace.of([Circle(3.5, 0.3, 0.3)])
    own = make_plan(BENT, tracked, FEW)
    plan = plan_arrival(BENT, tracked, FEW, 2.2 * float(own.seconds.sum()), space)
    assert missed(plan) <= near(plan)
    assert plan.kept_clear is not None
    assert plan.kept_clear.clearance > 0
    assert plan.kept_clear.margin >= plan.stated_error


def test_the_simulator_follows_swings(waiting: Plan) -> None:
    track = replay([waiting.schedule()])[0]
    assert float(track["time_s"].iloc[-1]) == pytest.approx(float(waiting.seconds.sum()))
    error = tracking_error(waiting.to_dict(), track)
    assert error.largest < 1.1 * waiting.stated_error  # which 95 % of robots keep
    end = track[["x_over_l", "y_over_l"]].iloc[-1].to_numpy(float)
    assert np.hypot(*(end - BENT.points[-1])) < 2 * waiting.stated_error


def test_a_tracked_robot_swims_the_circles_and_arrives(waiting: Plan, tracked: TrackedVehicle) -> None:
    car = replace(tracked.vehicle, twist=tracked.vehicle.twist * np.array([1.02, 1.0, 1.02]))
    result = swim(Tracker(waiting), waiting, car, FINE)
    assert result.finished
    assert result.distance.max() < 0.2
    assert result.times[-1] == pytest.approx(waiting.duration, rel=0.03)  # a robot that is 2 % faster


def test_a_wish_below_the_fastest_plan_is_refused(tracked: TrackedVehicle) -> None:
    with pytest.raises(InputError, match="the fastest plan takes"):
        plan_arrival(circle(2.0), tracked, PlanRequest(), 60.0)
    for seconds in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="above 0"):
            plan_arrival(circle(2.0), tracked, PlanRequest(), seconds)


def test_the_command_arrives_or_refuses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from planner.__main__ import main

    words = ["plan", "circle:2l", "--unit", "l", "--robot", "paper-control", "--out", str(tmp_path / "out")]
    for time, expected in (("1min", "the fastest plan takes"), ("30", "with its unit"), ("-3min", "above 0")):
        assert run_command(main, [*words, f"--arrive={time}"]) == 2
        error = capsys.readouterr().err
        assert expected in error
        assert len(error.splitlines()) == 1
        assert not (tmp_path / "out").exists()
    assert run_command(main, [*words, "--arrive", "30min"]) == 0
    assert "arrives after 30 min as asked" in capsys.readouterr().out
    content = json.loads((tmp_path / "out" / "plan.json").read_text())
    assert sum(content["dwell_s"]) == pytest.approx(1800, rel=0.002)
