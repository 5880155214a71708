"""The joint support is Python's, inside and outside."""

from __future__ import annotations

import numpy as np
import pytest

from surrogate.table.support import Support
from tests.planner.page.page_core import answers, typed
from tests.planner.page.robots import check_alike


@pytest.mark.parametrize("size", [7, 13])
def test_novelty(size: int) -> None:
    rng = np.random.default_rng(0)
    support = Support.learned(rng.normal(size=(4000, size)) @ rng.normal(size=(size, size)))
    page = {"limit": support.limit} | {
        name: {"values": typed(getattr(support, name).ravel())} for name in ("shift", "scale", "factor")
    }
    inputs = rng.normal(size=(20, size)) * np.geomspace(0.1, 10, 20)[:, None]
    inputs[0] = support.shift
    inputs[0, 0] += 1.05 * support.scale[0]  # beyond the range of one input, where q is small
    found = answers([("support.js", "novelty", page, row) for row in inputs])
    wanted = support.novelty(inputs)
    assert (wanted > 1).any()
    assert (wanted < 1).any()
    check_alike(np.log(found)[:, None], np.log(wanted)[:, None])
