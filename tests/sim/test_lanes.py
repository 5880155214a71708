"""Matrices in lanes: each exchanges its own rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sim.arrays import Floats
from sim.compiling import compiled_exactly
from sim.lanes import GROUP, lanes
from sim.linear.dense import factor_dense, solve_factored


@compiled_exactly
def factored(a: Floats, exchanged: Floats, b: Floats, width: Any) -> None:
    """Factor a and solve for b with the factors, twice."""
    x, y, z = lanes(a, width), lanes(exchanged, width), lanes(b, width)
    factor_dense(x, y)
    solve_factored(x, y, z)
    solve_factored(x, y, z)


def test_each_lane_exchanges_its_own_rows() -> None:
    rng, width = np.random.default_rng(7), len(GROUP)
    a, b = rng.normal(size=(8, 8, width)), rng.normal(size=(8, 3, width))
    factors, found, exchanged = a.copy(), b.copy(), np.zeros_like(a)
    factored(factors, exchanged, found, GROUP)
    for i in range(width):
        matrix = a[:, :, i]
        assert matrix @ matrix @ found[:, :, i] == pytest.approx(b[:, :, i], abs=1e-9)
    assert exchanged.any(axis=(0, 1)).all()
    assert len({part.tobytes() for part in np.moveaxis(exchanged, -1, 0)}) == width
