"""Linear equations of M chains of 3×3 blocks and of the body that carries them, in compiled loops.

    A_m δx_m + B_m δu = s_m on every chain,   Σ_m C_m δx_m + D δu = t on the body

A chain is a tail at one instant. A_m is block pentadiagonal: a node is coupled to its first and second neighbours.
δu has four entries. `Chains` holds the equations. If the chains are coupled through the body only, `factor` and
`solve` of this file solve them. If they are coupled in time, too, `sim.linear.coupled` does.

Nodes are eliminated from the tip to the root, because C depends only on the first two nodes of each chain. There
is no pivoting between nodes: A is minus (drag plus stiffness), whose symmetric part is definite.
"""

from __future__ import annotations

from typing import NamedTuple

from common.arrays import Floats
from sim.jit import borrowing, compiled
from sim.lanes import zeros
from sim.linear.blocks import block, put, put_block, vector
from sim.linear.dense import factor_dense, solve_factored
from sim.linear.vectors import applied, dot, inverse, minus, product, subtracted, times


class Chains(NamedTuple):
    """The equations of M chains of n nodes, and of the body at P instants; `factor` overwrites them."""

    diagonal: Floats  # (n, M, 3, 3): A_kk; then its inverse
    lower: Floats  # A_{k,k−1}
    upper: Floats  # A_{k−1,k}
    lower2: Floats  # A_{k,k−2}
    upper2: Floats  # A_{k−2,k}
    border: Floats  # (n, M, 4, 3): B, columns of the body's unknowns
    foot: Floats  # (2, M, 4, 3): C in the first two nodes, rows of the body's equations
    corner: Floats  # (P, 4, 4): D; then, for one instant, the factors of the body's equations
    exchanged: Floats  # (4, 4): row exchanges of these factors


@compiled
def new_chains(like: Floats, n: int, chains: int, instants: int) -> Chains:
    """Allocate the arrays for M chains of n ≥ 2 nodes and P instants, of numbers as in `like`."""
    return Chains(
        zeros(like, (n, chains, 3, 3)),
        zeros(like, (n, chains, 3, 3)),
        zeros(like, (n, chains, 3, 3)),
        zeros(like, (n, chains, 3, 3)),
        zeros(like, (n, chains, 3, 3)),
        zeros(like, (n, chains, 4, 3)),
        zeros(like, (2, chains, 4, 3)),
        zeros(like, (instants, 4, 4)),
        zeros(like, (4, 4)),
    )


@borrowing
def factor_and_solve(chains: Chains, s: Floats, t: Floats) -> None:
    """Factor the equations and solve them: s (n, M, 3) becomes δx, t (4,) becomes δu. See `factor`, `solve`."""
    factor(chains)
    solve(chains, s, t)


@borrowing
def factor(chains: Chains) -> None:
    """Eliminate chains of one instant, and factor the body's equations.

    The diagonal becomes its inverse, lower and border A⁻¹ of themselves, the corner the factors.
    """
    corner = chains.corner[0]
    for m in range(chains.diagonal.shape[1]):
        _eliminate(chains, m)
        lower = block(chains.lower, 1, m)
        for c in range(4):
            first = vector(chains.border[0], m, c)
            second = minus(vector(chains.border[1], m, c), applied(lower, first))
            for a in range(4):
                corner[a, c] -= dot(vector(chains.foot[0], m, a), first)
                corner[a, c] -= dot(vector(chains.foot[1], m, a), second)
    factor_dense(corner, chains.exchanged)


@borrowing
def _eliminate(chains: Chains, m: int) -> None:
    """Eliminate chain m from tip to root."""
    n = chains.diagonal.shape[0]
    for k in range(n - 1, -1, -1):
        inverted = inverse(block(chains.diagonal, k, m))
        put_block(chains.diagonal, k, m, inverted)
        upper, upper2 = block(chains.upper, k, m), block(chains.upper2, k, m)
        lower = product(inverted, block(chains.lower, k, m))
        lower2 = product(inverted, block(chains.lower2, k, m))
        if k > 0:
            put_block(chains.lower, k, m, lower)
            diagonal = subtracted(block(chains.diagonal, k - 1, m), product(upper, lower))
            put_block(chains.diagonal, k - 1, m, diagonal)
        if k > 1:
            put_block(chains.lower2, k, m, lower2)
            below = subtracted(block(chains.lower, k - 1, m), product(upper, lower2))
            put_block(chains.lower, k - 1, m, below)
            above = subtracted(block(chains.upper, k - 1, m), product(upper2, lower))
            put_block(chains.upper, k - 1, m, above)
            diagonal = subtracted(block(chains.diagonal, k - 2, m), product(upper2, lower2))
            put_block(chains.diagonal, k - 2, m, diagonal)
        for c in range(4):
            column = applied(inverted, vector(chains.border[k], m, c))
            put(chains.border[k], m, c, column)
            if k > 0:
                first = minus(vector(chains.border[k - 1], m, c), applied(upper, column))
                put(chains.border[k - 1], m, c, first)
            if k > 1:
                second = minus(vector(chains.border[k - 2], m, c), applied(upper2, column))
                put(chains.border[k - 2], m, c, second)


@borrowing
def solve(chains: Chains, s: Floats, t: Floats) -> None:
    """Solve with the factors, in place: s (n, M, 3) becomes δx, t (4,) becomes δu."""
    n, count, _ = s.shape
    for m in range(count):
        for k in range(n - 1, -1, -1):
            value = applied(block(chains.diagonal, k, m), vector(s, k, m))
            put(s, k, m, value)
            if k > 0:
                put(s, k - 1, m, minus(vector(s, k - 1, m), applied(block(chains.upper, k, m), value)))
            if k > 1:
                put(s, k - 2, m, minus(vector(s, k - 2, m), applied(block(chains.upper2, k, m), value)))
        first = vector(s, 0, m)
        second = minus(vector(s, 1, m), applied(block(chains.lower, 1, m), first))
        for a in range(4):
            t[a] -= dot(vector(chains.foot[0], m, a), first) + dot(vector(chains.foot[1], m, a), second)
    solve_factored(chains.corner[0], chains.exchanged, t.reshape((t.size, 1)))
    for m in range(count):
        for k in range(n):
            change = vector(s, k, m)
            for c in range(4):
                change = minus(change, times(t[c], vector(chains.border[k], m, c)))
            if k > 0:
                change = minus(change, applied(block(chains.lower, k, m), vector(s, k - 1, m)))
            if k > 1:
                change = minus(change, applied(block(chains.lower2, k, m), vector(s, k - 2, m)))
            put(s, k, m, change)
