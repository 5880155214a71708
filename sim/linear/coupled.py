"""Chains that are coupled in time: block-pentadiagonal systems with dense blocks and a border.

On a periodic orbit the velocity of a node at one phase depends on its position at all phases,
ẋ_m = ω_m Σ_j D_mj x_j. So the blocks of one node in all M chains (`sim.linear.chains`) form one dense block of 3 M
rows. The coupling of chains m and j is −ω_m D_mj R_m, with R_m the node's resistance:

    A_kk δx_k + A_{k,k±1} δx_{k±1} + A_{k,k±2} δx_{k±2} + B_k δu = s_k,   k = 1..n
    C_1 δx_1 + C_2 δx_2 + D δu = t

Blocks at distance two do not couple the chains, so they stay M matrices of 3×3. The other blocks become dense.
Nodes are eliminated from the tip to the root, so that the Schur complement of the body needs the first two nodes
only:

    Z_k = A_kk⁻¹ [B_k | s_k | A_{k,k−1} | A_{k,k−2}],   rows k−1 and k−2 −= A_{k−1,k} Z_k and A_{k−2,k} Z_k.

The first right-hand side is eliminated together with the matrix. `solve` uses the stored factors for further ones.

There is no pivoting between nodes: A is minus (drag plus stiffness), whose symmetric part is definite. Cost: about
4 m³ multiplications for each node, m = 3 M, nearly all of them in matrix products (`sim.linear.dense`).
"""

from __future__ import annotations

from typing import NamedTuple

from common.arrays import Floats
from sim.jit import borrowing, compiled
from sim.lanes import empty, fma, zeros
from sim.linear.blocks import block, block_at
from sim.linear.chains import Chains
from sim.linear.dense import (
    add_block_product,
    apply,
    factor_dense,
    invert,
    multiply,
    multiply_block,
    solve_factored,
    subtract_product,
)  # fmt: skip
from sim.linear.lane_arrays import copy
from sim.linear.vectors import negative


class Coupled(NamedTuple):
    """Room for the equations and their factors; m = 3 M rows a node, u = 4 P unknowns of the body."""

    rows: Floats  # (3, m, 2 m + u + 1): B_k | s_k | A_kk | A_{k,k−1} of three nodes; node k is at k mod 3
    upper: Floats  # (n, m, m): A_{k−1,k}
    inverse: Floats  # (n, m, m): A_kk⁻¹
    folded: Floats  # (n, m, 2 m + u + 1): Z, in the columns of the row above: body, s, node k − 1, node k − 2
    schur: Floats  # (u, u): factors of the body's equations with all nodes eliminated
    exchanged: Floats  # (u, u): row exchanges of these factors
    second: Floats  # (m, u): Z of the second node, with the first one eliminated
    by_first: Floats  # (m, m): Z of the second node in the first one
    image: Floats  # (m,): a product with a vector
    around: Floats  # (2 m + u + 1,): of the columns of Z; that of s is zero


class Coupling(NamedTuple):
    """What couples the chains in time: the blocks −ω_m D_mj R_m of each node."""

    resistance: Floats  # R, (n, M, 3, 3)
    speed: Floats  # ω_m, (M,)
    differentiation: Floats  # D, (M, M)


@compiled
def new_coupled(like: Floats, n: int, chains: int, instants: int) -> Coupled:
    """Allocate scratch arrays for n ≥ 2 nodes in M chains and four unknowns of the body at each of P instants.

    `like` is an array of the kind of number that the equations have.
    """
    m, unknowns = 3 * chains, 4 * instants
    width = 2 * m + unknowns + 1
    return Coupled(
        empty(like, (3, m, width)),
        empty(like, (n, m, m)),
        empty(like, (n, m, m)),
        empty(like, (n, m, width)),
        zeros(like, (unknowns, unknowns)),
        zeros(like, (unknowns, unknowns)),
        empty(like, (m, unknowns)),
        empty(like, (m, m)),
        empty(like, (m,)),
        zeros(like, (width,)),
    )


@borrowing
def _fill(system: Coupled, chains: Chains, coupling: Coupling, s: Floats, k: int) -> None:
    """Fill the row of node k."""
    resistance, speed, differentiation = coupling
    instants, count = chains.corner.shape[0], resistance.shape[1]
    m, body = 3 * count, 4 * instants + 1  # columns of a node; of the body and the right-hand side
    row, upper = system.rows[k % 3], system.upper[k]
    row[:, : body - 1] = 0.0
    row[:, body + m :] = 0.0
    upper[:] = 0.0
    for i in range(count):
        first = 4 * (i % instants)
        for a in range(3):
            here = 3 * i + a
            row[here, body - 1] = s[k, here]
            for b in range(3):
                drag = speed[i] * resistance[k, i, a, b]
                for j in range(count):
                    row[here, body + 3 * j + b] = -drag * differentiation[i, j]
                row[here, body + 3 * i + b] += chains.diagonal[k, i, a, b]
                if k > 0:
                    row[here, body + m + 3 * i + b] = chains.lower[k, i, a, b]
                    upper[here, 3 * i + b] = chains.upper[k, i, a, b]
            for c in range(4):
                row[here, first + c] = chains.border[k, i, c, a]


@borrowing
def factor_and_solve(system: Coupled, chains: Chains, coupling: Coupling, s: Floats, t: Floats) -> None:
    """Factor the equations and solve them: s (n, m) becomes δx, t (u,) becomes δu."""
    n, m, width = system.folded.shape
    body = width - 2 * m
    _fill(system, chains, coupling, s, n - 1)
    _fill(system, chains, coupling, s, n - 2)
    for i in range(n - 1, -1, -1):
        if i > 1:
            _fill(system, chains, coupling, s, i - 2)
        row, folded, inverse = system.rows[i % 3], system.folded[i], system.inverse[i]
        for a in range(m):
            for j in range(m):
                inverse[a, j] = row[a, body + j]
        invert(inverse)
        if i > 0:
            for a in range(m):
                for j in range(body - 1, -1, -1):
                    row[a, m + j] = row[a, j]  # beside A_{k,k−1}
            multiply(inverse, row, m, folded, 0, body + m)
        else:
            multiply(inverse, row, 0, folded, 0, body)
        if i > 1:
            _multiply_blocks(inverse, chains.lower2[i], folded, body + m)
            _fold_two_up(system, chains, i)
        if i > 0:
            subtract_product(system.upper[i], folded, 0, system.rows[(i - 1) % 3], 0, width if i > 1 else body + m)
        for a in range(m):
            s[i, a] = folded[a, body - 1]
    _reduce_body(system, chains)
    _substitute(system, chains, s, t)


@borrowing
def _multiply_blocks(a: Floats, blocks: Floats, out: Floats, first: int) -> None:
    """Set columns of `out` (m, ·) from `first` on to a (m, m) times a matrix of 3×3 blocks (M, 3, 3)."""
    for row in range(0, len(a), 3):
        for chain in range(len(blocks)):
            at = 3 * chain
            multiply_block(block_at(a, row, at), blocks[chain], 0, 0, out, row, first + at, 3)


@borrowing
def _fold_two_up(system: Coupled, chains: Chains, i: int) -> None:
    """Subtract A_{i−2,i} Z_i from row i − 2; the columns of node i − 1 go to A_{i−2,i−1}."""
    row, upper, folded = system.rows[(i - 2) % 3], system.upper[i - 1], system.folded[i]
    m, width = folded.shape
    body = width - 2 * m
    for chain in range(m // 3):
        at, factor = 3 * chain, negative(block(chains.upper2, i, chain))
        add_block_product(factor, folded, at, 0, row, at, 0, body)
        add_block_product(factor, folded, at, body, upper, at, 0, m)
        add_block_product(factor, folded, at, body + m, row, at, body, m)


@borrowing
def _reduce_body(system: Coupled, chains: Chains) -> None:
    """Form the body's equations with all nodes eliminated, and factor them."""
    instants, count = chains.corner.shape[0], chains.diagonal.shape[1]
    m, unknowns = 3 * count, 4 * instants
    first, second, by_first = system.folded[0], system.second, system.by_first
    for a in range(m):
        for j in range(m):
            by_first[a, j] = system.folded[1, a, unknowns + 1 + j]
        for j in range(unknowns):
            second[a, j] = system.folded[1, a, j]
    subtract_product(by_first, first, 0, second, 0, unknowns)
    schur = system.schur
    schur[:] = 0.0
    for p in range(instants):
        for a in range(4):
            for c in range(4):
                schur[4 * p + a, 4 * p + c] = chains.corner[p, a, c]
    for i in range(count):
        for c in range(4):
            row = schur[4 * (i % instants) + c]
            for a in range(3):
                near, far = chains.foot[0, i, c, a], chains.foot[1, i, c, a]
                for j in range(unknowns):
                    row[j] -= fma(near, first[3 * i + a, j], far * second[3 * i + a, j])
    factor_dense(schur, system.exchanged)


@borrowing
def solve(system: Coupled, chains: Chains, s: Floats, t: Floats) -> None:
    """Solve with the factors, in place: s (n, m) becomes δx, t (u,) becomes δu."""
    (n, m), image = s.shape, system.image
    for i in range(n - 1, -1, -1):
        apply(system.inverse[i], 0, s[i], m, image)
        copy(s[i], image)
        if i > 0:
            apply(system.upper[i], 0, s[i], m, image)
            for a in range(m):
                s[i - 1, a] -= image[a]
        if i > 1:
            for chain in range(m // 3):
                for a in range(3):
                    for b in range(3):
                        s[i - 2, 3 * chain + a] -= chains.upper2[i, chain, a, b] * s[i, 3 * chain + b]
    _substitute(system, chains, s, t)


@borrowing
def _substitute(system: Coupled, chains: Chains, s: Floats, t: Floats) -> None:
    """Solve for the body, then for the nodes from root to tip; on entry s has the values after the elimination."""
    n, m, width = system.folded.shape
    instants, count, body = chains.corner.shape[0], m // 3, width - 2 * m
    image, around = system.image, system.around
    apply(system.folded[1], body, s[0], m, image)  # of the first node on the second
    for i in range(count):
        for c in range(4):
            for a in range(3):
                row = 3 * i + a
                through = chains.foot[0, i, c, a] * s[0, row] + chains.foot[1, i, c, a] * (s[1, row] - image[row])
                t[4 * (i % instants) + c] -= through
    solve_factored(system.schur, system.exchanged, t.reshape((t.size, 1)))
    for c in range(body - 1):
        around[c] = t[c]
    for i in range(n):
        for a in range(m):
            if i > 0:
                around[body + a] = s[i - 1, a]
            if i > 1:
                around[body + m + a] = s[i - 2, a]
        apply(system.folded[i], 0, around, body + min(i, 2) * m, image)
        for a in range(m):
            s[i, a] -= image[a]
