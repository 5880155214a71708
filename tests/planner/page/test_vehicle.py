"""A vehicle's motion is Python's: lags, noise, radii; tables made of curves."""

from __future__ import annotations

import numpy as np

from planner.vehicle.vehicle import lag_table, resampled
from sim.model.response import BEFORE, DWELLS
from tests.planner.page.page_core import answer, answers, check_near
from tests.planner.page.robots import check_alike, random_robots, vehicle_of, vehicle_to_page

TIMES = [0.0, 0.01, 0.02, 0.3, 0.31, 1.0, 1.9999, 2.0, 3.7]


def test_motion_and_noise() -> None:
    for robot in random_robots(3):
        vehicle = vehicle_of(robot)
        page = vehicle_to_page(vehicle) | {"modes": []}
        cases = [(s, before, t) for s in (1, -1) for before in (None, 0.1, 0.2, 0.77, 1.4, 5.0) for t in TIMES]
        found = answers([("vehicle.js", "motionAfter", page, *case) for case in cases])
        check_near(found, [vehicle.motion(*case) for case in cases], 1e-14)
        for sense in (1, -1):
            noise = answer("vehicle.js", "lagNoise", page, sense, TIMES)
            check_near(np.transpose(noise), vehicle.lag_noise(sense, TIMES), 1e-16)


def test_radii_and_speeds() -> None:
    names = {"yawRate": "yaw_rate", "pivotDistance": "pivot_distance", "pivotRadius": "pivot_radius",
             "turnRadius": "turn_radius", "speedOf": "speed"}  # fmt: skip
    for robot in random_robots(3):
        vehicle = vehicle_of(robot)
        page = {"twist": vehicle.twist * [[1, 1, 1], [1.2, 0.9, 1.1]]}
        changed = type(vehicle)(page["twist"], vehicle.lag, vehicle.rest, vehicle.spread)
        found = answers([("vehicle.js", name, page) for name in names])
        check_near(found, [getattr(changed, name) for name in names.values()], 1e-15)


def test_tables_of_lags() -> None:
    rng = np.random.default_rng(0)
    lag, memory = rng.normal(size=(len(DWELLS), 3)), rng.normal(size=(len(BEFORE), len(DWELLS), 3))
    table = answer("vehicle.js", "lagTable", lag.ravel(), memory.ravel())
    check_alike(np.reshape(table, (-1, 3)), lag_table(lag, memory).reshape(-1, 3))
    other = np.geomspace(0.3, 1.1, 7)
    table = answer("vehicle.js", "lagTable", lag.ravel(), memory[:7].ravel(), other)
    check_alike(np.reshape(table, (-1, 3)), lag_table(lag, memory[:7], other).reshape(-1, 3))
    curve = answer("vehicle.js", "resampled", lag.ravel())
    check_alike(np.reshape(curve, (-1, 3)), resampled(lag))
