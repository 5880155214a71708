"""Paths, places far away and the nearest feasible path are Python's; what cannot be is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from planner.paths.nearest_feasible import nearest_path
from planner.paths.path import Path2D, resample, smoothed
from planner.paths.shapes import shape_of
from planner.paths.tractrix import Drift, reference
from sim.io.errors import InputError
from tests.planner.page.cases import PATHS
from tests.planner.page.page_core import answer, answers, check_near
from tests.planner.page.parity import check_parity, check_same

RNG = np.random.default_rng(0)
STROKE = np.cumsum(RNG.normal(size=(300, 2)), axis=0)
EVERY = [*PATHS.values(), Path2D.of(STROKE), Path2D.of([[0, 0], [0, 0], [1, 1], [2, 0], [0, 1e-12]])]
BAD = [[], [[0, 0]], [[1, 2], [1, 2]], [[0, 0], [1]], [[0, 0, 0], [1, 1, 1]], [1, 2, 3], [[0, 0], [1e101, 0]],
       [[0, "x"], [1, 1]]]  # fmt: skip


def test_points_become_paths() -> None:
    tables = [path.polyline() for path in EVERY]
    assert check_parity("path.js", "pathOf", Path2D.of, [(points,) for points in (*tables, *BAD)]) == len(BAD)
    closed = lambda points, closed: Path2D.of(points, closed=closed)  # noqa: E731
    check_parity("path.js", "pathOf", closed, [(points, True) for points in tables])
    spacings = (0.1, 2.3, 50.0)
    check_parity("path.js", "resample", resample, [(line, spacing) for line in tables for spacing in spacings])


def test_smoothing() -> None:
    moved = lambda path, length: dict(zip(("path", "moved"), smoothed(path, length), strict=True))  # noqa: E731
    cases = [(path, path.length / share) for path in EVERY for share in (200, 11, 2.1)]
    assert check_parity("path.js", "smoothed", moved, cases, 1e-12) == 0
    assert check_parity("path.js", "smoothed", moved, [(EVERY[-1], length) for length in (-1.0, 0.0, 3.6)]) == 3


@pytest.mark.parametrize("away", [1e4, 1e7])
def test_points_far_away(away: float) -> None:
    line = away * np.array([1.0, 0.7]) + np.cumsum(RNG.normal(size=(30, 2)), axis=0)
    found = answer("distance.js", "nearest", line, away * RNG.normal(size=(40, 2)))
    assert min(found["segment"]) >= 0
    assert np.isfinite(found["distance"]).all()


def test_the_way_of_the_pivot() -> None:
    drifts = (Drift(), Drift(0.15), Drift(-0.05, (0.1, -0.2)))
    cases = [(path, rod, 0.05, drift) for path in PATHS.values() for rod in (0.0, 0.87) for drift in drifts]
    for found, case in zip(answers([("tractrix.js", "reference", *case) for case in cases]), cases, strict=True):
        del found["curvature"]  # rounding counts where the pivot nearly stands
        check_same(found, reference(*case), 1e-11)


def test_a_drift_as_fast_as_the_robot_is_refused() -> None:
    cases = [(PATHS["square"], 1.0, 0.1, drift) for drift in (Drift(5.0), Drift(0.0, (-1.2, 0.0)))]
    assert check_parity("tractrix.js", "reference", reference, cases) == 2


CHOICES: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "rms": (("eight", "wave", "stroke", "star"), {}),
    "minimax": (("bend", "wave"), {"minimax": True}),
    "time, in a current": (("stroke", "square"), {"time_weight": 0.05, "drift": Drift(-0.05, (0.1, -0.2))}),
}


@pytest.mark.parametrize("choice", CHOICES)
def test_the_nearest_path(choice: str) -> None:
    names, options = CHOICES[choice]
    given = {"minimax": choice == "minimax", "timeWeight": options.get("time_weight", 0.0),
             "drift": options.get("drift", Drift())}  # fmt: skip
    found = lambda path, rod, radius, given: nearest_path(path, rod, radius, **options)  # noqa: E731
    cases = [(PATHS[name], rod, 0.7, given) for name in names for rod in (0.0, 0.87)]
    check_parity("nearest_feasible.js", "nearestPath", found, cases, 1e-9)


def test_shapes_of_the_page_have_their_size() -> None:
    for name, size in (("circle", 20.5), ("square", 3.0), ("triangle", 7.0), ("polygon:6", 2.0)):
        wanted = shape_of(f"{name}:{size}cm")
        assert wanted is not None
        check_near(answer("page_shapes.js", "pageShape", name, size)["points"], wanted[0].points)
    eight, wave = answers([("page_shapes.js", "pageShape", name, 40) for name in ("eight", "wave")])
    assert (eight["closed"], wave["closed"]) == (True, False)
    assert np.ptp(np.array(eight["points"])[:, 0]) == pytest.approx(40, rel=1e-3)
    assert np.ptp(np.array(wave["points"])[:, 0]) == pytest.approx(40)
    refused = answers([("page_shapes.js", "pageShape", "eight", size) for size in (0, -3, None)])
    assert all(isinstance(refusal, InputError) for refusal in refused)
