"""A place is held on the smallest orbit: no pair of dwells stays nearer, and the tracker keeps it in a current."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.jobs.hold import hold
from planner.jobs.hold_plan import HoldPlan
from planner.paths.obstacles import Circle, FreeSpace
from planner.planning.request import PlanRequest
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from planner.vehicle.vehicle import Vehicle
from sim.arrays import Floats
from sim.io.errors import InputError, run_command
from sim.mechanics import planar
from sim.model.presets import PRESETS
from sim.model.schedule import Schedule
from sim.motion.replay import replay
from tests.planner.jobs.test_laps import UntilTold
from tests.planner.vehicles import FINE

CONTROL = PRESETS["paper-control"]
PLACE = (2.0, 1.0)
FEW = PlanRequest(dwell=2.03)


@pytest.fixture(scope="module")
def tracked() -> TrackedVehicle:
    return tracked_vehicle(CONTROL, None, "head_centre", None)


@pytest.fixture(scope="module")
def held(tracked: TrackedVehicle) -> HoldPlan:
    return hold(PLACE, tracked, FEW, 1800.0)


def orbit_of_a_pair(vehicle: Vehicle, positive: float, negative: float, offset: float) -> float:
    """Compute the largest distance of a point of the axis from the centre of its orbit by a pair of dwells."""
    share = np.linspace(0, 1, 9)
    first = vehicle.motion(1, np.full(9, negative), positive * share)
    second = planar.compose(first[-1:], vehicle.motion(-1, np.full(9, positive), negative * share))
    x, y, turned = second[-1].tolist()
    if abs(math.sin(turned / 2)) < 1e-6:
        return math.inf
    c, s = 1 - math.cos(turned), math.sin(turned)
    centre = np.linalg.solve(np.array([[c, s], [-s, c]]), np.array([x, y]))
    points = planar.compose(np.concatenate([first, second]), np.array([offset, 0.0, 0.0]))[:, :2]
    return float(np.hypot(*(points - centre).T).max())


@pytest.mark.parametrize("point", ["head_centre", "pivot", "head_tip"])
def test_no_pair_of_dwells_stays_nearer_than_one_direction(point: str) -> None:
    tracked = tracked_vehicle(CONTROL, None, point, None)  # type: ignore[arg-type]
    smallest = math.hypot(tracked.vehicle.pivot_radius, tracked.rod)
    dwells: Floats = np.geomspace(0.2, 80.0, 24)
    sizes = [orbit_of_a_pair(tracked.vehicle, a, b, tracked.offset) for a in dwells for b in dwells]
    assert min(sizes) > smallest * (1 - 1e-6)
    assert min(sizes) < smallest * 1.02


@pytest.mark.rest
def test_the_orbit_is_little_wider_than_the_smallest_one(held: HoldPlan, tracked: TrackedVehicle) -> None:
    assert held.smallest == pytest.approx(tracked.vehicle.turn_radius)
    assert held.smallest < held.radius < 1.05 * held.smallest
    away = np.hypot(*(held.plan.track - PLACE).T)
    assert np.abs(away - held.radius).max() <= held.plan.predicted_max + 1e-3
    assert held.reach > held.radius
    assert held.laps == math.ceil(1800 / float(held.plan.seconds.sum()))
    assert held.within < held.within_open_loop(held.laps)


def test_the_simulator_circles_about_the_place_at_constant_direction(held: HoldPlan) -> None:
    lap = 2 * math.pi / held.plan.tracked.vehicle.yaw_rate
    still = Schedule(
        CONTROL.group_values(), held.still_direction, np.array([1.5 * lap]), held.still_start, CONTROL.time_scale
    )
    track = replay([still])[0][["x_over_l", "y_over_l"]].to_numpy(float)
    assert np.abs(np.hypot(*(track - PLACE).T) / held.smallest - 1).max() < 0.02


@pytest.mark.parametrize(("current", "wrong"), [(0.0, 1.05), (0.001, 0.97)])
def test_a_tracked_robot_stays(held: HoldPlan, tracked: TrackedVehicle, current: float, wrong: float) -> None:
    """A coefficient is 3 or 5 % off; the current would carry the robot 0.8 l away in six laps."""
    car = replace(
        tracked.vehicle,
        twist=tracked.vehicle.twist * np.array([wrong, 1.0, 1.0]),
        current=np.array([current, 0.0]),
    )
    plan = held.plan
    result = swim(UntilTold(Tracker(plan), 5.5 * plan.duration), plan, car, FINE, longest=8)
    settled = result.times > plan.duration
    away = np.hypot(*(result.poses[settled, :2] - PLACE).T)
    assert result.finished
    assert away.max() < held.within + 0.08
    assert away.min() > held.radius - 0.15


def test_there_must_be_room(tracked: TrackedVehicle) -> None:
    near = FreeSpace.of([Circle(3.2, 1.0, 0.2)])
    with pytest.raises(InputError, match="no room to hold"):
        hold(PLACE, tracked, FEW, space=near)
    far = FreeSpace.of([Circle(5.5, 1.0, 0.2)])
    assert hold(PLACE, tracked, FEW, space=far).laps is None


def test_the_command_holds_a_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from planner.__main__ import main

    words = ["--robot", "paper-control", "--unit", "cm", "--objective", "flips", "--out", str(tmp_path / "out")]
    for place, time, expected in (
        ("1", "5min", "write X,Y"),
        ("1,2", "5", "with its unit"),
        ("nan,0", "1h", "nan; write a length"),
    ):
        assert run_command(main, ["hold", place, "--for", time, *words]) == 2
        error = capsys.readouterr().err
        assert expected in error
        assert len(error.splitlines()) == 1
        assert not (tmp_path / "out").exists()
    assert run_command(main, ["hold", "22,11", "--for", "30min", *words]) == 0
    assert "no schedule stays nearer" in capsys.readouterr().out
    content = json.loads((tmp_path / "out" / "hold.json").read_text())
    assert content["place"] == pytest.approx([0.22 / CONTROL.tail_length, 0.11 / CONTROL.tail_length])
    assert content["plan_id"] == json.loads((tmp_path / "out" / "plan.json").read_text())["id"]
