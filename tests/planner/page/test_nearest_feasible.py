"""The nearest feasible path is Python's."""

from __future__ import annotations

from typing import Any

import pytest

from planner.paths.nearest_feasible import nearest_path, pose_spacing
from tests.planner.page.cases import DRIFTS, PATHS, drift_to_page
from tests.planner.page.page_core import answers, check_near

RADII = (0.45, 0.7)
FEW = ("square", "eight", "bend", "stroke", "random 1")
CHOICES: dict[str, dict[str, Any]] = {
    "rms": {},
    "minimax": {"minimax": True},
    "time": {"time_weight": 0.05},
    "sideways": {"drift": DRIFTS["sideways"]},
    "current": {"drift": DRIFTS["current"], "time_weight": 0.01},
}


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("rod", [0.0, 0.87])
def test_nearest_path(choice: str, rod: float) -> None:
    options = CHOICES[choice]
    given = {
        "minimax": options.get("minimax", False),
        "timeWeight": options.get("time_weight", 0.0),
        "drift": drift_to_page(options.get("drift", DRIFTS["still"])),
    }
    names, radii = (PATHS, RADII) if choice == "rms" else (FEW, RADII[-1:])
    cases = [(name, PATHS[name], radius) for name in names for radius in radii]
    found = answers(
        [("nearest_feasible.js", "nearestPath", path, rod, radius, given) for _, path, radius in cases]
    )
    for result, (name, path, radius) in zip(found, cases, strict=True):
        wanted = nearest_path(path, rod, radius, **options)
        assert result["closed"] == wanted.closed
        try:
            check_near(result["points"], wanted.points)
        except AssertionError as apart:
            raise AssertionError(f"{name}, radius {radius}") from apart


def test_spacing_of_poses() -> None:
    cases = [(path.scaled(scale), 0.3) for path in PATHS.values() for scale in (0.1, 1.0, 300.0)]
    found = answers([("nearest_feasible.js", "poseSpacing", *case) for case in cases])
    assert found == [pose_spacing(*case) for case in cases]
