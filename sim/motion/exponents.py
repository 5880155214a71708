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
from sim.motion.stability import exponents, in_motor_revolutions
from sim.solve.orbit import mean_motion

FOLD, DOUBLING, HOPF = "fold", "period doubling", "Hopf"
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
    means, found = mean_motion(body, u), exponents(body, tails, x, u)
    if not len(found):
        return Leading(np.nan, np.nan, tails)
    omega_t = means[0]
    copies = found[found.real > found.real.max() - _SAME * abs(omega_t)]
    largest = copies[np.argmin(np.abs(copies.imag))]
    turns = abs(largest.imag / omega_t) % tails
    growth = float(in_motor_revolutions(found.real.max(), means))
    return Leading(growth, float(min(turns, tails - turns)), tails)
