"""Compute Sobol indices from the rows of a sweep: which inputs an output depends on.

The output is fitted by polynomials of all inputs together that are orthonormal over the rows (a polynomial chaos
expansion). The variance then is the sum of squared coefficients:

    first order   share of the variance from terms in one input alone
    total         share from all terms that the input is part of

Intervals are percentiles over resampled blocks of rows. Inputs enter through their ranks: a sweep's design is even
in the scale that its configuration declares. Source: Sudret (2008), Reliability Engineering and System Safety 93,
964.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from sim.arrays import Floats

_HIGHEST = 4  # degree of the polynomials
_ROWS_A_TERM = 4
_RESAMPLED = 60
_BLOCKS = 30
_MOST_ROWS = 20_000  # more do not change the indices


@dataclass(frozen=True)
class Indices:
    """Sobol indices of one output; bounds are of 95 %."""

    inputs: tuple[str, ...]
    first: Floats  # (K,)
    first_bounds: Floats  # (K, 2)
    total: Floats  # (K,)
    total_bounds: Floats  # (K, 2)
    explained: float  # share of the variance that the polynomials explain in held-out rows
    degree: int


def sobol_indices(inputs: Mapping[str, Floats], output: Floats, *, seed: int = 0) -> Indices:
    """Compute the indices of the inputs (M,) that vary, for an output (M,).

    Rows with an output that is not finite are left out.
    """
    rng = np.random.default_rng(seed)
    kept = np.flatnonzero(np.isfinite(output))
    if len(kept) > _MOST_ROWS:
        kept = rng.choice(kept, _MOST_ROWS, replace=False)
    names = tuple(name for name, values in inputs.items() if np.ptp(values[kept]) > 0)
    degree = _HIGHEST
    while degree > 1 and _ROWS_A_TERM * math.comb(len(names) + degree, degree) > len(kept):
        degree -= 1
    powers = _powers(len(names), degree)
    basis = _basis(np.stack([inputs[name][kept] for name in names], 1), powers, degree)
    y = output[kept]
    first, total = _shares(_fit(basis, y), powers)
    drawn = [_shares(c, powers) for c in _resampled(basis, y, rng)]
    bounds = np.quantile(np.array(drawn), [0.025, 0.975], axis=0)  # (2, first and total, K)
    held_out = rng.permutation(len(y)) < len(y) // 5
    residual = y[held_out] - basis[held_out] @ _fit(basis[~held_out], y[~held_out])
    explained = 1 - float(np.var(residual) / np.var(y[held_out]))
    return Indices(names, first, bounds[:, 0].T, total, bounds[:, 1].T, explained, degree)


def _powers(inputs: int, degree: int) -> np.ndarray:
    """List the degrees of each term in each input, (P, K); the constant comes first."""
    terms = [np.zeros(inputs, dtype=int)]
    for order in range(1, degree + 1):
        for factors in combinations_with_replacement(range(inputs), order):
            terms.append(np.bincount(factors, minlength=inputs))
    return np.array(terms)


def _basis(values: Floats, powers: np.ndarray, degree: int) -> Floats:
    """Evaluate products of polynomials that are orthonormal over the ranks of each input, (M, P)."""
    single = np.ones((*values.shape, degree + 1))
    for k in range(values.shape[1]):
        _, position, counts = np.unique(values[:, k], return_inverse=True, return_counts=True)
        rank = (np.cumsum(counts) - 0.5 * counts)[position] / len(values)
        most = min(degree, len(counts) - 1)
        orthogonal, size = np.linalg.qr(np.vander(2 * rank - 1, most + 1, increasing=True))
        single[:, k, : most + 1] = orthogonal * np.sign(np.diag(size)) * math.sqrt(len(values))
        single[:, k, most + 1 :] = 0.0  # an input of few values carries no higher degree
    basis = np.ones((len(values), len(powers)))
    for k in range(values.shape[1]):
        basis *= single[:, k, powers[:, k]]
    return basis


def _fit(basis: Floats, y: Floats) -> Floats:
    """Fit by least squares; terms without influence get 0."""
    normal = basis.T @ basis + 1e-9 * len(y) * np.eye(basis.shape[1])
    return np.asarray(np.linalg.solve(normal, basis.T @ y))


def _resampled(basis: Floats, y: Floats, rng: np.random.Generator) -> list[Floats]:
    """Fit to blocks of rows drawn with replacement. The blocks are random; each is summed once."""
    blocks = np.array_split(rng.permutation(len(y)), min(_BLOCKS, len(y) // 2))
    normal = np.array([basis[rows].T @ basis[rows] for rows in blocks])
    right = np.array([basis[rows].T @ y[rows] for rows in blocks])
    ridge = 1e-9 * len(y) * np.eye(basis.shape[1])
    coefficients = []
    for _ in range(_RESAMPLED):
        times = rng.multinomial(len(blocks), np.full(len(blocks), 1 / len(blocks))).astype(float)
        coefficients.append(np.linalg.solve(np.tensordot(times, normal, 1) + ridge, times @ right))
    return coefficients


def _shares(coefficients: Floats, powers: np.ndarray) -> tuple[Floats, Floats]:
    """Return first-order and total shares of the variance, (K,) each."""
    part = coefficients[1:] ** 2 / (coefficients[1:] ** 2).sum()
    involved = powers[1:] > 0
    alone = involved.sum(1) == 1
    return part @ (involved & alone[:, None]), part @ involved
