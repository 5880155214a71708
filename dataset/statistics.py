"""Say which inputs an output depends on, from the rows of a sweep: Sobol indices and scaling laws.

For Sobol indices the output is fitted by polynomials of all inputs together that are orthonormal over the rows (a
polynomial chaos expansion). The variance then is the sum of squared coefficients:

    first order   share of the variance from terms in one input alone
    total         share from all terms that the input is part of

Intervals are percentiles over resampled blocks of rows. Inputs enter through their ranks: a sweep's design is even
in the scale that its configuration declares. Source: Sudret (2008), Reliability Engineering and System Safety 93,
964.

The exponent of a scaling law is ∂ln y/∂ln x with all other inputs held. It comes from a linear fit of ln y to the
logarithms of all inputs, over the rows in which x lies in one third of its range. A law holds where the thirds
agree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations_with_replacement, pairwise

import numpy as np

from common.arrays import Floats
from sim.inputs import check_columns
from sim.mechanics.drag import tail_coefficients
from sim.mechanics.linear_theory import linear_motion
from sim.model.groups import Groups

_HIGHEST = 4  # degree of the polynomials
_ROWS_A_TERM = 4
_RESAMPLED = 60
_BLOCKS = 30
_MAX_ROWS = 20_000  # more do not change the indices
_ERRORS = 1.96  # standard errors in an interval of 95 %
_ROWS_PER_INPUT = 3  # in each third
_MAX_LINEAR_ROWS = 2000  # linear theory takes about a millisecond a robot


@dataclass(frozen=True)
class Indices:
    """Sobol indices of one output; bounds are of 95 %."""

    inputs: tuple[str, ...]
    first: Floats  # (K,)
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
    if len(kept) > _MAX_ROWS:
        kept = rng.choice(kept, _MAX_ROWS, replace=False)
    names = tuple(name for name, values in inputs.items() if np.ptp(values[kept]) > 0)
    degree = _HIGHEST
    while degree > 1 and _ROWS_A_TERM * math.comb(len(names) + degree, degree) > len(kept):
        degree -= 1
    powers = _powers(len(names), degree)
    basis = _basis(np.stack([inputs[name][kept] for name in names], 1), powers, degree)
    y = output[kept]
    first, total = _shares(_fit(basis, y), powers)
    drawn = [_shares(c, powers) for c in _resampled(basis, y, rng)]
    bounds = np.quantile(np.array([share for _, share in drawn]), [0.025, 0.975], axis=0)  # (2, K)
    held_out = rng.permutation(len(y)) < len(y) // 5
    residual = y[held_out] - basis[held_out] @ _fit(basis[~held_out], y[~held_out])
    explained = 1 - float(np.var(residual) / np.var(y[held_out]))
    return Indices(names, first, total, bounds.T, explained, degree)


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


@dataclass(frozen=True)
class Exponents:
    """∂ln y/∂ln x in the lower, middle and upper third of x, with half-widths of 95 % intervals."""

    output: str
    input: str
    value: tuple[float, float, float]
    half_width: tuple[float, float, float]

    @property
    def holds(self) -> bool:
        """Return whether one power law describes all thirds: exponents differ by less than 0.1."""
        return max(self.value) - min(self.value) < 0.1


def exponents(inputs: Mapping[str, Floats], output: str, values: Floats) -> list[Exponents]:
    """Fit exponents of an output (M,) in every input (M,) that varies; rows that are not above 0 are left out."""
    good = np.isfinite(values) & (values > 0)
    names = [name for name, column in inputs.items() if np.ptp(column[good]) > 0]
    logs = np.stack([np.log(inputs[name][good]) for name in names], 1)
    y = np.log(values[good])
    return [Exponents(output, name, *_by_third(logs, y, k)) for k, name in enumerate(names)]


def rows_for_exponents(inputs: int) -> int:
    """Return how many rows exponents of so many inputs need."""
    return 3 * _ROWS_PER_INPUT * inputs


def _by_third(logs: Floats, y: Floats, k: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Fit exponents and half-widths of intervals in the thirds of input k."""
    edges = np.quantile(logs[:, k], [0, 1 / 3, 2 / 3, 1])
    slopes, errors = [], []
    for low, high in pairwise(edges):
        third = (logs[:, k] >= low) & (logs[:, k] <= high)
        x = logs[third] - logs[third].mean(0)
        if np.ptp(x[:, k]) == 0 or third.sum() < _ROWS_PER_INPUT * logs.shape[1]:
            slopes.append(np.nan)
            errors.append(np.nan)
            continue
        slope, _, _, _ = np.linalg.lstsq(x, y[third] - y[third].mean(), rcond=None)
        residual = y[third] - y[third].mean() - x @ slope
        freedom = max(len(residual) - x.shape[1] - 1, 1)
        covariance = np.linalg.pinv(x.T @ x) * residual.var() * len(residual) / freedom
        slopes.append(float(slope[k]))
        errors.append(_ERRORS * float(np.sqrt(covariance[k, k])))
    return (slopes[0], slopes[1], slopes[2]), (errors[0], errors[1], errors[2])


def linear_rows(columns: Mapping[str, Floats], *, seed: int = 0) -> tuple[np.ndarray, dict[str, Floats]]:
    """Evaluate linear theory for some of the rows: their numbers (K,), and outputs and drag number S, (K,) each.

    Args:
        columns: inputs by name, each (M,), without effects.
    """
    count = len(columns["N"])
    rows = np.arange(count)
    if count > _MAX_LINEAR_ROWS:
        rows = np.sort(np.random.default_rng(seed).choice(count, _MAX_LINEAR_ROWS, replace=False))
    values = check_columns({name: column[rows] for name, column in columns.items()})
    values_by_row = []
    for i in range(len(rows)):
        groups = Groups.from_columns({name: column[i : i + 1] for name, column in values.items()})
        motion, perpendicular = linear_motion(groups), tail_coefficients(groups.l_over_r0)[1].item()
        values_by_row.append(
            (motion.omega_t, motion.omega_yr, motion.v_x, motion.v_z, perpendicular * motion.omega_t)
        )
    omega_t, omega_yr, v_x, v_z, drag_number = np.abs(np.array(values_by_row).T)
    return rows, {
        "omega_t_bar": omega_t,
        "omega_yr_bar": omega_yr,
        "v_z": v_z,
        "R_yr_over_l": np.hypot(v_x, v_z) / omega_yr,
        "theta_deg": np.degrees(np.arctan2(v_x, v_z)),
        "S": drag_number,
    }
