"""Which small perturbation of an orbit decays least, and what it does to the tails.

The exponents σ are those of `sim.solve.floquet`, defined up to i N ω_t and in conjugate pairs. With k = Im σ/ω_t
between 0 and N/2, the perturbation of the next tail has the phase 2πk/N. Where the growth changes its sign,

    fold               k = 0: real; another such motion meets this one
    period doubling    k = N/2: after an N-th of a turn the perturbation has changed its sign
    Hopf               all others: a second frequency appears (Neimark-Sacker)

A motion in which the tails differ is treated as one tail, with N = 1 (`sim.motion.revolution`).
Source: Kuznetsov, *Elements of Applied Bifurcation Theory* (2004), ch. 4 and 5.
Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.model.body import Body
from sim.motion.stability import first_perturbation
from sim.solve.floquet import arnoldi
from sim.solve.orbit import mean_motion

FOLD, DOUBLING, HOPF = "fold", "period doubling", "Hopf"
_VECTORS = 30  # of Arnoldi's method beside two for each tail
_CONVERGED = 1e-3  # relative residual of an eigenvalue up to which it counts; at 0.1 some look unstable
_SAME = 1e-3  # relative distance of Re σ up to which exponents are copies of one, i N ω_t apart
_REAL = 1e-3  # distance of k from 0 or N/2 up to which it counts as that


class Leading(NamedTuple):
    """The perturbation that decays least."""

    growth: float  # natural logarithm of its growth in a motor revolution; NaN: unknown
    turns: float  # k, between 0 and N/2
    tails: int  # N

    @property
    def kind(self) -> str:
        """Name what happens where its growth changes the sign."""
        if self.turns < _REAL:
            return FOLD
        return DOUBLING if self.tails / 2 - self.turns < _REAL else HOPF


def leading_exponent(body: Body, tails: int, x: Floats, u: Floats) -> Leading:
    """Find it for an orbit x (n, M, 3), u (P, 4) of N tails; the growth is NaN if none has converged."""
    omega_t, omega_h = mean_motion(body, u)[:2]
    count = min(2 * tails + _VECTORS, x.size - 1)
    shift = abs(omega_t)
    projected = arnoldi(body, x, u, shift, first_perturbation(tails, *x.shape[:2]), count)
    if not np.isfinite(projected[-1, -1]):
        return Leading(np.nan, np.nan, tails)
    values, ritz = np.linalg.eig(projected[:count])
    values = values[projected[count, count - 1] * np.abs(ritz[-1]) < _CONVERGED * np.abs(values)]
    if not len(values):
        return Leading(np.nan, np.nan, tails)
    exponents = shift + 1 / values
    copies = exponents[exponents.real > exponents.real.max() - _SAME * shift]
    largest = copies[np.argmin(np.abs(copies.imag))]
    turns = abs(largest.imag / omega_t) % tails
    growth = float(2 * np.pi * exponents.real.max() / abs(omega_t - omega_h))
    return Leading(growth, float(min(turns, tails - turns)), tails)
