"""Newton's equations of N chains of 3×3 blocks and the robot that carries them, in compiled loops.

    A δx + B δu = s on every tail,   C δx + D δu = t on the robot

A is block pentadiagonal: a node meets its first and second neighbours. Nodes are eliminated from the tip to the
root, so that C, which sees the first two nodes of each tail alone, needs no more. `eliminate` turns a tail's
blocks into their factors; `solve` uses them for as many right-hand sides as there are. No pivoting between nodes:
A is minus drag plus stiffness, whose symmetric part is definite.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.compiling import compiled
from sim.elimination import matrix_at, solve_dense
from sim.tail import put, vector
from sim.vectors import Matrix, applied, dot, inverse, minus, product, subtracted, times

Array = NDArray[np.float64]


class Chains(NamedTuple):
    """The equations, then their factors; blocks join a node to itself, its first and its second neighbours."""

    own: Array  # (n, N, 3, 3), then their inverses
    lower: Array  # A_{k,k−1}
    upper: Array  # A_{k−1,k}
    lower2: Array  # A_{k,k−2}
    upper2: Array  # A_{k−2,k}
    border: Array  # (n, N, 4, 3): B, columns of the body's velocities
    foot: Array  # (2, N, 4, 3): C in the first two nodes, rows of the body's equations
    corner: Array  # (4, 5): D, with room for t


@compiled
def new_chains(n: int, tails: int) -> Chains:
    return Chains(
        np.zeros((n, tails, 3, 3)),
        np.zeros((n, tails, 3, 3)),
        np.zeros((n, tails, 3, 3)),
        np.zeros((n, tails, 3, 3)),
        np.zeros((n, tails, 3, 3)),
        np.zeros((n, tails, 4, 3)),
        np.zeros((2, tails, 4, 3)),
        np.zeros((4, 5)),
    )


@compiled
def block(a: Array, k: int, m: int) -> Matrix:
    """a[k, m] as a matrix."""
    return matrix_at(a[k, m], 0, 0)


@compiled
def put_block(a: Array, k: int, m: int, b: Matrix) -> None:
    c = a[k, m]
    c[0, 0], c[0, 1], c[0, 2] = b[0]
    c[1, 0], c[1, 1], c[1, 2] = b[1]
    c[2, 0], c[2, 1], c[2, 2] = b[2]


@compiled
def eliminate(chains: Chains, m: int) -> None:
    """Reduce tail m from tip to root: own becomes its inverse; lower, lower2 and border A⁻¹ of themselves."""
    n = chains.own.shape[0]
    for k in range(n - 1, -1, -1):
        inverted = inverse(block(chains.own, k, m))
        put_block(chains.own, k, m, inverted)
        upper, upper2 = block(chains.upper, k, m), block(chains.upper2, k, m)
        lower = product(inverted, block(chains.lower, k, m))
        lower2 = product(inverted, block(chains.lower2, k, m))
        if k > 0:
            put_block(chains.lower, k, m, lower)
            own = subtracted(block(chains.own, k - 1, m), product(upper, lower))
            put_block(chains.own, k - 1, m, own)
        if k > 1:
            put_block(chains.lower2, k, m, lower2)
            below = subtracted(block(chains.lower, k - 1, m), product(upper, lower2))
            put_block(chains.lower, k - 1, m, below)
            above = subtracted(block(chains.upper, k - 1, m), product(upper2, lower))
            put_block(chains.upper, k - 1, m, above)
            own = subtracted(block(chains.own, k - 2, m), product(upper2, lower2))
            put_block(chains.own, k - 2, m, own)
        for c in range(4):
            column = applied(inverted, vector(chains.border[k], m, c))
            put(chains.border[k], m, c, column)
            if k > 0:
                first = minus(vector(chains.border[k - 1], m, c), applied(upper, column))
                put(chains.border[k - 1], m, c, first)
            if k > 1:
                second = minus(vector(chains.border[k - 2], m, c), applied(upper2, column))
                put(chains.border[k - 2], m, c, second)


@compiled
def solve(chains: Chains, s: Array, t: Array) -> None:
    """Solve with the factors, in place: s (n, N, 3) becomes δx, t (4,) becomes δu."""
    n, tails, _ = s.shape
    corner = chains.corner.copy()
    for m in range(tails):
        for k in range(n - 1, -1, -1):
            value = applied(block(chains.own, k, m), vector(s, k, m))
            put(s, k, m, value)
            if k > 0:
                put(s, k - 1, m, minus(vector(s, k - 1, m), applied(block(chains.upper, k, m), value)))
            if k > 1:
                put(s, k - 2, m, minus(vector(s, k - 2, m), applied(block(chains.upper2, k, m), value)))
        first = vector(s, 0, m)
        second = minus(vector(s, 1, m), applied(block(chains.lower, 1, m), first))
        for a in range(4):
            t[a] -= dot(vector(chains.foot[0], m, a), first) + dot(vector(chains.foot[1], m, a), second)
    corner[:, 4] = t
    solve_dense(corner, corner[:, 4:])
    t[:] = corner[:, 4]
    for m in range(tails):
        for k in range(n):
            change = vector(s, k, m)
            for c in range(4):
                change = minus(change, times(t[c], vector(chains.border[k], m, c)))
            if k > 0:
                change = minus(change, applied(block(chains.lower, k, m), vector(s, k - 1, m)))
            if k > 1:
                change = minus(change, applied(block(chains.lower2, k, m), vector(s, k - 2, m)))
            put(s, k, m, change)
