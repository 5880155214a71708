"""GMRES for a group of systems, one in each lane (`sim.lanes`). The caller multiplies; this file keeps the basis.

    start(krylov, b)                             b: right-hand side, preconditioned
    for i in range(most):
        w = (preconditioned matrix) krylov.basis[i]
        left = extend(krylov, i, w, going)       norm of the residual
    solution(krylov, i + 1, x)

A lane that is not going any more keeps its solution: further vectors get zero coefficients.
Source: Saad and Schultz (1986); Arnoldi with modified Gram-Schmidt, least squares by Givens rotations.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats
from sim.jit import borrowing, compiled
from sim.lanes import choose, empty, less, zeros
from sim.linear.lane_arrays import divide, scalar_product, subtract_multiple


class Krylov(NamedTuple):
    """Basis (K + 1, size), triangular factor (K, K), rotations (K, 2) and rotated right-hand side (K + 1,)."""

    basis: Floats
    triangle: Floats
    rotation: Floats
    right: Floats


@compiled
def new_krylov(like: Floats, size: int, most: int) -> Krylov:
    """Allocate the arrays for `most` steps on vectors of `size` entries, of numbers as in `like`."""
    return Krylov(
        empty(like, (most + 1, size)), zeros(like, (most, most)), zeros(like, (most, 2)), zeros(like, (most + 1,))
    )


@borrowing
def start(krylov: Krylov, b: Floats) -> Any:
    """Begin with the right-hand side b; returns its norm."""
    norm = np.sqrt(scalar_product(b, b))
    krylov.right[0] = norm
    divide(krylov.basis[0], b, choose(less(0.0, norm), norm, 1.0))
    return norm


@borrowing
def extend(krylov: Krylov, i: int, w: Floats, going: Any) -> Any:
    """Take in w, the image of basis vector i, where `going` is 1; w is changed. Returns the residual's norm."""
    basis, triangle, rotation, right = krylov
    for j in range(i + 1):
        triangle[j, i] = scalar_product(basis[j], w)
        subtract_multiple(w, triangle[j, i], basis[j])
    length = np.sqrt(scalar_product(w, w))
    divide(basis[i + 1], w, choose(less(0.0, length), length, 1.0))
    for j in range(i):
        cos, sin, upper, lower = rotation[j, 0], rotation[j, 1], triangle[j, i], triangle[j + 1, i]
        triangle[j, i], triangle[j + 1, i] = cos * upper + sin * lower, cos * lower - sin * upper
    radius = np.sqrt(triangle[i, i] * triangle[i, i] + length * length)
    turns = less(0.0, radius)
    cos, sin = choose(turns, triangle[i, i] / radius, 1.0), choose(turns, length / radius, 0.0)
    rotation[i, 0], rotation[i, 1] = cos, sin
    triangle[i, i] = choose(turns, radius, 1.0)
    left = -sin * right[i]
    right[i + 1] = choose(going, left, 0.0)
    right[i] = choose(going, choose(turns, cos * right[i], 0.0), 0.0)
    return abs(left)


@borrowing
def solution(krylov: Krylov, count: int, x: Floats) -> None:
    """Combine the first `count` basis vectors to the solution x."""
    right = krylov.right
    for i in range(count - 1, -1, -1):
        for j in range(i + 1, count):
            right[i] -= krylov.triangle[i, j] * right[j]
        right[i] = right[i] / krylov.triangle[i, i]
    x[:] = 0.0
    for i in range(count):
        subtract_multiple(x, -right[i], krylov.basis[i])
