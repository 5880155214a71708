"""Noise with a memory along traces: white and Ornstein-Uhlenbeck, whitened in linear time.

Readings of one trace at the times t have the correlation

    R_ij = (1 − s) δ_ij + s exp(−|t_i − t_j|/τ),

and those of different traces none. The Ornstein-Uhlenbeck part is Markov, so it is B⁻¹ B⁻ᵀ with a bidiagonal B,
and

    R = L Lᵀ,   L = B⁻¹ C,   C Cᵀ = s I + (1 − s) B Bᵀ,

with a bidiagonal Cholesky factor C of a tridiagonal matrix. L is the Cholesky factor of R, so L⁻¹ y are the
innovations of a Kalman filter, each over its standard deviation.

s and τ have the largest restricted likelihood of some series, with what is linear in them projected out
(Patterson and Thompson 1971), and a prior of τ: normal in its logarithm, two standard deviations from half a step
to a third of a trace. Source of the banded form: Rue and Held (2005), section 2.4.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dtbtrs
from scipy.optimize import minimize

from common.arrays import Floats, Integers

_LEAST = 1e-9  # variance that is new in a reading of the slow part; of two readings at one time it is none
_SHARES = (0.0, 0.2, 0.5, 0.8, 0.95, 0.99)  # s at which the search begins
_TIMES = 5  # τ, the same
_NEARLY_ONE = 1e-4  # least share of the white part


@dataclass(frozen=True)
class Memory:
    """R of readings that are sorted by trace, then by time."""

    trace: Integers  # (n,)
    time: Floats  # (n,)
    share: float  # s
    tau: float  # τ, in the unit of the time

    @cached_property
    def _bidiagonal(self) -> tuple[Floats, Floats]:
        """B: its diagonal, and what is below it with the sign changed, each (n,)."""
        same = np.append(False, np.diff(self.trace) == 0)
        kept = np.where(same, np.exp(-np.diff(self.time, prepend=self.time[:1]) / self.tau), 0.0)
        diagonal = 1 / np.sqrt(np.maximum(1 - kept**2, _LEAST))
        return diagonal, kept * diagonal

    @cached_property
    def _cholesky(self) -> Floats:
        """C as LAPACK has a lower band, (2, n)."""
        diagonal, below = self._bidiagonal
        square = diagonal**2 + below**2
        across = np.append(-below[1:] * diagonal[:-1], 0.0)
        band = np.stack([self.share + (1 - self.share) * square, (1 - self.share) * across])
        return np.asarray(cholesky_banded(band, lower=True))

    def whiten(self, table: Floats) -> Floats:
        """Compute L⁻¹ of a table (n, …) along its first axis."""
        diagonal, below = self._bidiagonal
        flat = table.reshape(len(table), -1)
        steps = diagonal[:, None] * flat
        steps[1:] -= below[1:, None] * flat[:-1]
        return np.asarray(dtbtrs(self._cholesky, steps, uplo="L")[0].reshape(table.shape))

    def colour(self, table: Floats) -> Floats:
        """Compute L of a table (n, …) along its first axis."""
        diagonal, below = self._bidiagonal
        flat = table.reshape(len(table), -1)
        mixed = self._cholesky[0][:, None] * flat
        mixed[1:] += self._cholesky[1, :-1, None] * flat[:-1]
        band = np.stack([diagonal, np.append(-below[1:], 0.0)])
        return np.asarray(dtbtrs(band, mixed, uplo="L")[0].reshape(table.shape))

    @cached_property
    def level(self) -> Floats:
        """L⁻¹ 1, (n,)."""
        return self.whiten(np.ones(len(self.time)))

    @property
    def log_determinant(self) -> float:
        """Compute ln |R|."""
        return float(2 * (np.log(self._cholesky[0]).sum() - np.log(self._bidiagonal[0]).sum()))


class Series(NamedTuple):
    """Several series of noise over the same times, and what of them is none."""

    time: Floats  # (t,)
    values: Floats  # (t, q, k): q series of k outputs
    absorbed: Floats  # (t, m): columns that each series may contain to any amount


@dataclass(frozen=True)
class NoiseOfTraces:
    """The noise of readings of traces, as it is estimated from series."""

    run_covariance: Floats  # (k, k) S of a reading
    freedom: float  # degrees of freedom of S
    share: float  # s
    tau: float  # τ


def estimate_memory(series: Sequence[Series]) -> NoiseOfTraces:
    """Estimate S, s and τ from series, by restricted likelihood.

    Args:
        series: one at least has more times than columns that are absorbed.
    """
    usable = [one for one in series if len(one.time) > one.absorbed.shape[1]]
    steps = np.concatenate([np.diff(one.time) for one in usable])
    least = float(np.median(steps[steps > 0])) / 2
    most = max(float(np.median([np.ptp(one.time) for one in usable])) / 3, 4 * least)
    middle, spread = math.log(least * most) / 2, math.log(most / least) / 4

    def cost(at: Floats) -> float:
        share = (1 - _NEARLY_ONE) * min(max(float(at[0]), 0.0), 1.0)
        outside = max(float(at[0]) - 1, -float(at[0]), 0.0)
        tau = math.exp(min(max(float(at[1]), middle - 4 * spread), middle + 4 * spread))
        prior = ((float(at[1]) - middle) / spread) ** 2 / 2
        return _likelihood(usable, share, tau)[0] + prior + 1e3 * outside

    starts = [(s, x) for s in _SHARES for x in np.linspace(middle - 2 * spread, middle + 2 * spread, _TIMES)]
    first = min(starts, key=lambda at: cost(np.array(at)))
    aside = (0.1 if first[0] < 0.5 else -0.1, spread / 2)
    simplex = np.array(first) + np.array([(0.0, 0.0), (aside[0], 0.0), (0.0, aside[1])])
    settings = {"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-3, "maxiter": 120}
    found = minimize(cost, simplex[0], method="Nelder-Mead", options=settings).x
    share = (1 - _NEARLY_ONE) * min(max(float(found[0]), 0.0), 1.0)
    tau = math.exp(float(found[1]))
    _, run_covariance, freedom = _likelihood(usable, share, tau)
    return NoiseOfTraces(run_covariance, freedom, share, tau)


def _likelihood(series: Sequence[Series], share: float, tau: float) -> tuple[float, Floats, float]:
    """Compute −ln of the restricted likelihood at its best S, that S, and its degrees of freedom."""
    products, freedom, determinant = 0.0, 0, 0.0
    for time, values, absorbed in series:
        memory = Memory(np.zeros(len(time), dtype=np.int64), time, share, tau)
        basis, triangle = np.linalg.qr(memory.whiten(absorbed))
        white = memory.whiten(values)
        white = white - np.tensordot(basis, np.tensordot(basis.T, white, 1), 1)
        count = values.shape[1]
        products = products + np.einsum("tqa,tqb->ab", white, white)
        freedom += count * (len(time) - absorbed.shape[1])
        size = np.log(np.maximum(np.abs(np.diagonal(triangle)), 1e-300)).sum()
        determinant += count * (memory.log_determinant / 2 + float(size))
    run_covariance = np.asarray(products) / freedom
    k = len(run_covariance)
    return freedom / 2 * float(np.linalg.slogdet(run_covariance)[1]) + k * determinant, run_covariance, freedom
