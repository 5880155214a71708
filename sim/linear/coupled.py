"""Chains that are coupled in time: block-pentadiagonal systems with dense blocks and a border, for one robot.

On a periodic orbit the velocity of a node at one phase depends on its position at all phases,
ẋ_m = ω_m Σ_j D_mj x_j. So the blocks of one node in all M chains (`sim.linear.chains`) form one dense block of 3 M
rows. The coupling of chains m and j is −ω_m D_mj R_m, with R_m the node's resistance:

    A_kk δx_k + A_{k,k±1} δx_{k±1} + A_{k,k±2} δx_{k±2} + B_k δu = s_k,   k = 1..n
    C_1 δx_1 + C_2 δx_2 + D δu = t

Blocks at distance two do not couple the chains, so they stay M matrices of 3×3. The other blocks become dense.
Nodes are eliminated from the tip to the root, so that the Schur complement of the body needs the first two nodes
only:

    Z_k = A_kk⁻¹ [A_{k,k−1} | A_{k,k−2} | B_k | s_k],   rows k−1 and k−2 −= A_{k−1,k} Z_k and A_{k−2,k} Z_k.

The first right-hand side is eliminated together with the matrix. `solve` uses the stored factors for further ones.

There is no pivoting between nodes: A is minus (drag plus stiffness), whose symmetric part is definite. Cost: about
8 m³ multiplications for each node, m = 3 M, nearly all of them in matrix products (BLAS).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled
from sim.linear.chains import Chains
from sim.linear.dense import invert, solve_dense


class Coupled(NamedTuple):
    """Room for the equations and their factors; m = 3 M rows a node, u = 4 P unknowns of the body."""

    diagonal: Floats  # (n, m, m): A_kk, then its inverse
    columns: Floats  # (n, m, 2 m + u + 1): A_{k,k−1} | A_{k,k−2} | B_k | s_k
    upper: Floats  # (n, m, m): A_{k−1,k}
    folded: Floats  # (n, m, 2 m + u + 1): Z
    product: Floats  # (m, 2 m + u + 1)
    schur: Floats  # (u, u)


@compiled
def new_coupled(n: int, chains: int, instants: int) -> Coupled:
    """Allocate room for n ≥ 2 nodes in M chains, and a body with four unknowns at each of P instants."""
    m, unknowns = 3 * chains, 4 * instants
    width = 2 * m + unknowns + 1
    return Coupled(
        np.zeros((n, m, m)),
        np.zeros((n, m, width)),
        np.zeros((n, m, m)),
        np.zeros((n, m, width)),
        np.zeros((m, width)),
        np.zeros((unknowns, unknowns)),
    )


@compiled
def couple(system: Coupled, chains: Chains, resistance: Floats, speed: Floats, differentiation: Floats) -> None:
    """Fill `system` with the equations of the chains, coupled in time.

    Args:
        resistance: R of every node, (n, M, 3, 3).
        speed: ω_m, (M,).
        differentiation: D, (M, M).
    """
    n, count, _, _ = resistance.shape
    instants = chains.corner.shape[0]
    m = 3 * count
    system.columns[:] = 0.0
    system.upper[:] = 0.0
    for k in range(n):
        diagonal, columns, upper = system.diagonal[k], system.columns[k], system.upper[k]
        for i in range(count):
            column = 2 * m + 4 * (i % instants)
            for a in range(3):
                row = 3 * i + a
                for b in range(3):
                    drag = speed[i] * resistance[k, i, a, b]
                    for j in range(count):
                        diagonal[row, 3 * j + b] = -drag * differentiation[i, j]
                    diagonal[row, 3 * i + b] += chains.diagonal[k, i, a, b]
                    if k > 0:
                        columns[row, 3 * i + b] = chains.lower[k, i, a, b]
                        upper[row, 3 * i + b] = chains.upper[k, i, a, b]
                    if k > 1:
                        columns[row, m + 3 * i + b] = chains.lower2[k, i, a, b]
                for c in range(4):
                    columns[row, column + c] = chains.border[k, i, c, a]


@compiled
def factor_and_solve(system: Coupled, chains: Chains, s: Floats, t: Floats) -> None:
    """Factor the equations and solve them: s (n, m) becomes δx, t (u,) becomes δu."""
    n, m, width = system.columns.shape
    for i in range(n):
        for a in range(m):
            system.columns[i, a, width - 1] = s[i, a]
    for i in range(n - 1, -1, -1):
        invert(system.diagonal[i])
        np.dot(system.diagonal[i], system.columns[i], system.folded[i])
        if i > 0:
            np.dot(system.upper[i], system.folded[i], system.product)
            _fold_up(system, i)
        if i > 1:
            _fold_two_up(system, chains, i)
        for a in range(m):
            s[i, a] = system.folded[i, a, width - 1]
    _reduce_body(system, chains)
    _substitute(system, chains, s, t)


@compiled
def _fold_up(system: Coupled, i: int) -> None:
    """Subtract A_{i−1,i} Z_i from row i − 1: columns of nodes i − 1 and i − 2, body and right-hand side."""
    diagonal, columns, product = system.diagonal[i - 1], system.columns[i - 1], system.product
    m, width = product.shape
    for a in range(m):
        for j in range(m):
            diagonal[a, j] -= product[a, j]
            columns[a, j] -= product[a, m + j]
        for j in range(2 * m, width):
            columns[a, j] -= product[a, j]


@compiled
def _fold_two_up(system: Coupled, chains: Chains, i: int) -> None:
    """Subtract A_{i−2,i} Z_i, whose first columns belong to node i − 1, from row i − 2."""
    diagonal, columns = system.diagonal[i - 2], system.columns[i - 2]
    upper, folded = system.upper[i - 1], system.folded[i]
    m, width = folded.shape
    for chain in range(m // 3):
        for a in range(3):
            row = 3 * chain + a
            for b in range(3):
                share, source = chains.upper2[i, chain, a, b], 3 * chain + b
                for j in range(m):
                    upper[row, j] -= share * folded[source, j]
                    diagonal[row, j] -= share * folded[source, m + j]
                for j in range(2 * m, width):
                    columns[row, j] -= share * folded[source, j]


@compiled
def _reduce_body(system: Coupled, chains: Chains) -> None:
    """Form the body's equations with all nodes eliminated."""
    instants, count = chains.corner.shape[0], chains.diagonal.shape[1]
    m, unknowns = 3 * count, 4 * instants
    first = np.ascontiguousarray(system.folded[0][:, 2 * m : 2 * m + unknowns])
    second = np.dot(np.ascontiguousarray(system.folded[1][:, :m]), first)
    second = system.folded[1][:, 2 * m : 2 * m + unknowns] - second
    schur = system.schur
    schur[:] = 0.0
    for p in range(instants):
        schur[4 * p : 4 * p + 4, 4 * p : 4 * p + 4] = chains.corner[p]
    for i in range(count):
        for c in range(4):
            row = schur[4 * (i % instants) + c]
            for a in range(3):
                near, far = chains.foot[0, i, c, a], chains.foot[1, i, c, a]
                for j in range(unknowns):
                    row[j] -= near * first[3 * i + a, j] + far * second[3 * i + a, j]


@compiled
def solve(system: Coupled, chains: Chains, s: Floats, t: Floats) -> None:
    """Solve with the factors, in place: s (n, m) becomes δx, t (u,) becomes δu."""
    n, m = s.shape
    image = np.empty(m)
    for i in range(n - 1, -1, -1):
        np.dot(system.diagonal[i], s[i], image)
        s[i] = image
        if i > 0:
            np.dot(system.upper[i], s[i], image)
            s[i - 1] -= image
        if i > 1:
            for chain in range(m // 3):
                for a in range(3):
                    for b in range(3):
                        s[i - 2, 3 * chain + a] -= chains.upper2[i, chain, a, b] * s[i, 3 * chain + b]
    _substitute(system, chains, s, t)


@compiled
def _substitute(system: Coupled, chains: Chains, s: Floats, t: Floats) -> None:
    """Solve for the body, then for the nodes from root to tip; on entry s has the values after the elimination."""
    n, m, width = system.folded.shape
    instants, count = chains.corner.shape[0], m // 3
    image, around = np.empty(m), np.zeros(width)
    around[:m] = s[0]
    np.dot(system.folded[1], around, image)  # of the first node on the second
    for i in range(count):
        for c in range(4):
            for a in range(3):
                row = 3 * i + a
                through = chains.foot[0, i, c, a] * s[0, row] + chains.foot[1, i, c, a] * (s[1, row] - image[row])
                t[4 * (i % instants) + c] -= through
    solve_dense(system.schur.copy(), t.reshape(len(t), 1))
    around[:m], around[2 * m : width - 1] = 0.0, t
    for i in range(n):
        if i > 1:
            around[m : 2 * m] = s[i - 2]
        if i > 0:
            around[:m] = s[i - 1]
        np.dot(system.folded[i], around, image)
        s[i] -= image
