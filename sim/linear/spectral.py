"""Periodic functions on M equal phases: derivative, values in between, and other numbers of phases.

The trigonometric interpolant converges faster than any power of 1/M for smooth functions.
Source: Trefethen, *Spectral Methods in MATLAB* (2000), ch. 3.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled_exactly
from sim.lanes import zeros


@compiled_exactly
def differentiation(phases: int) -> Floats:
    """Differentiate the interpolant: the matrix d/dφ, (M, M)."""
    matrix = np.zeros((phases, phases))
    for i in range(phases):
        for j in range(phases):
            if i != j:
                half = (i - j) * np.pi / phases
                denominator = np.tan(half) if phases % 2 == 0 else np.sin(half)
                matrix[i, j] = 0.5 * (-1.0) ** (i - j) / denominator
    return matrix


@compiled_exactly
def interpolation(phases: int, at: Floats) -> Floats:
    """Interpolate to angles `at` (F,) from the first phase: the matrix (F, M)."""
    matrix = np.zeros((len(at), phases))
    for i in range(len(at)):
        for j in range(phases):
            away = at[i] - 2 * np.pi * j / phases
            total = 1.0
            for k in range(1, (phases + 1) // 2):
                total += 2 * np.cos(k * away)
            if phases % 2 == 0:
                total += np.cos(phases // 2 * away)
            matrix[i, j] = total / phases
    return matrix


@compiled_exactly
def with_phases(a: Floats, wanted: int) -> Floats:
    """Resample a periodic array (K, M, c) at `wanted` phases."""
    matrix = interpolation(a.shape[1], 2 * np.pi * np.arange(wanted) / wanted)
    out = zeros(a, (a.shape[0], wanted, a.shape[2]))
    for k in range(a.shape[0]):
        for i in range(wanted):
            for j in range(a.shape[1]):
                for c in range(a.shape[2]):
                    out[k, i, c] += matrix[i, j] * a[k, j, c]
    return out
