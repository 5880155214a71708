"""Stated, guaranteed and predicted errors of schedules are Python's, with and without measured poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner.paths.path import Path2D, circle
from planner.paths.tractrix import reference
from planner.planning.error_growth import error_growth
from planner.planning.schedule import follow
from planner.planning.stated_error import (
    flips_between,
    guaranteed,
    look_ahead,
    predicted_error,
    rms_in_time,
    stated_error,
)
from planner.vehicle.rollout import roll_out
from planner.vehicle.zigzag import zigzag
from tests.planner.page.page_core import answer, answers, call, check_near, typed
from tests.planner.page.robots import random_robots, vehicle_of, vehicle_to_page
from tests.planner.vehicles import plain_guidance

PATHS = {"circle": circle(2.0), "bend": Path2D.of([[0, 0], [6, 0], [9, 2], [40, 3]])}


@pytest.mark.parametrize("name", PATHS)
def test_stated_error(name: str) -> None:
    path, vehicle = PATHS[name], replace(vehicle_of(random_robots(1)[0]), current=np.array([1e-4, -1e-4]))
    followed = reference(path, vehicle.pivot_distance, 0.02)
    ahead = look_ahead(vehicle, float(np.abs(followed.curvature).max()))
    switches = follow(followed, vehicle, plain_guidance(vehicle, 0.8, ahead))
    rollout = roll_out(vehicle, switches, 0.0)
    predicted = predicted_error(followed.p, rollout.track, closed=path.closed)
    flips = flips_between(len(switches.dwells))
    page = {"firstDirection": switches.first_direction, "dwells": switches.dwells, "poses": switches.poses}
    car = vehicle_to_page(vehicle)
    rolled = call("rollout.js", "rollOut", car, page, 0.0)
    growth = call("error_growth.js", "errorGrowth", car, page, rolled, flips)
    error = call("stated_error.js", "predictedError", followed.p, rollout.track, path.closed)
    found, stated, rms, largest = answers(
        [
            ("stated_error.js", "predictedError", followed.p, rollout.track, path.closed),
            ("stated_error.js", "statedError", growth, error, 3),
            ("stated_error.js", "rmsInTime", typed(predicted.distance), switches.dwells),
            ("stated_error.js", "largestDistance", error),
        ]
    )
    for part in ("distance", "signed", "normal"):
        check_near(found[part], getattr(predicted, part), 1e-10)
    growing = error_growth(vehicle, switches, rollout, flips)
    check_near(stated, stated_error(growing, predicted, seed=3), 1e-10)
    check_near(rms, rms_in_time(predicted.distance, switches.dwells), 1e-14)
    check_near(largest, predicted.largest, 1e-12)


def test_flips_between_which_deviations_are_drawn() -> None:
    counts = [1, 2, 19, 20, 21, 299, 300, 301, 640, 9001]
    found = answers([("stated_error.js", "flipsBetween", count) for count in counts])
    assert found == [flips_between(count).tolist() for count in counts]


def test_look_ahead_and_bound() -> None:
    for robot in random_robots(3):
        vehicle = vehicle_of(robot)
        page, straight = vehicle_to_page(replace(vehicle, modes=())), zigzag(vehicle, 0.9)
        flat = {"dwells": straight.dwells, "speed": straight.speed, "drift": straight.drift}
        cases = [(0.1, None), (0.5, straight), (50.0, None)]
        for curvature, given in cases:
            found = answer("stated_error.js", "lookAhead", page, curvature, flat if given else None)
            check_near(found, look_ahead(vehicle, curvature, given), 1e-13)
        found = answer("stated_error.js", "guaranteedError", page, 1.1, 0.2, 0.9)
        check_near(found, guaranteed(vehicle, 1.1, 0.2, 0.9), 1e-13)
