"""Starts, ends and refusals of schedules are Python's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner.paths.path import Path2D
from planner.paths.tractrix import reference
from planner.planning.line_of_sight import Guidance
from planner.planning.schedule import Start, follow, start_at_rest
from sim.io.errors import InputError
from tests.planner.page.cases import PATHS, VEHICLES, reference_to_page
from tests.planner.page.page_core import answer, answers, check_near, refusal_of
from tests.planner.page.robots import vehicle_to_page

CAR = VEHICLES["symmetric"]
PAGE = vehicle_to_page(CAR)


def test_starts() -> None:
    followed = [reference(path, CAR.pivot_distance + 0.1, 0.02) for path in PATHS.values()]
    car, guidance = replace(CAR, current=np.array([1e-3, -5e-4])), Guidance(0.8, 0.9, 0.04)
    page = (vehicle_to_page(car), guidance._asdict(), 0.1)
    found = answers([("schedule.js", "startAtRest", reference_to_page(r), *page) for r in followed])
    for start, wanted in zip(found, [start_at_rest(r, car, guidance, 0.1) for r in followed], strict=True):
        check_near(start["pose"], wanted.pose, 1e-9)
        assert start["sense"] == wanted.sense


def test_a_start_that_is_given() -> None:
    followed, guidance = reference(PATHS["circle"], CAR.pivot_distance, 0.02), Guidance(0.8, 0.9, 0.04)
    start = Start((2.0, -0.2, 1.5), -1)
    page = {"start": {"pose": start.pose, "sense": start.sense}}
    found = answer("schedule.js", "follow", reference_to_page(followed), PAGE, guidance._asdict(), 0.0, page)
    wanted = follow(followed, CAR, guidance, start=start)
    assert found["firstDirection"] == wanted.first_direction == -1
    check_near(found["dwells"], wanted.dwells)


@pytest.mark.parametrize(
    ("path", "guidance"),
    [
        (Path2D.of([[0, 0], [3, 0], [0, 0.001]]), Guidance(1.0, 0.5, 0.05)),
        (PATHS["star"].scaled(0.05), Guidance(3.0, 0.5, 0.15)),
        (PATHS["square"].scaled(0.2), Guidance(100.0, 0.5, 5.0)),
    ],
    ids=["hairpin", "tiny star", "long dwells"],
)
def test_paths_that_cannot_be_followed(path: Path2D, guidance: Guidance) -> None:
    followed = reference(path, CAR.pivot_distance, 0.02)
    found = answer("schedule.js", "follow", reference_to_page(followed), PAGE, guidance._asdict())
    try:
        wanted = follow(followed, CAR, guidance)
    except InputError:
        assert str(found) == refusal_of(follow, followed, CAR, guidance)
    else:
        check_near(found["dwells"], wanted.dwells)
