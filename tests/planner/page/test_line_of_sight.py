"""The core flips when Python does: with lags, memory, bias and a current."""

from __future__ import annotations

import numpy as np
import pytest

from planner.paths.tractrix import reference
from planner.planning.line_of_sight import Guidance, hysteresis
from planner.planning.schedule import follow
from tests.planner.page.cases import PATHS, VEHICLES, reference_to_page, rounded
from tests.planner.page.page_core import answer, answers, check_near
from tests.planner.page.robots import vehicle_to_page

NAMES = ("circle", "eight", "line", "bend", "random 2")


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("offset", [0.0, 0.27, -0.3])
def test_dwells_and_poses(name: str, offset: float) -> None:
    car = VEHICLES[name]
    guidance = Guidance(1.3, 0.9, 1.3 * car.yaw_rate)
    rod = car.pivot_distance + offset
    followed = [reference(rounded(name, round(rod, 6)), rod, 0.02) for name in NAMES]
    page = vehicle_to_page(car)
    calls = [("schedule.js", "follow", reference_to_page(r), page, guidance._asdict(), offset) for r in followed]
    for found, wanted in zip(answers(calls), [follow(r, car, guidance, offset) for r in followed], strict=True):
        assert found["firstDirection"] == wanted.first_direction
        check_near(found["dwells"], wanted.dwells)
        check_near(found["poses"], wanted.poses)


def test_hysteresis() -> None:
    car = VEHICLES["biased"]
    followed = reference(PATHS["eight"], car.pivot_distance, 0.02)
    found = answer("line_of_sight.js", "hysteresis", reference_to_page(followed), vehicle_to_page(car), 0.06)
    check_near(found, hysteresis(followed, car, 0.06), 1e-15)
    assert np.ptp(found) > 0
