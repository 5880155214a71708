"""Generalised least squares with a scatter of the sessions and priors, for any batch of residuals.

**Noise.** Runs under the same condition give the covariance S (k, k) of the outputs of one run. All outputs
together are needed, because R_yr and θ are not independent of the spins and the yaw rate. A session may shift all
its runs together, with a variance that is a share ρ of that of a run. Repeats within a session do not average this
shift out. So the covariance of a session's n runs is

    Σ = (I_n + ρ 1 1ᵀ) ⊗ S.

There is one ρ for all outputs. With three sessions and five outputs it has about a dozen degrees of freedom; a ρ
for each output would have two. ρ comes from the residuals of the fitted model, so a missing effect makes it
larger. Therefore it is at most `SESSION_SHARE`: sessions are assumed to scatter no more than single runs do, and a
larger shift of a whole session must be explained by the model. With a single session nothing is known about ρ.
Then ρ is that limit, and a shift that is equal in all runs has almost no weight.

**Weights.** A run of weight w has the covariance S/w (`calibration.statistics.weights`):

    Σ = (W⁻¹ + ρ 1 1ᵀ) ⊗ S = W^−½ (I_n + ρ √w √wᵀ) W^−½ ⊗ S,   W = diag w.

So rows are multiplied by √w, and means over a session are taken along √w. Σ w takes the place of n.

**Priors.** A nuisance parameter with σ was given before the runs were made. It counts as one more measurement of
itself: a row with derivative 1/σ and residual −x/σ, where x is its change from the value as given, on its own
scale. With such rows in every least-squares fit, the covariance of the runs is Σ + J P Jᵀ in every test
(P = diag σ²), without being formed. Source: priors as rows, e.g. Gelman et al. (2013), section 14.8.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim.arrays import Floats, Integers

SESSION_SHARE = 1.0  # largest ρ
_RIDGE = 1e-11  # so that columns without any signal get a large variance


@dataclass(frozen=True)
class Noise:
    """S (k, k) of a run and ρ of a session."""

    run: Floats  # S: covariance (k, k) of a run
    share: float  # ρ: variance of a session over that of a run

    def whitener(self, session: Integers, scale: Floats | None = None) -> Callable[[Floats], Floats]:
        """Make Σ^−½, which flattens (n, k, ...) to (n k, ...), for runs of `session` (n,).

        Args:
            scale: (n,) roots of the weights of the runs.
        """
        along = np.ones(len(session)) if scale is None else scale
        root, (picks, sizes) = inverse_root(self.run), averaging_rows(session, along)
        less = (1 / np.sqrt(1 + sizes * self.share) - 1)[:, None] * picks

        def whiten(table: Floats) -> Floats:
            white = np.einsum("n,ab,nb...->na...", along, root, table, optimize=True).reshape(len(table), -1)
            return np.asarray((white + picks.T @ (less @ white)).reshape(-1, *table.shape[2:]))

        return whiten

    def covariance(self, session: Integers) -> Floats:
        """Compute Σ of the runs of `session` (n,), (n k, n k)."""
        together = session[:, None] == session
        return np.asarray(np.kron(np.eye(len(session)) + self.share * together, self.run))


class Gls:
    """The columns of some runs, which stay the same for any batch of residuals of these runs, each in its own S.

    Products of two columns are linear in S⁻¹, so they are made once for every pair of outputs.
    """

    def __init__(
        self,
        columns: Floats,
        precision: Floats,
        session: Integers,
        scale: Floats | None = None,
        repeated: Integers | Floats | None = None,
    ):
        """Multiply the columns with each other.

        Args:
            columns: (n, k, m).
            precision: 1/σ² of the priors of the first p columns, 0 for those that are free, (p,).
            session: (n,) numbers of the runs' sessions.
            scale: (n,) roots of the weights of the runs.
            repeated: what tells repeats, see `Runs.repeats`; needed for the residuals' own S.
        """
        n, k, m = columns.shape
        self.precision, self.repeated = precision, repeated
        self.session = np.unique(session, return_inverse=True)[1].reshape(-1)
        self.scale = np.ones(n) if scale is None else scale
        self.picks, self.sizes = averaging_rows(session, self.scale)
        self.columns = columns * self.scale[:, None, None]
        self._flat = self.columns.reshape(n * k, m)
        self.means = self.average(self.columns)  # (s, k, m)
        whole = np.einsum("nim,njl->ijml", self.columns, self.columns, optimize=True)
        between = np.einsum("sim,sjl->ijsml", self.means, self.means, optimize=True)
        self._whole, self._between = whole.reshape(k * k, m * m), between.reshape(k * k, -1)

    def average(self, table: Floats) -> Floats:
        """Average each session, times the root of its size, (s, ...), of (n, ...)."""
        return np.asarray(np.tensordot(self.picks, table, 1))

    def shrink(self, table: Floats, share: Floats) -> Floats:
        """Whiten runs (B, n, c) in Σ that are white in S, with ρ (B,)."""
        less = 1 / np.sqrt(1 + share[:, None] * self.sizes) - 1  # (B, s)
        return np.asarray(table + self.picks.T @ (less[..., None] * (self.picks @ table)))

    def noise(self, residual: Floats) -> Floats:
        """Estimate S (..., k, k) of residuals (..., n, k)."""
        assert self.repeated is not None
        return repeat_covariance(residual, self.repeated, self.scale)

    def products(self, residual: Floats, run: Floats | None = None, change: Floats | None = None) -> Products:
        """Multiply the columns, and a residual behind them, with each other, with the priors.

        Args:
            residual: (..., n, k).
            run: S, (k, k) or (..., k, k); default: that of each residual.
            change: of the parameters with which the residual was computed from those as given (p,); default 0.
        """
        root = inverse_root(self.noise(residual) if run is None else run)
        precision = np.swapaxes(root, -1, -2) @ root
        (*batch, n, k), (s, _, m) = residual.shape, self.means.shape
        residual = residual * self.scale[:, None]
        weighted = residual @ precision
        means, weighted_means = self.picks @ residual, self.picks @ weighted  # (..., s, k)
        flat = precision.reshape(*precision.shape[:-2], k * k)
        total, between = np.empty((*batch, m + 1, m + 1)), np.empty((*batch, s, m + 1, m + 1))
        total[..., :m, :m] = (flat @ self._whole).reshape(*flat.shape[:-1], m, m)
        between[..., :m, :m] = (flat @ self._between).reshape(*flat.shape[:-1], s, m, m)
        total[..., m, :m] = total[..., :m, m] = weighted.reshape(*batch, n * k) @ self._flat
        across = np.einsum("...sk,skm->...sm", weighted_means, self.means, optimize=True)
        between[..., m, :m] = between[..., :m, m] = across
        total[..., m, m] = (weighted * residual).sum((-1, -2))
        between[..., m, m] = (weighted_means * means).sum(-1)
        own = np.arange(len(self.precision))
        total[..., own, own] += self.precision
        if change is not None:
            total[..., own, m] -= self.precision * change
            total[..., m, own] -= self.precision * change
            total[..., m, m] += (self.precision * change**2).sum()
        return Products(total - between.sum(-3), between, self.sizes, k)

    def draw(self, rng: np.random.Generator, run: Floats, share: Floats, spread: Floats | None = None) -> Floats:
        """Draw residuals (B, n, k) from the parameters as given: noise of runs and sessions, and the parameters.

        Args:
            run: S (k, k).
            share: (B,) ρ of each table.
            spread: (p, p) root of the covariance of the first p parameters; default: that of the priors.
        """
        count, (n, k, _), p = len(share), self.columns.shape, len(self.precision)
        noise = rng.normal(size=(count, n, k)) / self.scale[:, None]
        shifts = rng.normal(size=(count, len(self.sizes), k))[:, self.session]
        noise += np.sqrt(share)[:, None, None] * shifts
        if spread is None:
            known = self.precision > 0
            spread = np.diag(np.where(known, 1 / np.sqrt(np.where(known, self.precision, 1.0)), 0.0))
        change = rng.normal(size=(count, p)) @ spread.T
        J = self.columns[..., :p] / self.scale[:, None, None]
        return np.asarray(noise @ np.linalg.cholesky(run).T + np.einsum("nkp,bp->bnk", J, change, optimize=True))


@dataclass(frozen=True)
class Linear:
    """Generalised least squares of the last column by the others; `...` stands for batches."""

    step: Floats  # (..., p)
    covariance: Floats  # (..., p, p)
    share: Floats  # (...) ρ


@dataclass(frozen=True)
class Products:
    """Products of columns, within sessions and of the sessions' means, for any ρ; `...` stands for batches."""

    within: Floats  # (..., m, m)
    between: Floats  # (..., s, m, m)
    sizes: Floats  # (s,) runs of a session, or their weights
    outputs: int

    def at(self, share: Floats | float) -> Floats:
        """Compute columnᵀ Σ⁻¹ column, (..., m, m), for ρ (...)."""
        weight = 1 / (1 + np.asarray(share)[..., None] * self.sizes)
        columns = self.between.shape[-1]
        flat = self.between.reshape(*self.between.shape[:-2], columns * columns)
        between = (weight[..., None, :] @ flat).reshape(*weight.shape[:-1], *self.between.shape[-2:])
        return np.asarray(self.within + between)

    def take(self, columns: Integers) -> Products:
        """Choose columns (c, q), (..., c, q, q)."""
        rows, cols = columns[:, :, None], columns[:, None, :]
        between = np.swapaxes(self.between[..., rows, cols], -4, -3)
        return Products(self.within[..., rows, cols], between, self.sizes, self.outputs)

    def solve(self, *, passes: int) -> Linear:
        """Fit the last of the columns, with ρ from its own residuals after `passes` iterations (0: ρ = 0)."""
        share = self.share(passes=passes)
        return Linear(*solved(self.at(share)), share)

    def share(self, *, passes: int) -> Floats:
        """Estimate ρ (...) from the residuals of a fit of the last column, after `passes` iterations from 0.

        The expected scatter of the sessions' means is Σ_s n_s |m_s|² = (k − h/s) Σ_s (1 + ρ n_s), where h of
        their k s degrees of freedom are used by the fit.
        """
        count, p = len(self.sizes), self.within.shape[-1] - 1
        share = np.zeros(self.within.shape[:-2])
        if count == 1 and passes:
            return np.full_like(share, SESSION_SHARE)
        for _ in range(passes):
            normal = self.at(share)
            step, covariance = solved(normal)
            combination = np.concatenate([-step, np.ones((*share.shape, 1))], -1)
            each = self.between @ combination[..., None, :, None]
            between = (each[..., 0] * combination[..., None, :]).sum((-1, -2))
            means = normal[..., :p, :p] - self.within[..., :p, :p]
            freedom = self.outputs - (covariance * np.swapaxes(means, -1, -2)).sum((-1, -2)) / count
            excess = between / np.maximum(freedom, 0.1 * self.outputs) - count
            share = np.clip(excess / self.sizes.sum(), 0.0, SESSION_SHARE)
        return share


def solved(normal: Floats) -> tuple[Floats, Floats]:
    """Solve for the coefficients (..., p) of the last of the columns; with their covariance (..., p, p)."""
    covariance = _inverse(normal[..., :-1, :-1])
    return (covariance @ normal[..., :-1, -1:])[..., 0], covariance


def eliminated(normal: Floats, count: int) -> Floats:
    """Return what the first `count` columns cannot absorb of the others' products (Schur complement)."""
    across = normal[..., :count, count:]
    absorbed = np.swapaxes(across, -1, -2) @ _inverse(normal[..., :count, :count]) @ across
    return np.asarray(normal[..., count:, count:] - absorbed)


def _inverse(matrix: Floats) -> Floats:
    """Invert positive matrices (..., p, p), each column on its own scale."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    scale = np.where(diagonal > 1e-280, np.sqrt(np.maximum(diagonal, 1e-280)), 1.0)
    scaled = matrix / scale[..., :, None] / scale[..., None, :]
    inverse = np.linalg.inv(scaled + _RIDGE * np.eye(matrix.shape[-1]))
    return np.asarray(inverse / scale[..., :, None] / scale[..., None, :])


def inverse_root(run: Floats) -> Floats:
    """Return L⁻¹ of S = L Lᵀ, (..., k, k)."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(run)))


def averaging_rows(session: Integers, scale: Floats | None = None) -> tuple[Floats, Floats]:
    """Make rows (s, n) that take the mean of each session times the root of its size; the sizes (s,).

    Args:
        scale: (n,) roots of the weights, by which the runs were multiplied; their squares are the sizes.
    """
    kinds, place = np.unique(session, return_inverse=True)
    along = np.ones(len(session)) if scale is None else scale
    rows = (np.arange(len(kinds))[:, None] == place.reshape(-1)) * along
    sizes = (rows**2).sum(1)
    return rows / np.sqrt(sizes)[:, None], sizes


def repeat_covariance(y: Floats, repeated: Integers | Floats, scale: Floats | None = None) -> Floats:
    """Estimate S (..., k, k) from the scatter of (..., n, k) between repeats, pooled.

    Args:
        repeated: see `Runs.repeats`; each level, and each column of a design, has its own effect on y.
        scale: (n,) roots of the weights of the runs.
    """
    basis = _same_in_repeats(repeated, scale)
    y = y if scale is None else y * scale[:, None]
    centred = y - basis @ (basis.T @ y)
    return np.asarray(np.swapaxes(centred, -1, -2) @ centred / (len(basis) - basis.shape[1]))


def repeat_count(repeated: Integers | Floats) -> int:
    """Count the degrees of freedom of `repeat_covariance`."""
    basis = _same_in_repeats(repeated, None)
    return len(basis) - basis.shape[1]


def _same_in_repeats(repeated: Integers | Floats, scale: Floats | None) -> Floats:
    """Return an orthonormal basis (n, r) of what is no noise, times the roots of the weights."""
    if repeated.ndim == 1:
        return averaging_rows(repeated.astype(np.int64), scale)[0].T
    design = repeated if scale is None else repeated * scale[:, None]
    left, values, _ = np.linalg.svd(design, full_matrices=False)
    return np.asarray(left[:, values > 1e-9 * values[0]])
