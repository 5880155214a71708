"""Noise of a table: scatter of the repeats, and of the sessions; generalised least squares in that noise.

Runs under the same condition give the covariance S (k, k) of the outputs of one run. All outputs together are
needed, because R_yr and θ are not independent of the spins and the yaw rate. A session may shift all its runs
together, with a variance that is a share ρ of that of a run. Repeats within a session do not average this shift
out. So the covariance of a session's n runs is

    Σ = (I_n + ρ 1 1ᵀ) ⊗ S.

There is one ρ for all outputs. With three sessions and five outputs it has about a dozen degrees of freedom; a ρ
for each output would have two. ρ comes from the residuals of the fitted model, so a missing effect makes it
larger. Therefore it is at most `SESSION_SHARE`: sessions are assumed to scatter no more than single runs do, and a
larger shift of a whole session must be explained by the model. With a single session nothing is known about ρ.
Then ρ is that limit, and a shift that is equal in all runs has almost no weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.arrays import Floats, Integers

SESSION_SHARE = 1.0  # largest ρ
_RIDGE = 1e-11

Labels = Integers


@dataclass(frozen=True)
class Noise:
    """S (k, k) of a run and ρ of a session."""

    run: Floats
    share: float

    def whitener(self, session: Labels) -> Whitener:
        return Whitener(self, session)

    def covariance(self, session: Labels) -> Floats:
        """Σ of the runs of `session` (n,), (n k, n k)."""
        together = session[:, None] == session
        return np.asarray(np.kron(np.eye(len(session)) + self.share * together, self.run))


class Whitener:
    """Σ^−½ for the runs of `session`; applies to residuals (n, k, ...) and flattens them."""

    def __init__(self, noise: Noise, session: Labels):
        self._inverse = inverse_root(noise.run)
        self._share = noise.share
        self._groups = [np.flatnonzero(session == s) for s in np.unique(session)]

    def __call__(self, table: Floats) -> Floats:
        """Whiten (n, k, ...) to (n k, ...)."""
        white = np.einsum("ab,nb...->na...", self._inverse, table)
        for rows in self._groups:
            white[rows] += (1 / np.sqrt(1 + len(rows) * self._share) - 1) * white[rows].mean(0)
        return np.asarray(white.reshape(-1, *table.shape[2:]))


@dataclass(frozen=True)
class Sums:
    """Products of columns, within sessions and of the sessions' means, for any ρ; `...` stands for batches."""

    within: Floats  # (..., m, m)
    between: Floats  # (..., s, m, m)
    sizes: Floats  # (s,) runs of a session
    outputs: int

    def at(self, share: Floats) -> Floats:
        """Columnᵀ Σ⁻¹ column, (..., m, m), for ρ (...)."""
        weight = 1 / (1 + share[..., None] * self.sizes)
        columns = self.between.shape[-1]
        flat = self.between.reshape(*self.between.shape[:-2], columns * columns)
        between = (weight[..., None, :] @ flat).reshape(*weight.shape[:-1], *self.between.shape[-2:])
        return np.asarray(self.within + between)

    def take(self, columns: Integers) -> Sums:
        """The same for choices of columns (c, q), (..., c, q, q)."""
        rows, cols = columns[:, :, None], columns[:, None, :]
        between = np.swapaxes(self.between[..., rows, cols], -4, -3)
        return Sums(self.within[..., rows, cols], between, self.sizes, self.outputs)


@dataclass(frozen=True)
class Linear:
    """Generalised least squares of the last column by the others; `...` stands for batches."""

    step: Floats  # (..., p)
    covariance: Floats  # (..., p, p)
    share: Floats  # (...) ρ


def root_diagonal(whole: Floats) -> Floats:
    """Roots of the diagonals of (..., p, p), 1 where there is nothing."""
    diagonal = np.diagonal(whole, axis1=-2, axis2=-1)
    return np.where(diagonal > 1e-280, np.sqrt(np.maximum(diagonal, 1e-280)), 1.0)


def inverse(scaled: Floats) -> Floats:
    """Inverse of positive semidefinite matrices (..., p, p) with ones on the diagonal; large where there is
    none.
    """
    return np.asarray(np.linalg.inv(scaled + _RIDGE * np.eye(scaled.shape[-1])))


def inverse_root(run: Floats) -> Floats:
    """L⁻¹ of S = L Lᵀ, (..., k, k)."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(run)))


def sums(columns: Floats, session: Labels, outputs: int) -> Sums:
    """Products of columns (..., n, k, m) that are white in S."""
    *batch, n, k, m = columns.shape
    flat = columns.reshape(*batch, n * k, m)
    whole = np.swapaxes(flat, -1, -2) @ flat
    picks, count = _picks(session)
    means = np.einsum("sn,...nkm->...skm", picks, columns)
    between = np.swapaxes(means, -1, -2) @ means
    return Sums(whole - between.sum(-3), between, count, outputs)


def _picks(session: Labels) -> tuple[Floats, Floats]:
    """Rows (s, n) that take the mean of each session times the root of its size; the sizes (s,)."""
    kinds, place, count = np.unique(session, return_inverse=True, return_counts=True)
    return (np.arange(len(kinds))[:, None] == place.reshape(-1)) / np.sqrt(count)[:, None], count.astype(float)


class FixedColumns:
    """Columns (n, k, m) that stay the same for many residuals, each of which has its own S.

    Products of two columns are linear in S⁻¹, so they are made once for every pair of outputs.
    """

    def __init__(self, columns: Floats, session: Labels):
        n, k, m = columns.shape
        self.picks, self.sizes = _picks(session)
        self._flat = columns.reshape(n * k, m)
        self.means = self.average(columns)  # (s, k, m)
        self._whole = np.einsum("nim,njl->ijml", columns, columns, optimize=True).reshape(k * k, m * m)
        between = np.einsum("sim,sjl->ijsml", self.means, self.means, optimize=True)
        self._between = between.reshape(k * k, -1)

    def average(self, table: Floats) -> Floats:
        """Mean of each session times the root of its size, (s, ...), of (n, ...)."""
        return np.asarray(np.tensordot(self.picks, table, 1))

    def sums(self, precision: Floats, residual: Floats) -> Sums:
        """The same as `sums` of these columns and a residual behind them.

        Args:
            precision: S⁻¹, (b, k, k).
            residual: (b, n, k).
        """
        b, n, k = residual.shape
        s, _, m = self.means.shape
        weighted = residual @ precision
        means, weighted_means = self.picks @ residual, self.picks @ weighted  # (b, s, k)
        flat = precision.reshape(b, k * k)
        whole, between = np.empty((b, m + 1, m + 1)), np.empty((b, s, m + 1, m + 1))
        whole[:, :m, :m] = (flat @ self._whole).reshape(b, m, m)
        between[:, :, :m, :m] = (flat @ self._between).reshape(b, s, m, m)
        whole[:, m, :m] = whole[:, :m, m] = weighted.reshape(b, n * k) @ self._flat
        across = np.einsum("bsk,skm->bsm", weighted_means, self.means, optimize=True)
        between[..., m, :m] = between[..., :m, m] = across
        whole[:, m, m] = (weighted * residual).sum((-1, -2))
        between[..., m, m] = (weighted_means * means).sum(-1)
        return Sums(whole - between.sum(-3), between, self.sizes, k)


def least_squares(products: Sums, *, passes: int) -> Linear:
    """Fit the last of the columns, with ρ from its own residuals after `passes` iterations (0: ρ = 0)."""
    share = session_share(products, passes=passes)
    return Linear(*solved(products.at(share)), share)


def session_share(products: Sums, *, passes: int) -> Floats:
    """ρ (...) from the residuals of a fit of the last of the columns, after `passes` iterations from 0.

    The expected scatter of the sessions' means is Σ_s n_s |m_s|² = (k − h/s) Σ_s (1 + ρ n_s), where h of their k s
    degrees of freedom are used by the fit.
    """
    count, p = len(products.sizes), products.within.shape[-1] - 1
    share = np.zeros(products.within.shape[:-2])
    if count == 1 and passes:
        return np.full_like(share, SESSION_SHARE)
    for _ in range(passes):
        whole = products.at(share)
        step, covariance = solved(whole)
        left = np.concatenate([-step, np.ones((*share.shape, 1))], -1)
        each = products.between @ left[..., None, :, None]
        between = (each[..., 0] * left[..., None, :]).sum((-1, -2))
        means = whole[..., :p, :p] - products.within[..., :p, :p]
        freedom = products.outputs - (covariance * np.swapaxes(means, -1, -2)).sum((-1, -2)) / count
        excess = between / np.maximum(freedom, 0.1 * products.outputs) - count
        share = np.clip(excess / products.sizes.sum(), 0.0, SESSION_SHARE)
    return share


def solved(whole: Floats) -> tuple[Floats, Floats]:
    """Coefficients (..., p) of the last of the columns, and their covariance (..., p, p)."""
    p = whole.shape[-1] - 1
    scale = root_diagonal(whole[..., :p, :p])
    scaled = whole[..., :p, :p] / scale[..., :, None] / scale[..., None, :]
    covariance = inverse(scaled) / scale[..., :, None] / scale[..., None, :]
    return (covariance @ whole[..., :p, p, None])[..., 0], covariance


def repeat_covariance(y: Floats, condition: Labels) -> Floats:
    """S (..., k, k) from the scatter of (..., n, k) about the mean of each condition, pooled."""
    places = np.unique(condition, return_inverse=True)[1].reshape(-1)
    count = np.bincount(places)
    picks = (np.arange(len(count))[:, None] == places) / count[:, None]
    centred = y - (picks @ y)[..., places, :]
    return np.asarray(np.swapaxes(centred, -1, -2) @ centred / (len(places) - len(count)))
