"""Corners and the arcs that round them are Python's."""

from __future__ import annotations

import pytest

from planner.paths.fillets import fillet, kinks, largest_fillet
from tests.planner.page.cases import PATHS
from tests.planner.page.page_core import answers, check_near


@pytest.mark.parametrize("name", PATHS)
def test_kinks_and_rounded_corners(name: str) -> None:
    path = PATHS[name]
    most = largest_fillet(path)
    radii = [0.0, *(share * min(most, 2.0) for share in (0.1, 0.7, 1.0))]
    angles, largest, *rounded = answers(
        [
            ("fillets.js", "kinks", path),
            ("fillets.js", "largestFillet", path),
            *(("fillets.js", "fillet", path, radius) for radius in radii),
        ]
    )
    check_near(angles, kinks(path), 1e-12)
    assert largest == pytest.approx(most, rel=1e-12)
    for found, radius in zip(rounded, radii, strict=True):
        wanted = fillet(path, radius)
        assert found["closed"] == wanted.closed
        check_near(found["points"], wanted.points, 1e-12)
