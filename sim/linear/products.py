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
from sim.linear.vectors import Matrix

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
def _one_vector(a: Any, b: Any, from_b: Any, c: Any, from_c: Any, i: Any, subtract: Any) -> None:
    """Compute a vector of columns in three rows."""
    p = q = r = nothing(c)
    if subtract:
        p, q, r = load(c, i, from_c), load(c, i + 1, from_c), load(c, i + 2, from_c)
    for k in range(a.shape[1]):
        w = load(b, k, from_b)
        p = fma(_signed(a[i, k], subtract), w, p)
        q = fma(_signed(a[i + 1, k], subtract), w, q)
        r = fma(_signed(a[i + 2, k], subtract), w, r)
    store(c, i, from_c, p)
    store(c, i + 1, from_c, q)
    store(c, i + 2, from_c, r)


@formula
def _some_columns(a: Any, b: Any, from_b: Any, c: Any, from_c: Any, i: Any, left: Any, subtract: Any) -> None:
    """Compute fewer columns of one robot than a vector holds, in three rows."""
    p = q = r = nothing(c)
    if subtract:
        p, q = load_some(c, i, from_c, left), load_some(c, i + 1, from_c, left)
        r = load_some(c, i + 2, from_c, left)
    for k in range(a.shape[1]):
        w = load_some(b, k, from_b, left)
        p = fma(_signed(a[i, k], subtract), w, p)
        q = fma(_signed(a[i + 1, k], subtract), w, q)
        r = fma(_signed(a[i + 2, k], subtract), w, r)
    store_some(c, i, from_c, p, left)
    store_some(c, i + 1, from_c, q, left)
    store_some(c, i + 2, from_c, r, left)


@formula
def _factors(a: Matrix) -> Matrix:
    """Return a 3×3 block as factors of vectors of columns."""
    return (
        (spread(a[0][0]), spread(a[0][1]), spread(a[0][2])),
        (spread(a[1][0]), spread(a[1][1]), spread(a[1][2])),
        (spread(a[2][0]), spread(a[2][1]), spread(a[2][2])),
    )


@formula
def _added(a: Any, x: Any, y: Any, z: Any, sum_before: Any) -> Any:
    """Compute a row of a 3×3 block times three vectors, plus a sum."""
    return fma(a[0], x, fma(a[1], y, fma(a[2], z, sum_before)))


@formula
def _summed(a: Any, x: Any, y: Any, z: Any) -> Any:
    """Compute a row of a 3×3 block times three vectors."""
    return fma(a[0], x, fma(a[1], y, a[2] * z))


@compiled_exactly
def multiply_block(
    a: Matrix, b: Floats, row_b: int, from_b: int, c: Floats, row_c: int, from_c: int, count: int
) -> None:
    """Set `count` columns of three rows of c to a 3×3 block times those of three rows of b; c may be b."""
    f, g, h = _factors(a)
    step, j = columns_at_once(b), 0
    while j + step <= count:
        x, y, z = load(b, row_b, from_b + j), load(b, row_b + 1, from_b + j), load(b, row_b + 2, from_b + j)
        store(c, row_c, from_c + j, _summed(f, x, y, z))
        store(c, row_c + 1, from_c + j, _summed(g, x, y, z))
        store(c, row_c + 2, from_c + j, _summed(h, x, y, z))
        j += step
    if j < count:
        left = count - j
        x, y = load_some(b, row_b, from_b + j, left), load_some(b, row_b + 1, from_b + j, left)
        z = load_some(b, row_b + 2, from_b + j, left)
        store_some(c, row_c, from_c + j, _summed(f, x, y, z), left)
        store_some(c, row_c + 1, from_c + j, _summed(g, x, y, z), left)
        store_some(c, row_c + 2, from_c + j, _summed(h, x, y, z), left)


@compiled_exactly
def add_block_product(
    a: Matrix, b: Floats, row_b: int, from_b: int, c: Floats, row_c: int, from_c: int, count: int
) -> None:
    """Add a 3×3 block times `count` columns of three rows of b to those of three rows of c."""
    f, g, h = _factors(a)
    step, j = columns_at_once(b), 0
    while j + step <= count:
        x, y, z = load(b, row_b, from_b + j), load(b, row_b + 1, from_b + j), load(b, row_b + 2, from_b + j)
        store(c, row_c, from_c + j, _added(f, x, y, z, load(c, row_c, from_c + j)))
        store(c, row_c + 1, from_c + j, _added(g, x, y, z, load(c, row_c + 1, from_c + j)))
        store(c, row_c + 2, from_c + j, _added(h, x, y, z, load(c, row_c + 2, from_c + j)))
        j += step
    if j < count:
        left = count - j
        x, y = load_some(b, row_b, from_b + j, left), load_some(b, row_b + 1, from_b + j, left)
        z = load_some(b, row_b + 2, from_b + j, left)
        store_some(c, row_c, from_c + j, _added(f, x, y, z, load_some(c, row_c, from_c + j, left)), left)
        store_some(c, row_c + 1, from_c + j, _added(g, x, y, z, load_some(c, row_c + 1, from_c + j, left)), left)
        store_some(c, row_c + 2, from_c + j, _added(h, x, y, z, load_some(c, row_c + 2, from_c + j, left)), left)


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
