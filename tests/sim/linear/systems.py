"""The dense matrices that equations of chains stand for."""

from __future__ import annotations

import numpy as np

from sim.linear.chains import Chains


def dense_matrix(chains: Chains) -> np.ndarray:
    """Assemble the matrix in the unknowns (n, M, 3) and (P, 4), flattened; column m belongs to instant m mod P."""
    n, count = chains.diagonal.shape[:2]
    instants = len(chains.corner)
    nodes = 3 * n * count
    matrix = np.zeros((nodes + 4 * instants, nodes + 4 * instants))

    def place(k: int, m: int) -> slice:
        return slice(3 * (k * count + m), 3 * (k * count + m) + 3)

    for m in range(count):
        body = slice(nodes + 4 * (m % instants), nodes + 4 * (m % instants) + 4)
        for k in range(n):
            matrix[place(k, m), place(k, m)] = chains.diagonal[k, m]
            matrix[place(k, m), body] = chains.border[k, m].T
            if k > 0:
                matrix[place(k, m), place(k - 1, m)] = chains.lower[k, m]
                matrix[place(k - 1, m), place(k, m)] = chains.upper[k, m]
            if k > 1:
                matrix[place(k, m), place(k - 2, m)] = chains.lower2[k, m]
                matrix[place(k - 2, m), place(k, m)] = chains.upper2[k, m]
        for k in (0, 1):
            matrix[body, place(k, m)] = chains.foot[k, m]
    for p in range(instants):
        body = slice(nodes + 4 * p, nodes + 4 * p + 4)
        matrix[body, body] += chains.corner[p]
    return matrix


def joined_matrix(
    chains: Chains, resistance: np.ndarray, speed: np.ndarray, differentiation: np.ndarray
) -> np.ndarray:
    """Assemble the same with the chains joined in time by −ω_m D_mj R_m."""
    matrix = dense_matrix(chains)
    n, count = chains.diagonal.shape[:2]
    for k in range(n):
        for m in range(count):
            for j in range(count):
                rows, columns = 3 * (k * count + m), 3 * (k * count + j)
                matrix[rows : rows + 3, columns : columns + 3] -= (
                    speed[m] * differentiation[m, j] * resistance[k, m]
                )
    return matrix
