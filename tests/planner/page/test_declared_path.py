"""Declared paths, their warnings and refusals are Python's."""

from __future__ import annotations

from typing import Any

import pytest

from planner.paths.path import polygon
from planner.planning.declared_path import declare
from sim.io.errors import InputError
from tests.planner.page.cases import PATHS, VEHICLES, feasibility_of
from tests.planner.page.page_core import answer, answers, check_near, refusal_of

CAR = VEHICLES["symmetric"]


@pytest.mark.parametrize("corner", ["nearest", "fillet"])
def test_declared_paths(corner: str) -> None:
    feasibility, page = feasibility_of(CAR, corner)
    paths = [*(PATHS[name] for name in ("circle", "square", "eight", "bend")), polygon(4, 1.4), polygon(3, 1.6)]
    warned = 0
    for found, path in zip(answers([("declared_path.js", "declare", p, page) for p in paths]), paths, strict=True):
        if isinstance(found, InputError):
            assert str(found) == refusal_of(declare, path, feasibility)
            continue
        wanted = declare(path, feasibility)
        check_near(found["reference"]["p"], wanted.reference.p)
        check_near([found["offDrawn"], found["missed"]], [wanted.off_drawn, wanted.missed])
        assert found["curvature"] == pytest.approx(wanted.curvature, rel=1e-9)
        assert found["warnings"] == list(wanted.warnings)
        warned += len(wanted.warnings)
    assert warned or corner == "fillet"


@pytest.mark.parametrize(
    ("corner", "options"),
    [
        ("round", {}),
        ("it's", {}),
        ("nearest", {"time_weight": -1.0}),
        ("fillet", {"time_weight": 0.1}),
        ("error", {}),
    ],
)
def test_refusals_are_in_the_same_words(corner: str, options: dict[str, Any]) -> None:
    feasibility, page = feasibility_of(CAR, corner, **options)
    found = answer("declared_path.js", "declare", PATHS["square"], page)
    assert str(found) == refusal_of(declare, PATHS["square"], feasibility)
