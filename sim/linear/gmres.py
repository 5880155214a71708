"""GMRES in compiled loops. The caller multiplies with the matrix; this file keeps the basis.

    start(krylov, b)                             b: right-hand side, preconditioned
    for i in range(most):
        w = (preconditioned matrix) krylov.basis[i]
        left = extend(krylov, i, w)              norm of the residual over the norm of b
    x = combine(krylov, i + 1)

Source: Saad and Schultz (1986); Arnoldi with modified Gram-Schmidt, least squares by Givens rotations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled


class Krylov(NamedTuple):
    """Basis (K + 1, size), triangular factor (K, K), rotations (K, 2) and rotated right-hand side (K + 1,)."""

    basis: Floats
    triangle: Floats
    rotation: Floats
    right: Floats


@compiled
def new_krylov(size: int, most: int) -> Krylov:
    """Allocate room for `most` steps on vectors of `size` entries."""
    return Krylov(np.zeros((most + 1, size)), np.zeros((most, most)), np.zeros((most, 2)), np.zeros(most + 1))


@compiled
def start(krylov: Krylov, b: Floats) -> float:
    """Begin with the right-hand side b; returns its norm."""
    norm = np.sqrt(np.dot(b, b))
    krylov.right[:] = 0.0
    krylov.right[0] = norm
    krylov.basis[0] = b / norm if norm > 0 else b
    return float(norm)


@compiled
def extend(krylov: Krylov, i: int, w: Floats) -> float:
    """Take in w, the image of basis vector i; w is changed. Returns the norm of the residual over that of b."""
    basis, triangle, rotation, right = krylov
    column = np.zeros(i + 2)
    for j in range(i + 1):
        column[j] = np.dot(basis[j], w)
        w -= column[j] * basis[j]
    length = np.sqrt(np.dot(w, w))
    column[i + 1] = length
    basis[i + 1] = w / length if length > 0 else w
    for j in range(i):
        cos, sin = rotation[j, 0], rotation[j, 1]
        column[j], column[j + 1] = cos * column[j] + sin * column[j + 1], cos * column[j + 1] - sin * column[j]
    radius = np.hypot(column[i], column[i + 1])
    cos, sin = (column[i] / radius, column[i + 1] / radius) if radius > 0 else (1.0, 0.0)
    rotation[i, 0], rotation[i, 1] = cos, sin
    triangle[: i + 1, i] = column[: i + 1]
    triangle[i, i] = radius
    right[i + 1] = -sin * right[i]
    right[i] = cos * right[i]
    norm = np.sqrt(np.dot(right[: i + 2], right[: i + 2]))  # rotations keep it: that of b
    return float(abs(right[i + 1]) / norm) if norm > 0 else 0.0


@compiled
def combine(krylov: Krylov, count: int) -> Floats:
    """Combine the first `count` basis vectors to the solution."""
    y = np.zeros(count)
    for i in range(count - 1, -1, -1):
        total = krylov.right[i]
        for j in range(i + 1, count):
            total -= krylov.triangle[i, j] * y[j]
        y[i] = total / krylov.triangle[i, i] if krylov.triangle[i, i] != 0 else 0.0
    x = np.zeros(krylov.basis.shape[1])
    for i in range(count):
        x += y[i] * krylov.basis[i]
    return x
