"""What helps a path that is too tight is the same, in the same words."""

from __future__ import annotations

import numpy as np
import pytest

from planner.paths.path import Path2D, circle, polygon
from planner.planning.remedy import remedy
from tests.planner.page.cases import VEHICLES, feasibility_of
from tests.planner.page.page_core import answer

CAR = VEHICLES["symmetric"]
RNG = np.random.default_rng(3)
CLEAN = circle(2.0).points
PATHS = {
    "small square": polygon(4, 0.3),
    "noisy circle": Path2D.of(CLEAN + 0.05 * RNG.normal(size=CLEAN.shape), closed=True),
    "noise": Path2D.of(0.4 * RNG.normal(size=(60, 2))),
    "hairpins": Path2D.of([[x, 0.3 * (x % 2)] for x in range(12)]).scaled(0.2),
}


@pytest.mark.parametrize("corner", ["nearest", "fillet", "error"])
@pytest.mark.parametrize("name", PATHS)
def test_remedies(name: str, corner: str) -> None:
    feasibility, page = feasibility_of(CAR, corner)
    path = PATHS[name]
    try:
        wanted = remedy(path, feasibility)
    except ValueError as refusal:  # a corner that is not allowed
        wanted = str(refusal)
    assert str(answer("remedy.js", "remedy", path, page)) == wanted
