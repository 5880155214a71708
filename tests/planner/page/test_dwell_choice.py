"""Dwells for each objective are Python's; bad ones are refused in the same words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner.vehicle.dwell_choice import check_least, dwells_for, longer_dwells, nearly_fastest, net_speeds
from tests.planner.page.page_core import answer, answers, check_near, refusal_of
from tests.planner.page.robots import random_robots, vehicle_of, vehicle_to_page


def test_dwells() -> None:
    grid = np.geomspace(0.2, 4, 30)
    for robot in random_robots(6):
        vehicle = vehicle_of(robot)
        page = vehicle_to_page(replace(vehicle, modes=()))
        cases = [
            (objective, least) for objective in ("error", "time", "flips") for least in (None, 0.2, 1.5, 50.0)
        ]
        for found, case in zip(
            answers([("dwell_choice.js", "dwellsFor", page, *case) for case in cases]), cases, strict=True
        ):
            check_near(found, dwells_for(vehicle, *case), 1e-13)  # type: ignore[arg-type]
        for least in (None, 0.2, 1.5, 50.0):
            found = answer("dwell_choice.js", "nearlyFastest", page, least)
            check_near(found, nearly_fastest(vehicle, least), 1e-13)
        longer, speeds = answers(
            [("dwell_choice.js", "longerDwells", page, 0.5), ("dwell_choice.js", "netSpeeds", page, grid)]
        )
        check_near(longer, longer_dwells(vehicle, 0.5), 1e-13)
        check_near(speeds, net_speeds(vehicle, grid), 1e-14)


@pytest.mark.parametrize("least", [0.1, -1.0, 0.19999])
def test_dwells_that_are_too_short(least: float) -> None:
    assert str(answer("dwell_choice.js", "checkLeast", least)) == refusal_of(check_least, least)


def test_an_unknown_objective() -> None:
    vehicle = vehicle_of(random_robots(1)[0])
    page = vehicle_to_page(replace(vehicle, modes=()))
    wanted = refusal_of(dwells_for, vehicle, "fast", None)
    assert str(answer("dwell_choice.js", "dwellsFor", page, "fast", None)) == wanted
