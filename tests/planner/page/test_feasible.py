"""The ways to a path that the robot can follow are Python's."""

from __future__ import annotations

from typing import Any

import pytest

from planner.planning import feasible
from planner.planning.feasible import Accepted
from tests.planner.page.cases import PATHS, VEHICLES, feasibility_of
from tests.planner.page.page_core import answers, check_near, refusal_of

CAR = VEHICLES["biased"]


def check_accepted(found: Any, wanted: Accepted | None) -> None:
    """Assert that a reference is accepted by both or by none, and the same."""
    if wanted is None:
        assert found is None
        return
    check_near(found["reference"]["p"], wanted.reference.p)
    check_near(found["reference"]["heading"], wanted.reference.heading)
    check_near([found["offDrawn"], found["missed"]], [wanted.off_drawn, wanted.missed])


@pytest.mark.parametrize("corner", ["nearest", "minimax", "fillet"])
def test_the_first_way_that_is_accepted(corner: str) -> None:
    feasibility, page = feasibility_of(CAR, corner)
    paths = [PATHS[name] for name in ("circle", "square", "bend", "stroke")] + [PATHS["triangle"].scaled(0.4)]
    calls = [("feasible.js", "feasible", path, page) for path in paths]
    for found, path in zip(answers(calls), paths, strict=True):
        check_accepted(found, feasible.feasible(path, feasibility))


def test_a_time_weight() -> None:
    feasibility, page = feasibility_of(CAR, "nearest", time_weight=0.02)
    paths = [PATHS[name] for name in ("circle", "square", "stroke")]
    for found, path in zip(
        answers([("feasible.js", "feasible", path, page) for path in paths]), paths, strict=True
    ):
        check_accepted(found, feasible.feasible(path, feasibility))


def test_corners_that_are_not_allowed() -> None:
    feasibility, page = feasibility_of(CAR, "error")
    every = list(PATHS.values())
    found = answers([("feasible.js", "asDrawn", path, page) for path in every])
    for outcome, path in zip(found, every, strict=True):
        if isinstance(outcome, Exception):
            assert str(outcome) == refusal_of(feasible.as_drawn, path, feasibility)
        else:
            check_accepted(outcome, feasible.as_drawn(path, feasibility))
    assert sum(isinstance(outcome, Exception) for outcome in found) > 3


@pytest.mark.rest
def test_noise_and_work() -> None:
    paths = [path.scaled(scale) for path in PATHS.values() for scale in (0.1, 1.0, 20.0)]
    for corner in ("nearest", "minimax"):
        feasibility, page = feasibility_of(CAR, corner)
        noise = answers([("feasible.js", "smoothingOfNoise", path, page["vehicle"]) for path in paths])
        assert noise == [feasible.smoothing_of_noise(path, CAR) for path in paths]
        ways = (feasible.ROUNDED, 0.85, 0.2)
        found = answers([("feasible.js", "costOf", path, page, way) for path in paths for way in ways])
        assert found == pytest.approx([feasible.cost(path, feasibility, way) for path in paths for way in ways])
