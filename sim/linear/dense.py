"""Small dense matrices in compiled loops: inverse by 3×3 pivots, and solution with row exchanges."""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled_exactly, copied
from sim.lanes import fma, lane, lane_count, with_lane
from sim.linear.blocks import block_at
from sim.linear.products import add_block_product, multiply_block
from sim.linear.vectors import inverse, negative


@compiled_exactly
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


@compiled_exactly
def solve_dense_lanes(a: Floats, b: Floats) -> None:
    """Solve b = a⁻¹ b (n, K) in place, lane by lane, with pivoting; `a` (n, n) is kept."""
    n, columns = b.shape
    matrix, right = np.empty((n, n)), np.empty((n, columns))
    for i in range(lane_count(a)):
        for row in range(n):
            for column in range(columns):
                right[row, column] = lane(b[row, column], i)
            for column in range(n):
                matrix[row, column] = lane(a[row, column], i)
        solve_dense(matrix, right)
        for row in range(n):
            for column in range(columns):
                b[row, column] = with_lane(b[row, column], i, right[row, column])


@copied
@compiled_exactly
def solve_dense(a: Floats, b: Floats) -> None:
    """Solve b = a⁻¹ b (n, K) in place by Gaussian elimination with pivoting; a is overwritten. NaN in, NaN out."""
    n, columns = b.shape
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            for j in range(columns):
                b[k, j], b[best, j] = b[best, j], b[k, j]
        scale = 1.0 / a[k, k]
        for i in range(k + 1, n):
            factor = a[i, k] * scale
            for j in range(k + 1, n):
                a[i, j] = fma(-factor, a[k, j], a[i, j])
            for j in range(columns):
                b[i, j] = fma(-factor, b[k, j], b[i, j])
    for k in range(n - 1, -1, -1):
        for i in range(columns):
            for j in range(k + 1, n):
                b[k, i] = fma(-a[k, j], b[j, i], b[k, i])
            b[k, i] /= a[k, k]
