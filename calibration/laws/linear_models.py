"""The linear models of a search: every place with every subset of its columns, for many residuals at once.

A model has the p columns J of the coefficients and nuisance parameters and q columns X of one place. With
Σ = (I + ρ 1 1ᵀ) ⊗ S the J are absorbed once for all models,

    C = Xᵀ Σ⁻¹ X − Xᵀ Σ⁻¹ J A⁻¹ Jᵀ Σ⁻¹ X,   b = Xᵀ Σ⁻¹ r − Xᵀ Σ⁻¹ J A⁻¹ Jᵀ Σ⁻¹ r,   A = Jᵀ Σ⁻¹ J + P⁻¹,

so that a model costs the inverse of its q × q matrix: weights C⁻¹ b, of covariance C⁻¹, and

    BIC = rᵀ Σ⁻¹ r − bᵀ A⁻¹ b − bᵀ C⁻¹ b + ln |Σ|/|S ⊗ I| + q ln(n k)   (b of J, then of X).

Each residual has its own S, from its repeats. Each model has its own ρ, by restricted maximum likelihood: the
deviance plus ln |A| + ln |C| is smallest. Both are computed at a few ρ, evenly spaced in ln(1 + ρ n_s), and the
parabola through three of them gives its minimum and the deviance there. Products of two columns are linear in S⁻¹.
They are made once, for every ρ and every pair of outputs.

Source: Schwarz (1978) for BIC; Patterson and Thompson (1971) for ρ.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.statistics.statistical_model import (
    SESSION_SHARE,
    averaging_rows,
    inverse_root,
    repeat_covariance,
    solved,
)
from sim.arrays import Floats, Integers

_SHARES = 9  # values of ρ at which the deviance is computed
_AT_ONCE = 25  # residuals


@dataclass(frozen=True)
class LinearFits:
    """All models fitted to B residuals; M models, places with v columns."""

    gain: Floats  # (B, M) BIC of the model without a place less that with it
    weights: Floats  # (B, M, v) of the place's columns; 0 where the column is not in the model
    errors: Floats  # (B, M, v) their standard errors; infinite where the column is not in the model
    share: Floats  # (B, M) ρ
    base_share: Floats  # (B,) ρ without a place


class LinearModels:
    """The columns of a search, which stay the same for every residual."""

    def __init__(
        self,
        absorbed: Floats,
        precision: Floats,
        columns: Floats,
        models: Sequence[tuple[int, tuple[int, ...]]],
        session: Integers,
        condition: Integers,
    ):
        """Multiply the columns with each other.

        Args:
            absorbed: J, (n, k, p).
            precision: 1/σ² of their priors, 0 for those that are free, (p,).
            columns: (n, k, P, v) of P places.
            models: place and columns of each.
            session: (n,) numbers of the runs' sessions.
            condition: (n,) repeats share a number.
        """
        n, k, self.p = absorbed.shape
        self.absorbed, self.precision, self.columns = absorbed, precision, columns
        self.models, self.session, self.condition = tuple(models), session, condition
        self._places, self._count = columns.shape[2:]
        self._picks, self._sizes = averaging_rows(session)
        whole = math.log1p(SESSION_SHARE * self._sizes.mean())
        self._levels = np.linspace(0.0, whole, _SHARES) if len(self._sizes) > 1 else np.array([whole])
        shares = self._share(np.arange(len(self._levels)))
        table = np.concatenate([absorbed, columns.reshape(n, k, -1)], -1)
        less = 1 / (1 + shares[:, None] * self._sizes) - 1  # (g, s)
        means = np.tensordot(self._picks, table, 1)
        self._less = less
        self._weighted = np.stack(
            [(table + np.tensordot(self._picks.T, w[:, None, None] * means, 1)).reshape(n * k, -1) for w in less]
        )
        self._determinant = k * np.log1p(shares[:, None] * self._sizes).sum(1)  # ln |Σ|/|S ⊗ I|
        self._products = self._multiply(table)

    def _multiply(self, table: Floats) -> tuple[Floats, Floats, Floats]:
        """Multiply J with J, J with the columns, and those of each place, (g, k k, ...)."""
        n, k, m = table.shape
        p, places, count = self.p, self._places, self._count
        absorbed, across, own = [], [], []
        left = np.ascontiguousarray(table.transpose(1, 2, 0))  # (k, m, n)
        at_place = left[:, p:].reshape(k, places, count, n)
        for weighted in self._weighted:
            right = np.ascontiguousarray(weighted.reshape(n, k, m).transpose(1, 0, 2))  # (k, n, m)
            absorbed.append(left[:, None, :p] @ right[None, :, :, :p])
            across.append(left[:, None, :p] @ right[None, :, :, p:])
            of_place = right[:, :, p:].reshape(k, n, places, count).transpose(0, 2, 1, 3)
            own.append(at_place[:, None] @ of_place[None])
        return tuple(np.stack(each).reshape(len(each), k * k, -1) for each in (absorbed, across, own))  # type: ignore[return-value]

    def fit(self, residuals: Floats) -> LinearFits:
        """Fit all models to residuals (B, n, k) from the parameters as given."""
        parts = [self._fit(residuals[i : i + _AT_ONCE]) for i in range(0, len(residuals), _AT_ONCE)]
        return LinearFits(*(np.concatenate([getattr(part, f) for part in parts]) for f in vars(parts[0])))

    def _fit(self, residual: Floats) -> LinearFits:
        C, b, without, log_determinant = self._absorb(residual)
        base_at, base_deviance = _at_minimum(without + log_determinant, without)
        count, models = len(residual), len(self.models)
        gain, share = np.empty((count, models)), np.empty((count, models))
        weights, errors = np.zeros((count, models, self._count)), np.full((count, models, self._count), np.inf)
        price = math.log(residual[0].size)
        for q in sorted({len(chosen) for _, chosen in self.models}):
            which = [i for i, (_, chosen) in enumerate(self.models) if len(chosen) == q]
            place = np.array([self.models[i][0] for i in which])[:, None]
            chosen = np.array([self.models[i][1] for i in which])
            normal = np.empty((*C.shape[:2], len(which), q + 1, q + 1))
            normal[..., :q, :q] = C[:, :, place[..., None], chosen[:, :, None], chosen[:, None, :]]
            normal[..., :q, q] = b[:, :, place, chosen]
            step, covariance = solved(normal)
            deviance = without[..., None] - (step * normal[..., :q, q]).sum(-1)
            restricted = deviance + log_determinant[..., None] - np.linalg.slogdet(covariance)[1]
            at, least = _at_minimum(restricted, deviance)
            gain[:, which] = base_deviance[:, None] - least - q * price
            share[:, which] = self._share(at)
            row, column, nearest = np.arange(count)[:, None], np.arange(len(which)), np.rint(at).astype(np.int64)
            to = (row[..., None], np.array(which)[None, :, None], chosen[None])
            weights[to] = step[nearest, row, column]
            variance = np.diagonal(covariance[nearest, row, column], axis1=-2, axis2=-1)
            errors[to] = np.sqrt(np.maximum(variance, 0.0))
        return LinearFits(gain, weights, errors, share, self._share(base_at))

    def _share(self, at: Floats | Integers) -> Floats:
        """Compute ρ at places, which may be between two of those at which the deviance is computed."""
        levels = np.interp(at, np.arange(len(self._levels)), self._levels)
        return np.asarray(np.expm1(levels) / self._sizes.mean())

    def _absorb(self, residual: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Absorb J at every ρ.

        Returns:
            C (g, b, P, v, v), b (g, b, P, v), and without a place the deviance and ln |A| (g, b).
        """
        count, _, k = residual.shape
        p, places, columns = self.p, self._places, self._count
        root = inverse_root(repeat_covariance(residual, self.condition))
        inverse = np.swapaxes(root, -1, -2) @ root
        flat = inverse.reshape(count, k * k)
        of_absorbed, across, own = (flat @ part for part in self._products)  # (g, b, ...)
        A = of_absorbed.reshape(-1, count, p, p) + np.diag(self.precision)
        across = across.reshape(-1, count, p, places * columns)
        weighted = residual @ inverse
        toward = weighted.reshape(count, -1) @ self._weighted  # (g, b, p + P v)
        means, weighted_means = self._picks @ residual, self._picks @ weighted  # (b, s, k)
        square = (weighted * residual).sum((1, 2)) + self._less @ (means * weighted_means).sum(-1).T
        solution = np.linalg.solve(A, np.concatenate([across, toward[..., :p, None]], -1))
        step = solution[..., -1]
        left = toward[..., p:] - (step[..., None, :] @ across)[..., 0, :]
        solution = solution[..., :-1].reshape(-1, count, p, places, columns).transpose(0, 1, 3, 2, 4)
        by_place = across.reshape(-1, count, p, places, columns).transpose(0, 1, 3, 4, 2)
        C = own.reshape(-1, count, places, columns, columns) - by_place @ solution
        deviance = square - (step * toward[..., :p]).sum(-1) + self._determinant[:, None]
        return C, left.reshape(-1, count, places, columns), deviance, np.linalg.slogdet(A)[1]


def _at_minimum(restricted: Floats, deviance: Floats) -> tuple[Floats, Floats]:
    """Find where the first is smallest along ρ (g, ...), by a parabola, and compute the second there.

    Returns:
        The place (...) along ρ, which may be between two, and the deviance (...).
    """
    if len(restricted) == 1:
        return np.zeros(restricted.shape[1:]), deviance[0]
    middle = np.clip(restricted.argmin(0), 1, len(restricted) - 2)
    low, centre, high = (np.take_along_axis(restricted, (middle + i)[None], 0)[0] for i in (-1, 0, 1))
    curvature = np.maximum(low - 2 * centre + high, 1e-12)
    t = np.clip((low - high) / (2 * curvature), -1.0, 1.0)
    low, centre, high = (np.take_along_axis(deviance, (middle + i)[None], 0)[0] for i in (-1, 0, 1))
    least = centre + t * (high - low) / 2 + t**2 * (low - 2 * centre + high) / 2
    return middle + t, least
