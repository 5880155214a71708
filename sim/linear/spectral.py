"""Periodic functions on M equal phases: derivative, values in between, and other numbers of phases.

The trigonometric interpolant converges faster than any power of 1/M for smooth functions.
Source: Trefethen, *Spectral Methods in MATLAB* (2000), ch. 3.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from common.arrays import Floats
from sim.jit import compiled


@compiled
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


def interpolation(phases: int, at: Floats) -> Floats:
    """Interpolate to angles `at` (F,) from the first phase: the matrix (F, M)."""
    away = at[:, None] - 2 * np.pi * np.arange(phases) / phases
    matrix = np.ones_like(away)
    for k in range(1, (phases + 1) // 2):
        matrix += 2 * np.cos(k * away)
    if phases % 2 == 0:
        matrix += np.cos(phases // 2 * away)
    return matrix / phases


@cache
def _between_phases(given: int, wanted: int) -> Floats:
    """Interpolate from one number of equal phases to another: the matrix (M', M)."""
    return interpolation(given, 2 * np.pi * np.arange(wanted) / wanted)


def with_phases(a: Floats, wanted: int) -> Floats:
    """Resample periodic arrays (…, M, c) at `wanted` phases."""
    return np.asarray(_between_phases(a.shape[-2], wanted) @ a)
