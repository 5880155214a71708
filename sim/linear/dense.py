"""Small dense matrices of vectors in compiled loops: products, inverse, and elimination with row exchanges.

Each entry is a vector with a lane for each robot (`sim.lanes`). Each entry of a product is summed in the same
order by fused operations. Three rows and four columns are in registers at a time; four columns go through all rows
before the next ones, so that they stay in the nearest cache. Matrices have 3 K rows. Inverses are Gauss-Jordan
with 3×3 pivots.
"""

from __future__ import annotations

from typing import Any

from common.arrays import Floats
from sim.jit import borrowing, formula
from sim.lanes import choose, fma, less, somewhere
from sim.linear.blocks import block_at
from sim.linear.vectors import Matrix, Vector, inverse, negative

_Four = tuple[Any, Any, Any, Any]


@borrowing
def multiply(a: Floats, b: Floats, from_b: int, c: Floats, from_c: int, count: int) -> None:
    """Set `count` columns of c (m, ·) from `from_c` on to a (m, k) times those of b (k, ·) from `from_b` on."""
    _multiply(a, b, from_b, c, from_c, count, False)


@borrowing
def subtract_product(a: Floats, b: Floats, from_b: int, c: Floats, from_c: int, count: int) -> None:
    """Subtract a (m, k) times `count` columns of b (k, ·) from columns of c (m, ·), as in `multiply`."""
    _multiply(a, b, from_b, c, from_c, count, True)


@borrowing
def _multiply(a: Floats, b: Floats, from_b: int, c: Floats, from_c: int, count: int, subtract: bool) -> None:
    whole = count - count % 4
    for j in range(0, whole, 4):
        for i in range(0, a.shape[0], 3):
            _four_columns(a, b, from_b + j, c, from_c + j, i, subtract)
    for j in range(whole, count):
        for i in range(0, a.shape[0], 3):
            _one_column(a, b, from_b + j, c, from_c + j, i, subtract)


@formula
def _four(c: Any, i: Any, j: Any) -> _Four:
    """Return four entries of a row."""
    return c[i, j], c[i, j + 1], c[i, j + 2], c[i, j + 3]


@formula
def _add_four(x: Any, w: _Four, p: _Four) -> _Four:
    """Compute x w + p."""
    return fma(x, w[0], p[0]), fma(x, w[1], p[1]), fma(x, w[2], p[2]), fma(x, w[3], p[3])


@formula
def _put_four(c: Any, i: Any, j: Any, p: _Four) -> None:
    """Set what `_four` returns."""
    c[i, j], c[i, j + 1], c[i, j + 2], c[i, j + 3] = p


@formula
def _four_columns(a: Any, b: Any, from_b: Any, c: Any, from_c: Any, i: Any, subtract: Any) -> None:
    """Compute four columns in three rows."""
    p = q = r = (0.0, 0.0, 0.0, 0.0)
    if subtract:
        p, q, r = _four(c, i, from_c), _four(c, i + 1, from_c), _four(c, i + 2, from_c)
    for k in range(a.shape[1]):
        w = _four(b, k, from_b)
        p = _add_four(_signed(a[i, k], subtract), w, p)
        q = _add_four(_signed(a[i + 1, k], subtract), w, q)
        r = _add_four(_signed(a[i + 2, k], subtract), w, r)
    _put_four(c, i, from_c, p)
    _put_four(c, i + 1, from_c, q)
    _put_four(c, i + 2, from_c, r)


@formula
def _signed(x: Any, subtract: Any) -> Any:
    """Return a factor, negative to subtract."""
    return -x if subtract else x


@formula
def _one_column(a: Any, b: Any, j_b: Any, c: Any, j_c: Any, i: Any, subtract: Any) -> None:
    """Compute a column in three rows."""
    p = q = r = 0.0
    if subtract:
        p, q, r = _three(c, i, j_c)
    for k in range(a.shape[1]):
        w = b[k, j_b]
        p = fma(_signed(a[i, k], subtract), w, p)
        q = fma(_signed(a[i + 1, k], subtract), w, q)
        r = fma(_signed(a[i + 2, k], subtract), w, r)
    _put_three(c, i, j_c, (p, q, r))


@formula
def _three(c: Any, i: Any, j: Any) -> Vector:
    """Return three entries of a column."""
    return c[i, j], c[i + 1, j], c[i + 2, j]


@formula
def _put_three(c: Any, i: Any, j: Any, v: Vector) -> None:
    """Set what `_three` returns."""
    c[i, j], c[i + 1, j], c[i + 2, j] = v


@borrowing
def multiply_block(
    a: Matrix, b: Floats, row_b: int, from_b: int, c: Floats, row_c: int, from_c: int, count: int
) -> None:
    """Set `count` columns of three rows of c to a 3×3 block times those of three rows of b; c may be b."""
    for j in range(count):
        v = _three(b, row_b, from_b + j)
        _put_three(
            c,
            row_c,
            from_c + j,
            (
                fma(a[0][0], v[0], fma(a[0][1], v[1], a[0][2] * v[2])),
                fma(a[1][0], v[0], fma(a[1][1], v[1], a[1][2] * v[2])),
                fma(a[2][0], v[0], fma(a[2][1], v[1], a[2][2] * v[2])),
            ),
        )


@borrowing
def add_block_product(
    a: Matrix, b: Floats, row_b: int, from_b: int, c: Floats, row_c: int, from_c: int, count: int
) -> None:
    """Add a 3×3 block times `count` columns of three rows of b to those of three rows of c."""
    for j in range(count):
        v, p = _three(b, row_b, from_b + j), _three(c, row_c, from_c + j)
        _put_three(
            c,
            row_c,
            from_c + j,
            (
                fma(a[0][0], v[0], fma(a[0][1], v[1], fma(a[0][2], v[2], p[0]))),
                fma(a[1][0], v[0], fma(a[1][1], v[1], fma(a[1][2], v[2], p[1]))),
                fma(a[2][0], v[0], fma(a[2][1], v[1], fma(a[2][2], v[2], p[2]))),
            ),
        )


@borrowing
def apply(a: Floats, from_a: int, x: Floats, count: int, y: Floats) -> None:
    """Set y (m,) to `count` columns of a (m, ·) from `from_a` on, times x."""
    for i in range(0, a.shape[0], 3):
        p = q = r = s = t = v = 0.0
        even = count - count % 2
        for k in range(0, even, 2):
            j = from_a + k
            p, s = fma(a[i, j], x[k], p), fma(a[i, j + 1], x[k + 1], s)
            q, t = fma(a[i + 1, j], x[k], q), fma(a[i + 1, j + 1], x[k + 1], t)
            r, v = fma(a[i + 2, j], x[k], r), fma(a[i + 2, j + 1], x[k + 1], v)
        for k in range(even, count):
            j = from_a + k
            p, q, r = fma(a[i, j], x[k], p), fma(a[i + 1, j], x[k], q), fma(a[i + 2, j], x[k], r)
        y[i], y[i + 1], y[i + 2] = p + s, q + t, r + v


@borrowing
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


@borrowing
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


@borrowing
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


@borrowing
def _exchange(a: Floats, k: int, i: int, first: int, where: Any) -> None:
    """Exchange rows k and i from column `first` on, in the lanes where a condition holds."""
    for j in range(first, a.shape[1]):
        upper, lower = a[k, j], a[i, j]
        a[k, j], a[i, j] = choose(where, lower, upper), choose(where, upper, lower)


@borrowing
def _subtract(a: Floats, k: int, i: int, first: int, factor: Any) -> None:
    """Subtract a multiple of row k from row i, from column `first` on."""
    for j in range(first, a.shape[1]):
        a[i, j] = fma(-factor, a[k, j], a[i, j])


@borrowing
def _substitute(a: Floats, b: Floats) -> None:
    """Solve b = u⁻¹ b (n, K) in place, with u the upper triangle of a."""
    n, columns = b.shape
    for k in range(n - 1, -1, -1):
        for i in range(columns):
            for j in range(k + 1, n):
                b[k, i] = fma(-a[k, j], b[j, i], b[k, i])
            b[k, i] = b[k, i] / a[k, k]
