"""Products of small matrices in compiled loops, for numbers and for vectors with a lane for each robot.

A vector holds a column of a group of robots, or eight neighbouring columns of one robot. Either way each entry is
summed in the same order by fused operations, so its bits do not depend on the width (`sim.lanes`). Three rows and
four vectors are in registers at a time; four columns of a group go through all rows before the next ones, so that
they stay in the nearest cache. Matrices have 3 K rows.
"""

from __future__ import annotations

from typing import Any

from sim.arrays import Floats
from sim.compiling import compiled_exactly, formula
from sim.lanes import columns_at_once, fma, load, load_some, nothing, spread, store, store_some
from sim.linear.vectors import Matrix, Vector

_Four = tuple[Any, Any, Any, Any]


@compiled_exactly
def multiply(a: Floats, b: Floats, from_b: int, c: Floats, from_c: int, count: int) -> None:
    """Set `count` columns of c (m, ·) from `from_c` on to a (m, k) times those of b (k, ·) from `from_b` on."""
    _multiply(a, b, from_b, c, from_c, count, False)


@compiled_exactly
def subtract_product(a: Floats, b: Floats, from_b: int, c: Floats, from_c: int, count: int) -> None:
    """Subtract a (m, k) times `count` columns of b (k, ·) from columns of c (m, ·), as in `multiply`."""
    _multiply(a, b, from_b, c, from_c, count, True)


@compiled_exactly
def _multiply(a: Floats, b: Floats, from_b: int, c: Floats, from_c: int, count: int, subtract: bool) -> None:
    step, j, rows = columns_at_once(b), 0, a.shape[0]
    while j + 4 * step <= count:
        for i in range(0, rows, 3):
            _four_vectors(a, b, from_b + j, c, from_c + j, i, subtract)
        j += 4 * step
    while j + step <= count:
        for i in range(0, rows, 3):
            _one_vector(a, b, from_b + j, c, from_c + j, i, subtract)
        j += step
    if j < count:
        for i in range(0, rows, 3):
            _some_columns(a, b, from_b + j, c, from_c + j, i, count - j, subtract)


@formula
def _four(c: Any, i: Any, at: Any) -> _Four:
    """Load four vectors of a row."""
    step = columns_at_once(c)
    return load(c, i, at), load(c, i, at + step), load(c, i, at + 2 * step), load(c, i, at + 3 * step)


@formula
def _add_four(x: Any, w: _Four, p: _Four) -> _Four:
    """Compute x w + p."""
    return fma(x, w[0], p[0]), fma(x, w[1], p[1]), fma(x, w[2], p[2]), fma(x, w[3], p[3])


@formula
def _put_four(c: Any, i: Any, at: Any, p: _Four) -> None:
    """Store four vectors in a row."""
    step = columns_at_once(c)
    store(c, i, at, p[0])
    store(c, i, at + step, p[1])
    store(c, i, at + 2 * step, p[2])
    store(c, i, at + 3 * step, p[3])


@formula
def _three(c: Any, row: Any, at: Any) -> Vector:
    """Load a vector of columns of three rows."""
    return load(c, row, at), load(c, row + 1, at), load(c, row + 2, at)


@formula
def _three_of_some(c: Any, row: Any, at: Any, left: Any) -> Vector:
    """Load fewer columns of one robot than a vector holds, of three rows."""
    return load_some(c, row, at, left), load_some(c, row + 1, at, left), load_some(c, row + 2, at, left)


@formula
def _put_three(c: Any, row: Any, at: Any, v: Vector) -> None:
    """Store a vector of columns in three rows."""
    store(c, row, at, v[0])
    store(c, row + 1, at, v[1])
    store(c, row + 2, at, v[2])


@formula
def _put_three_of_some(c: Any, row: Any, at: Any, v: Vector, left: Any) -> None:
    """Store fewer columns of one robot than a vector holds, in three rows."""
    store_some(c, row, at, v[0], left)
    store_some(c, row + 1, at, v[1], left)
    store_some(c, row + 2, at, v[2], left)


@formula
def _signed(x: Any, subtract: Any) -> Any:
    """Return a factor, negative to subtract."""
    return -spread(x) if subtract else spread(x)


@formula
def _four_vectors(a: Any, b: Any, from_b: Any, c: Any, from_c: Any, i: Any, subtract: Any) -> None:
    """Compute four vectors of columns in three rows."""
    zero = nothing(c)
    p = q = r = (zero, zero, zero, zero)
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
def _add_column(a: Any, i: Any, k: Any, subtract: Any, w: Any, p: Any, q: Any, r: Any) -> Vector:
    """Add entry k of three rows of a, or subtract it, times a vector w to their sums p, q and r."""
    return (
        fma(_signed(a[i, k], subtract), w, p),
        fma(_signed(a[i + 1, k], subtract), w, q),
        fma(_signed(a[i + 2, k], subtract), w, r),
    )


@formula
def _one_vector(a: Any, b: Any, from_b: Any, c: Any, from_c: Any, i: Any, subtract: Any) -> None:
    """Compute a vector of columns in three rows."""
    p = q = r = nothing(c)
    if subtract:
        p, q, r = _three(c, i, from_c)
    for k in range(a.shape[1]):
        w = load(b, k, from_b)
        p, q, r = _add_column(a, i, k, subtract, w, p, q, r)
    _put_three(c, i, from_c, (p, q, r))


@formula
def _some_columns(a: Any, b: Any, from_b: Any, c: Any, from_c: Any, i: Any, left: Any, subtract: Any) -> None:
    """Compute fewer columns of one robot than a vector holds, in three rows."""
    p = q = r = nothing(c)
    if subtract:
        p, q, r = _three_of_some(c, i, from_c, left)
    for k in range(a.shape[1]):
        w = load_some(b, k, from_b, left)
        p, q, r = _add_column(a, i, k, subtract, w, p, q, r)
    _put_three_of_some(c, i, from_c, (p, q, r), left)


@formula
def _factors(a: Matrix) -> Matrix:
    """Return a 3×3 block as factors of vectors of columns."""
    return (
        (spread(a[0][0]), spread(a[0][1]), spread(a[0][2])),
        (spread(a[1][0]), spread(a[1][1]), spread(a[1][2])),
        (spread(a[2][0]), spread(a[2][1]), spread(a[2][2])),
    )


@formula
def _product(a: Matrix, v: Vector) -> Vector:
    """Compute a 3×3 block times three vectors."""
    return (
        fma(a[0][0], v[0], fma(a[0][1], v[1], a[0][2] * v[2])),
        fma(a[1][0], v[0], fma(a[1][1], v[1], a[1][2] * v[2])),
        fma(a[2][0], v[0], fma(a[2][1], v[1], a[2][2] * v[2])),
    )


@formula
def _product_added(a: Matrix, v: Vector, before: Vector) -> Vector:
    """Compute a 3×3 block times three vectors, plus three others."""
    return (
        fma(a[0][0], v[0], fma(a[0][1], v[1], fma(a[0][2], v[2], before[0]))),
        fma(a[1][0], v[0], fma(a[1][1], v[1], fma(a[1][2], v[2], before[1]))),
        fma(a[2][0], v[0], fma(a[2][1], v[1], fma(a[2][2], v[2], before[2]))),
    )


@compiled_exactly
def multiply_block(
    a: Matrix, b: Floats, row_b: int, from_b: int, c: Floats, row_c: int, from_c: int, count: int
) -> None:
    """Set `count` columns of three rows of c to a 3×3 block times those of three rows of b; c may be b."""
    factors, step, j = _factors(a), columns_at_once(b), 0
    while j + step <= count:
        _put_three(c, row_c, from_c + j, _product(factors, _three(b, row_b, from_b + j)))
        j += step
    if j < count:
        left = count - j
        product = _product(factors, _three_of_some(b, row_b, from_b + j, left))
        _put_three_of_some(c, row_c, from_c + j, product, left)


@compiled_exactly
def add_block_product(
    a: Matrix, b: Floats, row_b: int, from_b: int, c: Floats, row_c: int, from_c: int, count: int
) -> None:
    """Add a 3×3 block times `count` columns of three rows of b to those of three rows of c."""
    factors, step, j = _factors(a), columns_at_once(b), 0
    while j + step <= count:
        before = _three(c, row_c, from_c + j)
        _put_three(c, row_c, from_c + j, _product_added(factors, _three(b, row_b, from_b + j), before))
        j += step
    if j < count:
        left = count - j
        before = _three_of_some(c, row_c, from_c + j, left)
        total = _product_added(factors, _three_of_some(b, row_b, from_b + j, left), before)
        _put_three_of_some(c, row_c, from_c + j, total, left)


@compiled_exactly
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
