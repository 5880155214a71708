"""Small dense matrices in compiled loops: inverse by 3×3 pivots, and elimination with row exchanges."""

from __future__ import annotations

from typing import Any

from sim.arrays import Floats
from sim.jit import compiled
from sim.lanes import choose, fma, less, somewhere
from sim.linear.blocks import block_at
from sim.linear.products import add_block_product, multiply_block
from sim.linear.vectors import inverse, negative


@compiled
def invert(a: Floats) -> None:
    """Invert `a` (m, m) in place: Gauss-Jordan with 3×3 pivots, without exchanges."""
    m = a.shape[0]
    for k in range(0, m, 3):
        pivot = inverse(block_at(a, k, k))
        for i in range(3):
            for j in range(3):
                a[k + i, k + j] = 1.0 if i == j else 0.0
        multiply_block(pivot, a, k, 0, a, k, 0, m)
        for i in range(0, m, 3):
            if i != k:
                factor = block_at(a, i, k)
                for row in range(i, i + 3):
                    for j in range(k, k + 3):
                        a[row, j] = 0.0
                add_block_product(negative(factor), a, k, 0, a, i, 0, m)


@compiled
def factor_dense(a: Floats, exchanged: Floats) -> None:
    """Factor a (n, n) in place for `solve_factored`, with pivoting in each lane.

    Args:
        exchanged: (n, n), filled below the diagonal: 1 where row i takes the place of row k.
    """
    n = len(a)
    for k in range(n):
        for i in range(k + 1, n):
            exchanged[i, k] = less(abs(a[k, k]), abs(a[i, k]))
            if somewhere(exchanged[i, k]):
                _exchange(a, k, i, k, exchanged[i, k])
        scale = 1.0 / a[k, k]
        for i in range(k + 1, n):
            a[i, k] = a[i, k] * scale
            _subtract(a, k, i, k + 1, a[i, k])


@compiled
def solve_factored(a: Floats, exchanged: Floats, b: Floats) -> None:
    """Solve b = a⁻¹ b (n, K) in place with the factors that `factor_dense` left."""
    n = len(a)
    for k in range(n):
        for i in range(k + 1, n):
            if somewhere(exchanged[i, k]):
                _exchange(b, k, i, 0, exchanged[i, k])
        for i in range(k + 1, n):
            _subtract(b, k, i, 0, a[i, k])
    _substitute(a, b)


@compiled
def _exchange(a: Floats, k: int, i: int, first: int, where: Any) -> None:
    """Exchange rows k and i from column `first` on, in the lanes where a condition holds."""
    for j in range(first, a.shape[1]):
        upper, lower = a[k, j], a[i, j]
        a[k, j], a[i, j] = choose(where, lower, upper), choose(where, upper, lower)


@compiled
def _subtract(a: Floats, k: int, i: int, first: int, factor: Any) -> None:
    """Subtract a multiple of row k from row i, from column `first` on."""
    for j in range(first, a.shape[1]):
        a[i, j] = fma(-factor, a[k, j], a[i, j])


@compiled
def _substitute(a: Floats, b: Floats) -> None:
    """Solve b = u⁻¹ b (n, K) in place, with u the upper triangle of a."""
    n, columns = b.shape
    for k in range(n - 1, -1, -1):
        for i in range(columns):
            for j in range(k + 1, n):
                b[k, i] = fma(-a[k, j], b[j, i], b[k, i])
            b[k, i] = b[k, i] / a[k, k]
