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
to the length of three traces. A longer memory is a level and a slope, which are absorbed or shared by all.
Source of the banded form: Rue and Held (2005), section 2.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dtbtrs
from scipy.optimize import minimize

from common.arrays import Floats, Integers

_LEAST = 1e-9  # variance that is new in a reading of the slow part; of two readings at one time it is none
_SHARES, _TIMES = (-6.0, -1.0, 0.0, 1.0, 3.0, 5.0), 5  # ln (s/(1 − s)) and values of τ at which the search begins
_LARGEST, _LONGEST = 9.0, 50.0  # of ln (s/(1 − s)), and of ln τ
_STEP = 0.7  # of the lattice in both
_FARTHEST, _MOST_POINTS = 5.0, 30  # −ln of the likelihood above its least one, and points, of the lattice
_TRACES = 3.0  # lengths of a trace, the longest τ of the prior
_CERTAIN = 3000  # degrees of freedom from which s and τ count as known


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
        return _solved(self._cholesky, steps).reshape(table.shape)

    def colour(self, table: Floats) -> Floats:
        """Compute L of a table (n, …) along its first axis."""
        diagonal, below = self._bidiagonal
        flat = table.reshape(len(table), -1)
        mixed = self._cholesky[0][:, None] * flat
        mixed[1:] += self._cholesky[1, :-1, None] * flat[:-1]
        band = np.stack([diagonal, np.append(-below[1:], 0.0)])
        return _solved(band, mixed).reshape(table.shape)

    @cached_property
    def level(self) -> Floats:
        """L⁻¹ 1, (n,)."""
        return self.whiten(np.ones(len(self.time)))

    @property
    def log_determinant(self) -> float:
        """Compute ln |R|."""
        return float(2 * (np.log(self._cholesky[0]).sum() - np.log(self._bidiagonal[0]).sum()))


def _solved(band: Floats, right: Floats) -> Floats:
    """Solve a lower bidiagonal system; LAPACK must not be given a right side without columns."""
    return np.asarray(dtbtrs(band, right, uplo="L")[0]) if right.size else right


class Repeats(NamedTuple):
    """Series of noise: contrasts of traces over the same times, and what of them is none."""

    rows: Integers  # (J, t) of the readings
    contrasts: Floats  # (q, J) orthonormal
    time: Floats  # (t,)
    absorbed: Floats  # (t, m): columns that each series may contain to any amount

    def series(self, table: Floats) -> Floats:
        """Compute the series (t, q, …) of a table (n, …)."""
        return np.moveaxis(np.tensordot(self.contrasts, table[self.rows], 1), 0, 1)


@dataclass(frozen=True)
class NoiseOfTraces:
    """The noise of readings of traces, as it is estimated from repeats."""

    run_covariance: Floats  # (k, k) S of a reading
    freedom: float  # degrees of freedom of S
    share: float  # s
    tau: float  # τ
    repeats: tuple[Repeats, ...]
    as_likely: tuple[tuple[float, float], ...]  # s and τ that the repeats allow as well

    def estimated(self, table: Floats) -> tuple[Integers, Floats]:
        """Estimate the noise of tables (n, B, k) once more, among what is as likely.

        Returns:
            The place (B,) in `as_likely`, and S (B, k, k).
        """
        series = [one.series(table) for one in self.repeats]
        costs, covariances = zip(*(each.costs(series) for each in self._judges), strict=True)
        best = np.argmin(costs, 0)
        return best, np.stack(covariances)[best, np.arange(len(best))]

    @cached_property
    def _judges(self) -> list[_Likelihood]:
        return [_Likelihood(self.repeats, *at) for at in self.as_likely]


def estimate_memory(repeats: Sequence[Repeats], residual: Floats) -> NoiseOfTraces:
    """Estimate S, s and τ from the residual (n, k) of repeats, by restricted likelihood with the prior of τ.

    Args:
        repeats: one at least has more times than columns that are absorbed.
    """
    series = [one.series(residual[:, None]) for one in repeats]
    prior = _Prior.of(repeats)

    def cost(at: Floats) -> float:
        share, tau = _natural(at)
        return float(_Likelihood(repeats, share, tau).costs(series)[0][0]) + prior.cost(tau)

    starts = [(s, x) for s in _SHARES for x in np.linspace(*prior.ends, _TIMES)]
    first = np.array(min(starts, key=lambda at: cost(np.array(at))))
    simplex = first + np.array([(0.0, 0.0), (_STEP, 0.0), (0.0, prior.spread / 2)])
    settings: dict[str, Any] = {"initial_simplex": simplex, "xatol": 1e-2, "fatol": 1e-3, "maxiter": 200}
    best = minimize(cost, first, method="Nelder-Mead", options=settings)  # type: ignore[call-overload]
    share, tau = _natural(best.x)
    run_covariance = _Likelihood(repeats, share, tau).costs(series)[1][0]
    freedom = sum(one.contrasts.shape[0] * (len(one.time) - one.absorbed.shape[1]) for one in repeats)
    near = _as_likely(cost, best.x, float(best.fun)) if freedom < _CERTAIN else [best.x]
    as_likely = tuple(_natural(at) for at in near)
    return NoiseOfTraces(run_covariance, float(freedom), share, tau, tuple(repeats), as_likely)


class _Prior(NamedTuple):
    """A normal prior of ln τ."""

    middle: float
    spread: float

    @classmethod
    def of(cls, repeats: Sequence[Repeats]) -> _Prior:
        """Place it between half a step and the length of three traces."""
        steps = np.concatenate([np.diff(one.time) for one in repeats])
        least = float(np.median(steps[steps > 0])) / 2
        most = max(_TRACES * float(np.median([np.ptp(one.time) for one in repeats])), 4 * least)
        return cls(math.log(least * most) / 2, math.log(most / least) / 4)

    @property
    def ends(self) -> tuple[float, float]:
        return self.middle - 2 * self.spread, self.middle + 2 * self.spread

    def cost(self, tau: float) -> float:
        return ((math.log(tau) - self.middle) / self.spread) ** 2 / 2


def _natural(at: Floats) -> tuple[float, float]:
    """Return s and τ of ln (s/(1 − s)) and ln τ."""
    logit = min(max(float(at[0]), -_LARGEST), _LARGEST)
    return 1 / (1 + math.exp(-logit)), math.exp(min(max(float(at[1]), -_LONGEST), _LONGEST))


def _as_likely(cost: Callable[[Floats], float], best: Floats, least: float) -> list[Floats]:
    """List points of a lattice around the best one that are not far less likely, from it outwards."""
    found, seen, edge = [best], {(0, 0)}, [(0, 0)]
    while edge and len(found) < _MOST_POINTS:
        i, j = edge.pop(0)
        for near in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            at = best + _STEP * np.array(near)
            if near not in seen and abs(at[0]) < _LARGEST and cost(at) < least + _FARTHEST:
                found.append(at)
                edge.append(near)
            seen.add(near)
    return found


class _Likelihood:
    """The restricted likelihood of one s and τ, for any values of some series."""

    def __init__(self, repeats: Sequence[Repeats], share: float, tau: float):
        self.parts: list[tuple[Memory, Floats]] = []  # of each set of repeats, and a basis of what is absorbed
        self.freedom, self.determinant = 0, 0.0
        for one in repeats:
            memory = Memory(np.zeros(len(one.time), dtype=np.int64), one.time, share, tau)
            basis, triangle = np.linalg.qr(memory.whiten(one.absorbed))
            size = np.log(np.maximum(np.abs(np.diagonal(triangle)), 1e-300)).sum()
            count, (times, absorbed) = len(one.contrasts), one.absorbed.shape
            self.parts.append((memory, basis))
            self.freedom += count * (times - absorbed)
            self.determinant += count * (memory.log_determinant / 2 + float(size))

    def costs(self, series: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Compute −ln of it at the best S, (B,), and that S, (B, k, k), of series (t, q, B, k)."""
        products: Any = 0.0
        for (memory, basis), values in zip(self.parts, series, strict=True):
            white = memory.whiten(values)
            left = basis.T @ white.reshape(len(white), -1)
            absorbed = np.moveaxis(left.reshape(-1, *values.shape[1:]), (0, 1), (-2, -1))  # (B, k, m, q)
            products = products + _squares(np.moveaxis(white, (0, 1), (-2, -1))) - _squares(absorbed)
        run_covariance = np.asarray(products) / self.freedom
        k = run_covariance.shape[-1]
        return self.freedom / 2 * np.linalg.slogdet(run_covariance)[1] + k * self.determinant, run_covariance


def _squares(table: Floats) -> Floats:
    """Multiply outputs with each other, (B, k, k), of a table (B, k, t, q)."""
    flat = table.reshape(*table.shape[:2], -1)
    return np.asarray(flat @ np.swapaxes(flat, -1, -2))
