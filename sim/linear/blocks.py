"""Vectors and 3×3 blocks in arrays: read, write, add, in compiled loops."""

from __future__ import annotations

from common.arrays import Floats
from sim.jit import borrowing
from sim.linear.vectors import Matrix, Vector, applied


@borrowing
def vector(a: Floats, k: int, m: int) -> Vector:
    """Return a[k, m] as components."""
    return (a[k, m, 0], a[k, m, 1], a[k, m, 2])


@borrowing
def put(a: Floats, k: int, m: int, v: Vector) -> None:
    """Set a[k, m] = v."""
    a[k, m, 0] = v[0]
    a[k, m, 1] = v[1]
    a[k, m, 2] = v[2]


@borrowing
def add(a: Floats, k: int, m: int, v: Vector) -> None:
    """Add in place: a[k, m] += v."""
    a[k, m, 0] += v[0]
    a[k, m, 1] += v[1]
    a[k, m, 2] += v[2]


@borrowing
def vector_at(a: Floats, i: int) -> Vector:
    """Return a[i] as components."""
    return (a[i, 0], a[i, 1], a[i, 2])


@borrowing
def put_at(a: Floats, i: int, v: Vector) -> None:
    """Set a[i] = v."""
    a[i, 0], a[i, 1], a[i, 2] = v


@borrowing
def add_at(a: Floats, i: int, v: Vector) -> None:
    """Add in place: a[i] += v."""
    a[i, 0] += v[0]
    a[i, 1] += v[1]
    a[i, 2] += v[2]


@borrowing
def block(a: Floats, k: int, m: int) -> Matrix:
    """Return a[k, m] as a 3×3 matrix."""
    return block_at(a[k, m], 0, 0)


@borrowing
def put_block(a: Floats, k: int, m: int, b: Matrix) -> None:
    """Set a[k, m] = b."""
    c = a[k, m]
    c[0, 0], c[0, 1], c[0, 2] = b[0]
    c[1, 0], c[1, 1], c[1, 2] = b[1]
    c[2, 0], c[2, 1], c[2, 2] = b[2]


@borrowing
def apply_blocks(out: Floats, blocks: Floats, a: Floats) -> None:
    """Set every out[k, m] to blocks[k, m] a[k, m]."""
    for k in range(out.shape[0]):
        for m in range(out.shape[1]):
            put(out, k, m, applied(block(blocks, k, m), vector(a, k, m)))


@borrowing
def block_at(a: Floats, row: int, column: int) -> Matrix:
    """Return the 3×3 block of `a` at (row, column)."""
    return (
        (a[row, column], a[row, column + 1], a[row, column + 2]),
        (a[row + 1, column], a[row + 1, column + 1], a[row + 1, column + 2]),
        (a[row + 2, column], a[row + 2, column + 1], a[row + 2, column + 2]),
    )
