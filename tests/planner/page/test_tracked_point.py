"""The tracked point and the warnings about the vehicle are Python's."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from tests.planner.page.page_core import answer, answers, check_near, refusal_of
from tests.planner.page.plans import robot_to_page
from tests.planner.page.robots import random_robots, shipped, vehicle_of, vehicle_to_page


def test_offsets() -> None:
    robot = random_robots(1)[0]
    page, points = robot_to_page(robot), ("head_centre", "head_tip", "pivot")
    vehicle = vehicle_to_page(replace(vehicle_of(robot), modes=()))
    basis = {"vehicle": vehicle, "unmeasured": [], "calibrated": False, "ownTable": True}
    found = answers([("tracked_point.js", "trackedPoint", page, basis, point, "x") for point in points])
    for one, point in zip(found, points, strict=True):
        wanted = tracked_vehicle(robot, shipped(), point, None)
        check_near(one["offset"], wanted.offset, 1e-15)
        check_near(answer("tracked_point.js", "rodOf", one), wanted.rod, 1e-15)
        assert (one["point"], one["model"], one["ownTable"]) == (point, "x", True)
    wrong: Any = "nose"
    refusal = answer("tracked_point.js", "trackedPoint", page, basis, wrong, "x")
    assert str(refusal) == refusal_of(tracked_vehicle, robot, shipped(), wrong, None)


@pytest.mark.parametrize(("gap", "least"), [(2.0, 1.0), (0.3, 1.0), (0.99, 0.98), (0.5, 0.98)])
def test_warnings_about_tails_that_touch(gap: float, least: float) -> None:
    robot = random_robots(1)[0]
    vehicle = replace(vehicle_of(robot), tail_gap=gap, least_gap=least)
    found = answer("tracked_point.js", "gapWarnings", {"tailGap": gap, "leastGap": least})
    assert found == list(TrackedVehicle(robot, vehicle, "head_centre", 0.0, "").warnings)
