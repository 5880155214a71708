"""The pivot's reference is Python's, with and without drift."""

from __future__ import annotations

import pytest

from planner.paths.tractrix import Drift, reference
from sim.io.errors import InputError
from tests.planner.page.cases import DRIFTS, PATHS, drift_to_page
from tests.planner.page.page_core import answer, answers, check_near, refusal_of


@pytest.mark.parametrize("drift", DRIFTS)
@pytest.mark.parametrize("rod", [0.0, 0.87, 1.6])
def test_reference_of_a_path(drift: str, rod: float) -> None:
    calls = [
        ("tractrix.js", "reference", path, rod, 0.02, drift_to_page(DRIFTS[drift])) for path in PATHS.values()
    ]
    for found, path in zip(answers(calls), PATHS.values(), strict=True):
        wanted = reference(path, rod, 0.02, DRIFTS[drift])
        assert found["closed"] == wanted.closed
        for name in ("p", "q", "heading", "arc"):
            check_near(found[name], getattr(wanted, name), 1e-11)
        size = 1 + wanted.curvature**2  # rounding counts more where the pivot nearly stands
        check_near(found["curvature"] / size, wanted.curvature / size)


def test_a_drift_as_fast_as_the_robot_is_refused_in_the_same_words() -> None:
    path = PATHS["square"]
    for drift in (Drift(5.0), Drift(0.0, (-1.2, 0.0))):
        found = answer("tractrix.js", "reference", path, 1.0, 0.1, drift_to_page(drift))
        assert isinstance(found, InputError)
        assert str(found) == refusal_of(reference, path, 1.0, 0.1, drift)
