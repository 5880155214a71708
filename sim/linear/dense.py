"""Small dense matrices in compiled loops: inverse by 3×3 pivots, and solution with row exchanges."""

from __future__ import annotations

from sim.arrays import Floats
from sim.compiling import compiled
from sim.linear.blocks import block_at
from sim.linear.vectors import inverse


@compiled
def invert(a: Floats) -> None:
    """Invert `a` (m, m) in place: Gauss-Jordan with 3×3 pivots, without exchanges."""
    m = a.shape[0]
    for k in range(0, m, 3):
        pivot = inverse(block_at(a, k, k))
        for i in range(3):
            for j in range(3):
                a[k + i, k + j] = 1.0 if i == j else 0.0
        for j in range(m):
            x, y, z = a[k, j], a[k + 1, j], a[k + 2, j]
            a[k, j] = pivot[0][0] * x + pivot[0][1] * y + pivot[0][2] * z
            a[k + 1, j] = pivot[1][0] * x + pivot[1][1] * y + pivot[1][2] * z
            a[k + 2, j] = pivot[2][0] * x + pivot[2][1] * y + pivot[2][2] * z
        for i in range(m):
            if i < k or i > k + 2:
                f, g, h = a[i, k], a[i, k + 1], a[i, k + 2]
                a[i, k] = a[i, k + 1] = a[i, k + 2] = 0.0
                for j in range(m):
                    a[i, j] -= f * a[k, j] + g * a[k + 1, j] + h * a[k + 2, j]


@compiled
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
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k]
            for j in range(k + 1, n):
                a[i, j] -= factor * a[k, j]
            for j in range(columns):
                b[i, j] -= factor * b[k, j]
    for k in range(n - 1, -1, -1):
        for i in range(columns):
            for j in range(k + 1, n):
                b[k, i] -= a[k, j] * b[j, i]
            b[k, i] /= a[k, k]
