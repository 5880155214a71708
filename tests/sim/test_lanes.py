"""Numbers in lanes: conditions, products and inverses have the bits of one lane, at any width."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sim.arrays import Floats
from sim.compiling import compiled_exactly
from sim.lanes import ALONE, GROUP, HALF_GROUP, choose, fma, lanes, larger, less, somewhere
from sim.linear.dense import factor_dense, invert, solve_factored
from sim.linear.products import multiply, subtract_product

WIDTHS = [ALONE, HALF_GROUP, GROUP]


@compiled_exactly
def in_lanes(a: Floats, out: Floats, width: Any) -> bool:
    """Fill (5, W) with what conditions and functions make of a (2, W); tell whether a[0] > a[1] anywhere."""
    x, y = lanes(a, width)[0], lanes(a, width)[1]
    results = lanes(out, width)
    results[0] = choose(less(x, y), np.sqrt(abs(x)), -x / y)
    results[1] = larger(x, y)
    results[2] = fma(x, y, 1.0)
    results[3] = np.cos(x) + 2 * np.sin(y)
    results[4] = 0.0 * x + 3
    return somewhere(less(y, x))


@compiled_exactly
def products(a: Floats, b: Floats, c: Floats, first: int, count: int, width: Any) -> None:
    """Subtract a b from columns of c, set the next ones to a b, and invert a."""
    x, y, z = lanes(a, width), lanes(b, width), lanes(c, width)
    subtract_product(x, y, first, z, first, count)
    multiply(x, y, first, z, first + count, count)
    invert(x)


@compiled_exactly
def factored(a: Floats, exchanged: Floats, b: Floats, width: Any) -> None:
    """Factor a and solve for b with the factors, twice."""
    x, y, z = lanes(a, width), lanes(exchanged, width), lanes(b, width)
    factor_dense(x, y)
    solve_factored(x, y, z)
    solve_factored(x, y, z)


@pytest.mark.parametrize("width", WIDTHS)
def test_each_lane_exchanges_its_own_rows(width: tuple[int, ...]) -> None:
    rng = np.random.default_rng(7)
    a, b = rng.normal(size=(8, 8, len(width))), rng.normal(size=(8, 3, len(width)))
    factors, found, exchanged = a.copy(), b.copy(), np.zeros_like(a)
    factored(factors, exchanged, found, width)
    for i in range(len(width)):
        matrix = a[:, :, i]
        assert matrix @ matrix @ found[:, :, i] == pytest.approx(b[:, :, i], abs=1e-9)
        alone = [np.ascontiguousarray(part[:, :, i : i + 1]) for part in (a, np.zeros_like(a), b)]
        factored(*alone, ALONE)
        assert np.array_equal(alone[2][:, :, 0], found[:, :, i])
    assert exchanged.any(axis=(0, 1)).all()
    assert len({part.tobytes() for part in np.moveaxis(exchanged, -1, 0)}) == len(width)


@pytest.mark.parametrize("width", WIDTHS)
def test_conditions_and_functions_are_those_of_numbers(width: tuple[int, ...]) -> None:
    a = np.random.default_rng(len(width)).normal(size=(2, len(width)))
    a[1, 0] = abs(a[0, 0]) + 1
    out = np.empty((5, len(width)))
    x, y = a
    assert in_lanes(a, out, width) == bool((y < x).any())
    wanted = [
        np.where(x < y, np.sqrt(abs(x)), -x / y),
        np.maximum(x, y),
        x * y + 1,
        np.cos(x) + 2 * np.sin(y),
        3 + 0 * x,
    ]
    assert out == pytest.approx(np.array(wanted), rel=1e-15, abs=1e-15)
    a[0, -1] = np.nan
    in_lanes(a, out, width)
    assert np.isnan(out[:4, -1]).sum() >= 3
    assert not np.isnan(out[:, :-1]).any()


@pytest.mark.parametrize(("rows", "count"), [(3, 1), (6, 7), (9, 8), (12, 21), (18, 49)])
def test_products_and_inverses_have_the_same_bits_at_any_width(rows: int, count: int) -> None:
    rng = np.random.default_rng(rows)
    a = rng.normal(size=(rows, rows, 8)) + 3 * rows * np.eye(rows)[:, :, None]
    b, c = rng.normal(size=(rows, 2 * count + 2, 8)), rng.normal(size=(rows, 2 * count + 2, 8))
    found = []
    for width in WIDTHS:
        parts = []
        for at in range(0, 8, len(width)):
            lane = slice(at, at + len(width))
            x, y, z = (array[..., lane].copy() for array in (a, b, c))
            products(x, y, z, 1, count, width)
            parts.append((x, z))
        found.append([np.concatenate(arrays, -1) for arrays in zip(*parts, strict=True)])
    product = np.einsum("ijw,jkw->ikw", a, b[:, 1 : count + 1])
    wanted = c.copy()
    wanted[:, 1 : count + 1] -= product
    wanted[:, count + 1 : 2 * count + 1] = product
    assert found[0][1] == pytest.approx(wanted, rel=1e-12, abs=1e-12)
    assert np.einsum("ijw,jkw->ikw", found[0][0], a) == pytest.approx(
        np.broadcast_to(np.eye(rows)[:, :, None], a.shape), abs=1e-12
    )
    for other in found[1:]:
        assert all(np.array_equal(p, q) for p, q in zip(found[0], other, strict=True))
