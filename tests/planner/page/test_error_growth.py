"""Deviations along a schedule are Python's: in a current, with modes of every kind and those of the phase."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner.planning.error_growth import error_growth
from planner.vehicle.rollout import Switches, roll_out
from planner.vehicle.vehicle import Mode
from tests.planner.page.page_core import answer, call
from tests.planner.page.robots import check_alike, random_robots, vehicle_of, vehicle_to_page

FLIPS = [0, 1, 7, 20, 33, 40]


@pytest.mark.parametrize("first", [1, -1])
def test_growth(first: int) -> None:
    rng = np.random.default_rng(first + 1)
    modes = (Mode("current", np.zeros((2, 3)), current=np.array([1e-4, -2e-4])),)
    vehicle = vehicle_of(random_robots(1)[0])
    spread = rng.uniform(0.0, 1e-3, vehicle.spread.shape)
    vehicle = replace(vehicle, current=np.array([0.01, -0.02]), modes=(*vehicle.modes[:6], *modes), spread=spread)
    switches = Switches(first, rng.uniform(0.25, 3.0, 40), rng.normal(size=(41, 3)))
    page = {"firstDirection": first, "dwells": switches.dwells, "poses": switches.poses}
    car = vehicle_to_page(vehicle)
    rolled = call("rollout.js", "rollOut", car, page, 0.1)
    found = answer("error_growth.js", "errorGrowth", car, page, rolled, FLIPS)
    wanted = error_growth(vehicle, switches, roll_out(vehicle, switches, 0.1), np.array(FLIPS))
    assert found["flips"] == wanted.flips.tolist()
    deviation = np.stack([[mode["x"], mode["y"]] for mode in found["modes"]])
    check_alike(deviation.transpose(2, 1, 0), wanted.deviation.transpose(0, 2, 1), 1e-9)
    check_alike(np.array([mode["turned"] for mode in found["modes"]]).T, wanted.turned, 1e-9)
