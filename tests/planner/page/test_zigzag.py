"""Straight motion is Python's, also where the two directions differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planner.vehicle.zigzag import zigzag
from tests.planner.page.page_core import answers, check_near
from tests.planner.page.robots import random_robots, vehicle_of, vehicle_to_page

CASES = [(0.3, 0.0), (0.8, 0.25), (2.5, -0.4)]
FIELDS = ("dwells", "speed", "swing", "sway", "drift", "rms", "largest")


def test_zigzags() -> None:
    vehicles = [vehicle_of(robot) for robot in random_robots(2)]
    uneven = replace(vehicles[0], twist=vehicles[0].twist * [[1, 1, 1], [1.1, 0.9, 1.3]])
    for vehicle in (*vehicles, uneven, replace(uneven, twist=uneven.twist[::-1] * [1, -1, -1])):
        page = vehicle_to_page(replace(vehicle, modes=()))
        found = answers([("zigzag.js", "zigzag", page, *case) for case in CASES])
        for one, case in zip(found, CASES, strict=True):
            wanted = zigzag(vehicle, *case)
            for name in FIELDS:
                check_near(one[name], getattr(wanted, name), 1e-13)
            swings = answers([("zigzag.js", "zigzagHysteresis", one, 0.7), ("zigzag.js", "zigzagSpeed", one)])
            check_near(swings, [wanted.hysteresis(0.7), wanted.net_speed], 1e-13)
    assert np.abs(wanted.drift) > 1e-6
