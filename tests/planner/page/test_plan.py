"""Whole plans of the core are Python's, for presets of paths, corners, points, objectives and robots."""

from __future__ import annotations

from typing import Any

import pytest

from planner.paths.path import Path2D, circle, polygon, smoothed
from planner.planning.plan import plan
from planner.planning.planned import Plan
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from tests.planner.page.cases import eight, noisy_stroke, wave
from tests.planner.page.page_core import TABLE, answers, check_near, refusal_of, without_digits
from tests.planner.page.plans import robot_to_page
from tests.planner.page.robots import random_robots, shipped, shipped_data
from tests.planner.page.test_request import page_name

CONTROL, TRIANGLE = PRESETS["paper-control"], PRESETS["paper-triangle"]
STROKE = smoothed(noisy_stroke(), 0.5)[0]
SQUARE = polygon(4, 3.0)
CASES: dict[str, tuple[Path2D, dict[str, Any]]] = {
    "circle": (circle(2.0), {}),
    "small circle": (circle(1.2), {"objective": "time"}),
    "square": (SQUARE, {}),
    "triangle": (polygon(3, 4.0), {}),
    "eight": (eight(3.0), {}),
    "wave": (wave(9.0, 0.8), {}),
    "stroke": (STROKE, {}),
    "bend": (Path2D.of([[0, 0], [3, 0], [3, 4]]), {}),
    "line": (Path2D.of([[0, 0], [5, 1]]), {}),
    "long line": (Path2D.of([[0, 0], [60, 0]]), {}),
    "pentagon": (polygon(5, 3.0), {"objective": "flips"}),
    "square, fast": (SQUARE, {"objective": "time"}),
    "square, few flips": (SQUARE, {"objective": "flips"}),
    "square, minimax": (SQUARE, {"corner": "minimax"}),
    "square, rounded": (SQUARE, {"corner": "fillet"}),
    "circle, no corners": (circle(2.5), {"corner": "error"}),
    "square, tip": (SQUARE, {"point": "head_tip"}),
    "square, pivot": (SQUARE, {"point": "pivot"}),
    "circle, tip": (circle(2.0), {"point": "head_tip", "objective": "time"}),
    "wave, pivot": (wave(9.0, 0.8), {"point": "pivot"}),
    "square, one dwell": (SQUARE, {"dwell": 0.9}),
    "square, slow motor": (SQUARE, {"minimum_seconds": 2.0}),
    "square, quick motor": (SQUARE, {"minimum_dwell": 0.22, "objective": "time"}),
    "square, tolerance": (SQUARE, {"objective": "flips", "tolerance": 0.1}),
    "circle, tolerance": (circle(2.0), {"objective": "flips", "tolerance": 0.08}),
    "square, time counts": (SQUARE, {"time_weight": 0.03}),
    "wave, time counts": (wave(9.0, 1.2), {"time_weight": 0.03, "corner": "minimax"}),
    "bend, another seed": (Path2D.of([[0, 0], [3, 0], [3, 4]]), {"seed": 7}),
}
ERRORS = {"stated": "stated", "guaranteed": "guaranteed", "predictedRms": "predicted_rms",
          "predictedMax": "predicted_max", "drawnRms": "drawn_rms", "drawnMax": "drawn_max"}  # fmt: skip


def errors_of(result: Plan) -> dict[str, float]:
    """Return the errors of a plan by the names of the page."""
    errors = {page: getattr(result.errors, name) for page, name in ERRORS.items()}
    return errors | {"feedback": result.feedback_error}


def planning_call(case: tuple[Path2D, Robot, dict[str, Any]]) -> tuple[Any, ...]:
    path, robot, options = case
    return "plan.js", "planPath", path, robot_to_page(robot), TABLE, {page_name(n): v for n, v in options.items()}


def planned(cases: list[tuple[Path2D, Robot, dict[str, Any]]]) -> list[Any]:
    return answers([planning_call(case) for case in cases], shipped_data(), left_out=["vehicle"])


def check_plan(found: Any, wanted: Plan) -> None:
    """Assert that all numbers of a plan are Python's."""
    switches, declared = found["switches"], found["declared"]
    assert len(switches["dwells"]) == len(wanted.dwells)
    assert switches["firstDirection"] == wanted.first_direction
    check_near(switches["dwells"], wanted.dwells)
    check_near(switches["poses"], wanted.switches.poses)
    for name in ("p", "q", "heading"):
        check_near(declared["reference"][name], getattr(wanted.declared.reference, name))
    check_near([declared["offDrawn"], declared["missed"]], [wanted.declared.off_drawn, wanted.declared.missed])
    assert without_digits(declared["warnings"]) == without_digits(list(wanted.declared.warnings))
    for name, error in errors_of(wanted).items():
        check_near(found["errors"][name], error)
    assert (found["unmeasured"] is None) == (wanted.unmeasured_error is None)
    if wanted.unmeasured_error is not None:
        check_near(found["unmeasured"], wanted.unmeasured_error)
    assert (found["errors"]["closure"] is None) == (wanted.errors.closure is None)
    if wanted.errors.closure is not None:
        check_near(found["errors"]["closure"], wanted.errors.closure)
    check_near(found["errors"]["track"], wanted.errors.track)
    check_near([found["guidance"][name] for name in wanted.guidance._fields], wanted.guidance)
    check_near(found["tracked"]["offset"], wanted.tracked.offset)
    assert found["tracked"]["model"] == wanted.tracked.model
    assert found["tracked"]["warnings"] == list(wanted.tracked.warnings)


@pytest.fixture(scope="module")
def of_presets() -> dict[str, Any]:
    """Plan for all presets in one process."""
    found = planned([(path, CONTROL, options) for path, options in CASES.values()])
    return dict(zip(CASES, found, strict=True))


@pytest.mark.parametrize("name", CASES)
def test_plans_of_presets(name: str, of_presets: dict[str, Any]) -> None:
    path, options = CASES[name]
    check_plan(of_presets[name], plan(path, CONTROL, lookup=shipped(), **options))


@pytest.mark.rest
def test_plans_of_other_robots() -> None:
    robots = [TRIANGLE, *random_robots(3)]
    found = planned([(circle(2.5), robot, {}) for robot in robots])
    for one, robot in zip(found, robots, strict=True):
        check_plan(one, plan(circle(2.5), robot, lookup=shipped()))


@pytest.mark.parametrize(
    ("path", "robot", "options"),
    [
        (circle(0.1), CONTROL, {}),
        (circle(4000.0), CONTROL, {}),
        (polygon(3, 0.8), CONTROL, {}),
        (polygon(4, 3.0), CONTROL, {"corner": "error"}),
        (polygon(4, 3.0), CONTROL, {"corner": "round"}),
        (polygon(4, 3.0), CONTROL, {"point": "nose"}),
        (polygon(4, 3.0), CONTROL, {"objective": "fun"}),
        (polygon(4, 3.0), CONTROL, {"tolerance": -1.0}),
        (polygon(4, 3.0), CONTROL, {"tolerance": 0.001}),
        (polygon(4, 3.0), CONTROL, {"time_weight": -1.0}),
        (polygon(4, 3.0), CONTROL, {"time_weight": 0.1, "corner": "fillet"}),
        (polygon(4, 3.0), CONTROL, {"minimum_dwell": 0.1}),
        (polygon(4, 3.0), CONTROL, {"minimum_seconds": -2.0}),
        (polygon(4, 3.0), CONTROL, {"dwell": 0.1}),
        (polygon(4, 3.0), CONTROL.with_motor(0.01), {}),
        (polygon(4, 3.0), CONTROL.with_motor(2000.0), {}),
    ],
)  # fmt: skip
def test_refusals(path: Path2D, robot: Robot, options: dict[str, Any]) -> None:
    (refusal,) = planned([(path, robot, options)])
    assert without_digits(refusal) == without_digits(refusal_of(plan, path, robot, lookup=shipped(), **options))
