"""Memory where the dwell before is as long as the dwell."""

from __future__ import annotations

import numpy as np

from sim.model.response import BEFORE, DWELLS, at_equal_dwells
from tests.planner.page.page_core import answer, check_near


def test_memory_at_equal_dwells() -> None:
    memory = np.random.default_rng(0).normal(size=(len(BEFORE), len(DWELLS), 3))
    found = answer("response.js", "atEqualDwells", memory.ravel())
    check_near(np.reshape(found, (-1, 3)), at_equal_dwells(memory), 1e-13)
