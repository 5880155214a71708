"""The page finds the copied rows that Python finds."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.swimmer.copied_rows import find_copies
from sim.arrays import Floats
from tests.planner.page.page_core import answers


def with_copies(seed: int, digits: int) -> tuple[Floats, Floats]:
    """Three repeats of 12 conditions; the first five rows come twice."""
    rng = np.random.default_rng(seed)
    inputs = np.repeat(rng.integers(1, 5, (12, 2)).astype(float), 3, axis=0)
    outputs = np.round(1 + 0.1 * rng.normal(size=(len(inputs), 3)), digits)
    return np.concatenate([inputs, inputs[:5]]), np.concatenate([outputs, outputs[:5]])


@pytest.mark.parametrize("digits", [6, 3, 2, 1, 0])
def test_copies_are_those_of_python(digits: int) -> None:
    tables = [with_copies(seed, digits) for seed in range(20)]
    calls = [("copied_rows.js", "findCopies", inputs.T, outputs.T) for inputs, outputs in tables]
    expected = [sorted(find_copies(*table).items()) for table in tables]
    assert [sorted(map(tuple, pairs)) for pairs in answers(calls)] == expected
    assert any(expected) == (digits > 1)
