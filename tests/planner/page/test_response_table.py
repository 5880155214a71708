"""Curves at single dwells, and the speeds by which they are divided. `test_lookup.py` compares the curves."""

from __future__ import annotations

import numpy as np

from sim.model.response import DWELLS
from surrogate.table.response_table import between_dwells
from tests.planner.page.page_core import answer, answers, check_near


def test_between_dwells_and_at_them() -> None:
    curve = np.random.default_rng(0).normal(size=(len(DWELLS), 3))
    dwells = np.array([*DWELLS, *np.geomspace(0.2, 6, 40)])
    found = answers([("response_table.js", "betweenDwells", curve.ravel(), dwell) for dwell in dwells])
    check_near(found, between_dwells(np.broadcast_to(curve, (len(dwells), *curve.shape)), dwells), 1e-12)


def test_speeds_of_the_head() -> None:
    found = answer("response_table.js", "curveSpeeds", {"length": 0.5}, [0.1, 0.2, 0.4, -3.0, 7.0])
    check_near(found, [np.hypot(0.2, 0.02), 0.2, 0.4], 1e-15)
