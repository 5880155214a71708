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
    inputs = rng.normal(size=(20, size)) * np.geomspace(0.1, 10, 20)[:, None]
    check_novelty(Support.learned(rng.normal(size=(4000, size)) @ rng.normal(size=(size, size))), inputs)


def test_each_input_must_be_in_its_range() -> None:
    """Beyond the range of one input the joint measure alone would be small."""
    inputs = np.zeros((2, 7))
    inputs[:, 2] = [0.99, 1.1]
    check_novelty(Support.learned(np.random.default_rng(3).uniform(-1, 1, (4000, 7))), inputs)


def check_novelty(support: Support, inputs: np.ndarray) -> None:
    page = {"limit": support.limit} | {
        name: {"values": typed(getattr(support, name).ravel())} for name in ("shift", "scale", "factor")
    }
    found = answers([("support.js", "novelty", page, row) for row in inputs])
    wanted = support.novelty(inputs)
    assert (wanted > 1).any()
    assert (wanted < 1).any()
    check_alike(np.log(found)[:, None], np.log(wanted)[:, None])
