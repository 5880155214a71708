"""Bordered block-pentadiagonal systems with dense blocks, for one robot, in compiled loops.

    A_kk δx_k + A_{k,k±1} δx_{k±1} + A_{k,k±2} δx_{k±2} + B_k δu = s_k,   k = 1..n
    C_1 δx_1 + C_2 δx_2 + D δu = t

A block has m = 3 M rows: the components of one node in M lanes. Blocks at distance two couple a lane to itself
only and are kept as M matrices of 3×3; the others fill up. Nodes are eliminated from the tip to the root, so that
the Schur complement of the body needs the first two nodes alone:

    Z_k = A_kk⁻¹ [A_{k,k−1} | A_{k,k−2} | B_k  s_k],   rows k−1 and k−2 −= A_{k−1,k} Z_k and A_{k−2,k} Z_k.

No pivoting between nodes: A is minus drag plus stiffness, whose symmetric part is definite. There may be several
right-hand sides: one for Newton's method, one a parameter for sensitivities. `again` solves for one more with what
`solve` leaves behind. Cost: about 8 m³ multiplications a node, nearly all of them in matrix products (BLAS).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.compiling import compiled
from sim.vectors import Matrix, inverse

Array = NDArray[np.float64]


class System(NamedTuple):
    """The equations; c = number of body unknowns + number of right-hand sides."""

    rows: Array  # (n, m, 2 m + c): A_kk | A_{k,k−1} | B_k, s_k
    upper: Array  # (n, m, m): A_{k−1,k}
    upper2: Array  # (n, M, 3, 3): A_{k−2,k}
    lower2: Array  # (n, M, 3, 3): A_{k,k−2}
    foot: Array  # (2, unknowns, m): C
    corner: Array  # (unknowns, c): D | t
    folded: Array  # (n, m, 2 m + c): Z
    right: Array  # (m, 2 m + c)
    product: Array  # (m, 2 m + c)
    inverse: Array  # (n, m, m)
    schur: Array  # (unknowns, unknowns)


@compiled
def new_system(n: int, lanes: int, unknowns: int, sides: int) -> System:
    """Room for n ≥ 2 nodes in `lanes` lanes, a body of `unknowns` velocities and `sides` right-hand sides."""
    m, c = 3 * lanes, unknowns + sides
    return System(
        np.zeros((n, m, 2 * m + c)),
        np.zeros((n, m, m)),
        np.zeros((n, lanes, 3, 3)),
        np.zeros((n, lanes, 3, 3)),
        np.zeros((2, unknowns, m)),
        np.zeros((unknowns, c)),
        np.zeros((n, m, 2 * m + c)),
        np.zeros((m, 2 * m + c)),
        np.zeros((m, 2 * m + c)),
        np.zeros((n, m, m)),
        np.zeros((unknowns, unknowns)),
    )


@compiled
def clear(system: System) -> None:
    """Set all that is summed up to zero."""
    system.rows[:] = 0.0
    system.upper[:] = 0.0
    system.upper2[:] = 0.0
    system.lower2[:] = 0.0
    system.foot[:] = 0.0
    system.corner[:] = 0.0


@compiled
def matrix_at(a: Array, row: int, column: int) -> Matrix:
    """The 3×3 block of `a` at (row, column)."""
    return (
        (a[row, column], a[row, column + 1], a[row, column + 2]),
        (a[row + 1, column], a[row + 1, column + 1], a[row + 1, column + 2]),
        (a[row + 2, column], a[row + 2, column + 1], a[row + 2, column + 2]),
    )


@compiled
def invert(a: Array) -> None:
    """Invert `a` (m, m) in place: Gauss-Jordan, a 3×3 pivot at a time."""
    m = a.shape[0]
    for k in range(0, m, 3):
        pivot = inverse(matrix_at(a, k, k))
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
def solve_dense(a: Array, b: Array) -> None:
    """b = a⁻¹ b (n, K) in place by Gaussian elimination with row exchanges; a is used up. NaN in, NaN out."""
    n, sides = b.shape
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            for j in range(sides):
                b[k, j], b[best, j] = b[best, j], b[k, j]
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k]
            for j in range(k + 1, n):
                a[i, j] -= factor * a[k, j]
            for j in range(sides):
                b[i, j] -= factor * b[k, j]
    for k in range(n - 1, -1, -1):
        for i in range(sides):
            for j in range(k + 1, n):
                b[k, i] -= a[k, j] * b[j, i]
            b[k, i] /= a[k, k]


@compiled
def _gather(system: System, i: int) -> None:
    """right = [A_{i,i−1} | A_{i,i−2} | B_i, s_i]."""
    row, right = system.rows[i], system.right
    m = row.shape[0]
    for a in range(m):
        for j in range(m):
            right[a, j] = row[a, m + j]
            right[a, m + j] = 0.0
        for j in range(2 * m, row.shape[1]):
            right[a, j] = row[a, j]
    for lane in range(m // 3):
        for a in range(3):
            for b in range(3):
                right[3 * lane + a, m + 3 * lane + b] = system.lower2[i, lane, a, b]


@compiled
def _fold_two_up(system: System, i: int) -> None:
    """Rows i − 2 −= A_{i−2,i} Z_i, whose first column block belongs to node i − 1."""
    above, upper, folded = system.rows[i - 2], system.upper[i - 1], system.folded[i]
    m, width = above.shape
    for lane in range(m // 3):
        for a in range(3):
            row = 3 * lane + a
            for b in range(3):
                factor, source = system.upper2[i, lane, a, b], 3 * lane + b
                for j in range(m):
                    upper[row, j] -= factor * folded[source, j]
                    above[row, j] -= factor * folded[source, m + j]
                for j in range(2 * m, width):
                    above[row, j] -= factor * folded[source, j]


@compiled
def solve(system: System, dx: Array, du: Array) -> None:
    """Solve for dx (n, m, K) and du (unknowns, K), K right-hand sides; the equations turn into their factors."""
    n, m, _ = system.rows.shape
    unknowns, _sides = du.shape
    for i in range(n - 1, -1, -1):
        system.inverse[i] = system.rows[i][:, :m]
        invert(system.inverse[i])
        _gather(system, i)
        np.dot(system.inverse[i], system.right, system.folded[i])
        if i > 0:
            np.dot(system.upper[i], system.folded[i], system.product)
            system.rows[i - 1] -= system.product
        if i > 1:
            _fold_two_up(system, i)
    first = np.ascontiguousarray(system.folded[0][:, 2 * m :])
    second = system.folded[1][:, 2 * m :] - np.dot(np.ascontiguousarray(system.folded[1][:, :m]), first)
    schur = system.corner - np.dot(system.foot[0], first) - np.dot(system.foot[1], second)
    du[:] = schur[:, unknowns:]
    system.schur[:] = schur[:, :unknowns]
    solve_dense(schur, du)
    for i in range(n):
        dx[i] = system.folded[i][:, 2 * m + unknowns :]
    _back(system, dx, du)


@compiled
def _back(system: System, dx: Array, du: Array) -> None:
    """From the root to the tip: dx comes in as A⁻¹ s of each node without its neighbours."""
    n, m, sides = dx.shape
    unknowns = du.shape[0]
    for i in range(n):
        folded = system.folded[i]
        for a in range(m):
            for side in range(sides):
                value = dx[i, a, side]
                for j in range(unknowns):
                    value -= folded[a, 2 * m + j] * du[j, side]
                if i > 0:
                    for j in range(m):
                        value -= folded[a, j] * dx[i - 1, j, side]
                if i > 1:
                    for j in range(m):
                        value -= folded[a, m + j] * dx[i - 2, j, side]
                dx[i, a, side] = value


@compiled
def again(system: System, s: Array, t: Array) -> None:
    """Solve with the factors that `solve` left, in place: s (n, m) becomes dx, t (unknowns,) becomes du."""
    n, m = s.shape
    lanes = m // 3
    for i in range(n - 1, -1, -1):
        s[i] = np.dot(system.inverse[i], s[i])
        if i > 0:
            s[i - 1] -= np.dot(system.upper[i], s[i])
        if i > 1:
            for lane in range(lanes):
                for a in range(3):
                    for b in range(3):
                        s[i - 2, 3 * lane + a] -= system.upper2[i, lane, a, b] * s[i, 3 * lane + b]
    second = s[1] - np.dot(np.ascontiguousarray(system.folded[1][:, :m]), s[0])
    t -= np.dot(system.foot[0], s[0]) + np.dot(system.foot[1], second)
    right = t.copy().reshape(-1, 1)
    solve_dense(system.schur.copy(), right)
    t[:] = right[:, 0]
    _back(system, s.reshape(n, m, 1), right)
