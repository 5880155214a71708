"""What a user may ask for is Python's."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import pytest

from planner.planning.request import PlanRequest
from sim.model.presets import PRESETS
from tests.planner.page.page_core import answer, refusal_of

ROBOT = PRESETS["paper-control"]
PAGE_ROBOT = {"timeScale": ROBOT.time_scale}


def page_name(name: str) -> str:
    first, *rest = name.split("_")
    return first + "".join(word.title() for word in rest)


def test_defaults() -> None:
    wanted = {page_name(name): value for name, value in asdict(PlanRequest()).items()}
    del wanted["camera"]  # the page knows the default camera only; test_plan.py compares its errors with feedback
    assert answer("request.js", "planRequest") == wanted


@pytest.mark.parametrize("tolerance", [0.0, -1.0])
def test_a_tolerance_that_is_none(tolerance: float) -> None:
    refusal = answer("request.js", "planRequest", {"tolerance": tolerance})
    assert str(refusal) == refusal_of(PlanRequest, tolerance=tolerance)


@pytest.mark.parametrize(
    "options", [{}, {"minimum_dwell": 0.7}, {"minimum_seconds": 2.0}, {"minimum_seconds": 0.1},
                {"minimum_seconds": 0.1, "minimum_dwell": 0.25}],
    ids=str,
)  # fmt: skip
def test_the_shortest_dwell(options: dict[str, Any]) -> None:
    page = {page_name(name): value for name, value in asdict(PlanRequest(**options)).items()}
    found = answer("request.js", "leastDwell", page, PAGE_ROBOT)
    assert found == PlanRequest(**options).least_dwell(ROBOT)


def test_no_time_between_flips() -> None:
    page = {page_name(name): value for name, value in asdict(PlanRequest(minimum_seconds=-1.0)).items()}
    refusal = answer("request.js", "leastDwell", page, PAGE_ROBOT)
    assert str(refusal) == refusal_of(PlanRequest(minimum_seconds=-1.0).least_dwell, ROBOT)
