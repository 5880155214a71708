"""Generalised least squares with a scatter of the sessions and priors, for any batch of residuals.

**Noise.** Runs under the same condition give the covariance S (k, k) of the outputs of one run. All outputs
together are needed, because R_yr and θ are not independent of the spins and the yaw rate. With V = diag S and the
correlation C = V^−½ S V^−½ the axes A = V^½ C^½ make a run white, S = A Aᵀ, and are those nearest to the
outputs, one for each (ZCA-cor; Kessy, Lewin, Strimmer 2018). A session may shift all its runs together, with a
variance that is a share ρ_a of that of a run along axis a. Repeats within a session do not average this shift out.
So the covariance of a session's n runs is

    Σ = I_n ⊗ S + 1 1ᵀ ⊗ A diag(ρ) Aᵀ.

A zero of an angle that is set each morning shifts one output, the temperature all. With three sessions the ρ of
one output has two degrees of freedom, one of all of them about a dozen. So each is the mean of its own estimate
and that of all outputs, as if as many sessions again had scattered as all outputs do (moderated variances, Smyth
2004).
ρ comes from how the residuals of the sessions scatter about their common mean: what all sessions share is a misfit
of the model, and no scatter. It is at most `_MOST_SCATTER`; a larger shift of a whole session must be explained by
the model. With a single session, and where each session has a number of its own in the fit, nothing is known about
ρ. Then it is taken to be `UNKNOWN_SHARE`.

**Fits and tests.** Σ⁻¹ gives almost no weight to a shift of all runs, so with a wrong model least squares buys a
better slope with a wrong level. Therefore a fit has the weights W: Σ⁻¹, but the mean over all sessions has the
weight that it has at ρ = 0. Where ρ is unknown, it is 0 in W. The covariance of such a fit contains the scatter,

    V = A⁻¹ B A⁻¹ = A⁻¹ + A⁻¹ (B − A) A⁻¹,   A = JᵀWJ,   B = JᵀWΣWJ,

where priors count in A and B alike; the second form is that of A⁻¹ for a column without any signal. With balanced
sessions a fit loses nothing by it (McElroy 1967). The tests have Σ: a shift of all runs is no evidence.

**Traces.** Readings of traces are whitened along their time first (`calibration.linear.memory`). So a shift of all
readings of a session, 1, is L⁻¹1 in them. It takes the place of √w as that along which means are taken.

**Weights.** A run of weight w has the covariance S/w (`calibration.statistics.weights`):

    Σ = W⁻¹ ⊗ S + 1 1ᵀ ⊗ A diag(ρ) Aᵀ,   W = diag w.

So rows are multiplied by √w, and means over a session are taken along √w. Σ w takes the place of n.

**Priors.** A nuisance parameter with σ was given before the runs were made. It counts as one more measurement of
itself: a row with derivative 1/σ and residual −x/σ, where x is its change from the value as given, on its own
scale. With such rows in every least-squares fit, the covariance of the runs is Σ + J P Jᵀ in every test
(P = diag σ²), without being formed. Source: priors as rows, e.g. Gelman et al. (2013), section 14.8.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from common.arrays import Flags, Floats, Integers

UNKNOWN_RATIO = 1.0  # ρ where nothing is known about it
_MOST_SCATTER = 9.0  # largest ρ
_LEAST_FREEDOM = 0.5  # degrees of freedom of the sessions' means below which ρ is unknown
_NOTHING = 1e-12  # size of a session whose shift is absorbed
_RIDGE = 1e-11  # so that columns without any signal get a large variance


class Groups(NamedTuple):
    """Runs in the order of their conditions."""

    order: Integers  # (n,)
    back: Integers  # (n,) place of each run in that order
    first: Integers  # (c,) first run of each condition
    sizes: Integers  # (c,)
    place: Integers  # (n,) condition of each run in that order

    @classmethod
    def of(cls, condition: Integers) -> Groups:
        """Sort runs by their conditions (n,)."""
        order = np.argsort(condition, kind="stable")
        first, count = np.unique(condition[order], return_index=True, return_counts=True)[1:]
        return cls(order, np.argsort(order), first, count, np.repeat(np.arange(len(count)), count))

    def add(self, table: Floats) -> Floats:
        """Add up runs in their order, those of each condition, (..., n, k) to (..., c, k)."""
        return np.asarray(np.add.reduceat(table, self.first, axis=-2))


@dataclass(frozen=True)
class Noise:
    """S (k, k) of a run and ρ of a session."""

    run_covariance: Floats  # S: covariance (k, k) of a run
    session_ratio: Floats | float  # ρ: variance of a session over that of a run, of each output (k,) or of all

    @property
    def rms(self) -> float:
        """Standard deviation of a run, root mean square over the outputs."""
        return float(np.sqrt(np.trace(self.run_covariance) / len(self.run_covariance)))

    def whitener(
        self, session: Integers, scale: Floats | None = None, along: Floats | None = None
    ) -> Callable[[Floats], Floats]:
        """Make Σ^−½, (n, k, ...) to (n k, ...), for runs of `session` (n,); see `Regression` for the others."""
        scale = np.ones(len(session)) if scale is None else scale
        root = inverse_root(self.run_covariance)
        picks, sizes = averaging_rows(session, scale if along is None else along)
        less = 1 / np.sqrt(1 + sizes[:, None] * np.broadcast_to(self.session_ratio, len(root))) - 1  # (s, k)

        def whiten(table: Floats) -> Floats:
            white = np.einsum("n,ab,nb...->na...", scale, root, table, optimize=True)
            means = np.einsum("sa,sn,na...->sa...", less, picks, white, optimize=True)
            return np.asarray((white + np.tensordot(picks.T, means, 1)).reshape(-1, *table.shape[2:]))

        return whiten

    def log_determinant(self, session: Integers, along: Floats) -> float:
        """Compute ln |Σ| of the runs of `session` (n,); see `Regression` for `along`."""
        sizes = averaging_rows(session, along)[1]
        ratio = np.broadcast_to(self.session_ratio, len(self.run_covariance))
        of_runs = len(session) * np.linalg.slogdet(self.run_covariance)[1]
        return float(of_runs + np.log1p(sizes[:, None] * ratio).sum())


class Regression:
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
        completion: Floats | None = None,
        declared: Floats | None = None,
        along: Floats | None = None,
    ):
        """Multiply the columns with each other.

        Args:
            columns: (n, k, m).
            precision: 1/σ² of the priors of the first p columns, 0 for those that are free, (p,).
            session: (n,) numbers of the runs' sessions.
            scale: (n,) roots of the weights of the runs.
            repeated: what tells repeats, see `Runs.repeats`; needed for the residuals' own S.
            completion: (n, k, k) of runs with gaps, see `statistical_model`; acts on what is drawn.
            declared: S, (k, k), where it need not be estimated; NaN for outputs of which it must.
            along: (n,) what a shift of all runs of a session is in each run, times `scale`; default: `scale`.
        """
        n, k, m = columns.shape
        self.precision, self.repeated, self.completion, self.declared = precision, repeated, completion, declared
        self.session = np.unique(session, return_inverse=True)[1].reshape(-1)
        self.scale = np.ones(n) if scale is None else scale
        self.along = self.scale if along is None else along
        self.picks, self.sizes = averaging_rows(session, self.along)
        self.columns = columns * self.scale[:, None, None]
        self._flat = self.columns.reshape(n * k, m)
        self.means = self.average(self.columns)  # (s, k, m)
        whole = np.einsum("nim,njl->ijml", self.columns, self.columns, optimize=True)
        self._whole = whole.reshape(k * k, m * m)

    def seen(self, columns: Floats, along: Floats) -> Regression:
        """Return the regression of the same runs with other columns (n, k, m), and shifts of sessions."""
        return Regression(
            columns, self.precision, self.session, self.scale, self.repeated, self.completion, self.declared, along
        )

    def average(self, table: Floats) -> Floats:
        """Average each session, times the root of its size, (s, ...), of (n, ...)."""
        return np.asarray(np.tensordot(self.picks, table, 1))

    def shrink(self, table: Floats, session_ratio: Floats) -> Floats:
        """Whiten runs (B, n, k) in Σ that are white in S, with ρ (B, k)."""
        less = 1 / np.sqrt(1 + session_ratio[:, None, :] * self.sizes[:, None]) - 1  # (B, s, k)
        return np.asarray(table + self.picks.T @ (less * (self.picks @ table)))

    def noise(self, residual: Floats) -> Floats:
        """Estimate S (..., k, k) of residuals (..., n, k)."""
        if self.declared is not None and not np.isnan(self.declared).any():
            return np.broadcast_to(self.declared, (*residual.shape[:-2], *self.declared.shape))
        assert self.repeated is not None
        if self.declared is None:
            return repeat_covariance(residual, self.repeated, self.scale)
        unknown = np.isnan(self.declared)
        rows = self._measured[:, np.diag(unknown)].any(1)
        run_covariance = repeat_covariance(residual[..., rows, :], self.repeated[rows], self.scale[rows])
        return np.where(unknown, run_covariance, self.declared)

    @cached_property
    def _measured(self) -> Flags:
        """Which outputs of the runs were measured, (n, k)."""
        if self.completion is None:
            return np.ones(self.columns.shape[:2], dtype=bool)
        return np.asarray(np.diagonal(self.completion, axis1=1, axis2=2) != 0)

    @cached_property
    def _scattering(self) -> Flags:
        """Which outputs a shift of a session reaches, (k,); all where it reaches none."""
        reached = self._measured[self.along != 0].any(0)
        return np.asarray(reached if reached.any() else ~reached)

    def products(
        self, residual: Floats, run_covariance: Floats | None = None, change: Floats | None = None
    ) -> NormalEquations:
        """Multiply the columns, and a residual behind them, with each other, with the priors.

        Args:
            residual: (..., n, k).
            run_covariance: S, (k, k) or (..., k, k); default: that of each residual.
            change: of the parameters with which the residual was computed from those as given (p,); default 0.
        """
        root = inverse_root(self.noise(residual) if run_covariance is None else run_covariance)
        precision = np.swapaxes(root, -1, -2) @ root
        (*batch, n, k), m = residual.shape, self.means.shape[-1]
        residual = residual * self.scale[:, None]
        weighted, white_means = residual @ precision, self.picks @ (residual @ np.swapaxes(root, -1, -2))
        of_columns = np.einsum("...ak,skm->...sam", root, self.means, optimize=True)
        of_columns = np.broadcast_to(of_columns, (*batch, *of_columns.shape[-3:]))
        means = np.concatenate([of_columns, white_means[..., None]], -1)
        flat, total = precision.reshape(*precision.shape[:-2], k * k), np.empty((*batch, m + 1, m + 1))
        total[..., :m, :m] = (flat @ self._whole).reshape(*flat.shape[:-1], m, m)
        total[..., m, :m] = total[..., :m, m] = weighted.reshape(*batch, n * k) @ self._flat
        total[..., m, m] = (weighted * residual).sum((-1, -2))
        own = np.arange(len(self.precision))
        total[..., own, own] += self.precision
        if change is not None:
            total[..., own, m] -= self.precision * change
            total[..., m, own] -= self.precision * change
            total[..., m, m] += (self.precision * change**2).sum()
        means = means.reshape(*batch, -1, m + 1)
        return NormalEquations(total - np.swapaxes(means, -1, -2) @ means, means, self.sizes, self._scattering)

    def draw(
        self, rng: np.random.Generator, run_covariance: Floats, session_ratio: Floats, spread: Floats | None = None
    ) -> Floats:
        """Draw residuals (B, n, k) from the parameters as given: noise of runs and sessions, and the parameters.

        Args:
            run_covariance: S (k, k).
            session_ratio: (B, k) ρ of each table.
            spread: (p, p) root of the covariance of the first p parameters; default: that of the priors.
        """
        count, (n, k, _), p = len(session_ratio), self.columns.shape, len(self.precision)
        noise = rng.normal(size=(count, n, k)) / self.scale[:, None]
        shifts = rng.normal(size=(count, len(self.sizes), k))[:, self.session]
        noise += np.sqrt(session_ratio)[:, None, :] * shifts * (self.along / self.scale)[:, None]
        if spread is None:
            known = self.precision > 0
            spread = np.diag(np.where(known, 1 / np.sqrt(np.where(known, self.precision, 1.0)), 0.0))
        change = rng.normal(size=(count, p)) @ spread.T
        J = self.columns[..., :p] / self.scale[:, None, None]
        axes = np.linalg.inv(inverse_root(run_covariance))
        noise = noise @ axes.T
        if self.completion is not None:
            noise = np.einsum("nab,Bnb->Bna", self.completion, noise)
        return np.asarray(noise + np.einsum("nkp,bp->bnk", J, change, optimize=True))


@dataclass(frozen=True)
class LeastSquares:
    """Generalised least squares of the last column by the others; `...` stands for batches."""

    step: Floats  # (..., p)
    covariance: Floats  # (..., p, p) with the scatter of sessions in full
    session_ratio: Floats  # (..., k) ρ


@dataclass(frozen=True)
class NormalEquations:
    """Products of columns within sessions, and the sessions' means, for any ρ; `...` stands for batches."""

    within: Floats  # (..., m, m)
    means: Floats  # (..., s k, m) white in S, times the roots of the sizes
    sizes: Floats  # (s,) runs of a session, or their weights
    scattering: Flags  # (k,) outputs that a shift of a session reaches

    @property
    def outputs(self) -> int:
        return len(self.scattering)

    @property
    def sessions(self) -> int:
        """Number of sessions that may shift their runs; of all where none may."""
        return int(np.count_nonzero(self.sizes > _NOTHING)) or len(self.sizes)

    def at(self, session_ratio: Floats | float) -> Floats:
        """Compute columnᵀ Σ⁻¹ column, (..., m, m), for ρ (..., k)."""
        weighted = self._weights(np.asarray(session_ratio))[..., None] * self.means
        return np.asarray(self.within + np.swapaxes(self.means, -1, -2) @ weighted)

    def _weights(self, session_ratio: Floats) -> Floats:
        """Compute 1/(1 + ρ n) of the means, (..., s k)."""
        session_ratio = np.broadcast_to(session_ratio, (*session_ratio.shape[:-1], self.outputs))
        weights = 1 / (1 + session_ratio[..., None, :] * self.sizes[:, None])
        return np.asarray(weights.reshape(*session_ratio.shape[:-1], len(self.sizes) * self.outputs))

    def for_fit(self, session_ratio: Floats | float) -> tuple[Floats, Floats]:
        """Compute columnᵀ W column, and columnᵀ W Σ W column, (..., m, m), for ρ (..., k)."""
        session_ratio = np.asarray(session_ratio)
        weights = self._weights(session_ratio)[..., None]
        of_fit = self._weights(np.where(self.estimated, session_ratio, 0.0))[..., None]
        rest = self._about_common(self.means)
        seen = self.means - rest + self._about_common(of_fit * rest)
        transposed = np.swapaxes(seen, -1, -2)
        return self.within + np.swapaxes(self.means, -1, -2) @ seen, self.within + transposed @ (seen / weights)

    @cached_property
    def estimated(self) -> Flags:
        """Axes (..., k) of which ρ is estimated: a fit at ρ = 0 leaves their means about the common one free."""
        columns = self._about_common(self.means)[..., :-1]
        covariance = self._without_scatter[1]
        taken = ((columns @ covariance) * columns).sum(-1)
        return np.asarray(self.sessions - 1 - self._of_outputs(taken) > _LEAST_FREEDOM)

    @cached_property
    def _without_scatter(self) -> tuple[Floats, Floats]:
        """Solve for the coefficients (..., p) at ρ = 0; with their covariance (..., p, p)."""
        return solve_normal(self.at(0.0))

    def _of_outputs(self, means: Floats) -> Floats:
        """Add up what is stated for each session and output (..., s k), to (..., k)."""
        return np.asarray(means.reshape(*means.shape[:-1], len(self.sizes), self.outputs).sum(-2))

    def _mean(self, of_axes: Floats) -> Floats:
        """Take the mean over the axes that scatter, (..., k) to (..., 1)."""
        return np.asarray(of_axes[..., self.scattering].mean(-1, keepdims=True))

    def _about_common(self, means: Floats) -> Floats:
        """Take the mean over all sessions from their means (..., s k, m), for each output."""
        each = means.reshape(*means.shape[:-2], len(self.sizes), self.outputs, means.shape[-1])
        along = np.sqrt(self.sizes / max(self.sizes.sum(), _NOTHING))
        common = np.einsum("s,...skm->...km", along, each)
        return np.asarray((each - along[:, None, None] * common[..., None, :, :]).reshape(means.shape))

    def determinant(self, session_ratio: Floats) -> Floats:
        """Compute ln |Σ|/|S ⊗ I|, (...), for ρ (..., k)."""
        return np.asarray(-np.log(self._weights(session_ratio)).sum(-1))

    def take(self, columns: Integers) -> NormalEquations:
        """Choose columns (c, q), (..., c, q, q)."""
        rows, cols = columns[:, :, None], columns[:, None, :]
        means = np.moveaxis(self.means[..., columns], -3, -2)
        return NormalEquations(self.within[..., rows, cols], means, self.sizes, self.scattering)

    def solve(self, *, passes: int) -> LeastSquares:
        """Fit the last of the columns with the weights W, and ρ of its residuals after `passes` iterations."""
        session_ratio = self.session_ratio(passes=passes)
        return LeastSquares(
            solve_normal(self.for_fit(session_ratio)[0])[0], self.covariance(session_ratio), session_ratio
        )

    def covariance(self, session_ratio: Floats) -> Floats:
        """Compute the covariance (..., p, p) of a fit of the last column with the weights W, for ρ (..., k)."""
        weighted, scattered = self.for_fit(session_ratio)
        inverse = solve_normal(weighted)[1]
        return np.asarray(inverse + inverse @ (scattered - weighted)[..., :-1, :-1] @ inverse)

    def session_ratio(self, *, passes: int) -> Floats:
        """Estimate ρ (..., k) from the residuals of a fit of the last column, after `passes` iterations from 0.

        The scatter of the sessions' means along an axis about their common mean m is expected to be

            Σ_s n_s (m_s − m)² = (1 − h/(s − 1)) (s − 1 + ρ (N − Σ_s n_s²/N)),   N = Σ_s n_s,

        where h of their s − 1 degrees of freedom are used by the fit.
        """
        freedom, k, batch = self.sessions - 1, self.outputs, self.within.shape[:-2]
        session_ratio = np.zeros((*batch, k))
        if not passes:
            return session_ratio
        means, total = self._about_common(self.means), max(float(self.sizes.sum()), _NOTHING)
        columns = means[..., :-1]
        for count in range(passes if freedom else 0):
            step, covariance = solve_normal(self.at(session_ratio)) if count else self._without_scatter
            between = (means[..., -1] - (columns @ step[..., None])[..., 0]) ** 2
            used = ((columns @ covariance) * columns).sum(-1) * self._weights(session_ratio)
            each, taken = self._of_outputs(between), self._of_outputs(used)
            own, common = (
                scatter / np.maximum(k_left, 0.1) - freedom
                for scatter, k_left in (
                    (each, 1 - taken / freedom),
                    (self._mean(each), 1 - self._mean(taken) / freedom),
                )
            )
            session_ratio = np.clip(
                (own + common) / 2 / max(total - float((self.sizes**2).sum()) / total, _NOTHING),
                0.0,
                _MOST_SCATTER,
            )
        return np.where(self.estimated, session_ratio, UNKNOWN_RATIO)


def solve_normal(normal: Floats) -> tuple[Floats, Floats]:
    """Solve for the coefficients (..., p) of the last of the columns; with their covariance (..., p, p)."""
    covariance = _inverse(normal[..., :-1, :-1])
    return (covariance @ normal[..., :-1, -1:])[..., 0], covariance


def schur_complement(normal: Floats, count: int) -> Floats:
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


def inverse_root(run_covariance: Floats) -> Floats:
    """Return A⁻¹ = C^−½ V^−½ of S = A Aᵀ, (..., k, k)."""
    deviation = np.sqrt(np.diagonal(run_covariance, axis1=-2, axis2=-1))
    values, vectors = np.linalg.eigh(run_covariance / deviation[..., :, None] / deviation[..., None, :])
    root = (vectors / np.sqrt(values)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return np.asarray(root / deviation[..., None, :])


def square_root(covariance: Floats) -> Floats:
    """Return the Cholesky factor (p, p), also where rounding leaves a covariance indefinite."""
    deviation = np.sqrt(np.diagonal(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(deviation, deviation))
    half = deviation[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    lower = np.asarray(np.linalg.qr(half.T, mode="r")).T
    return np.asarray(lower * np.where(np.diag(lower) < 0, -1.0, 1.0))


def averaging_rows(session: Integers, scale: Floats | None = None) -> tuple[Floats, Floats]:
    """Make rows (s, n) that take the mean of each session times the root of its size; the sizes (s,).

    Args:
        scale: (n,) what 1 became in each run, such as the roots of the weights; their squares are the sizes.
    """
    kinds, place = np.unique(session, return_inverse=True)
    along = np.ones(len(session)) if scale is None else scale
    rows = (np.arange(len(kinds))[:, None] == place.reshape(-1)) * along
    sizes = (rows**2).sum(1)
    return rows / np.sqrt(np.maximum(sizes, _NOTHING))[:, None], sizes


def repeat_covariance(y: Floats, repeated: Integers | Floats, scale: Floats | None = None) -> Floats:
    """Estimate S (..., k, k) from the scatter of (..., n, k) between repeats, pooled; 0 without a repeat.

    Args:
        repeated: see `Runs.repeats`; each level, and each column of a design, has its own effect on y.
        scale: (n,) roots of the weights of the runs.
    """
    basis = _same_in_repeats(repeated, scale)
    y = y if scale is None else y * scale[:, None]
    centred = y - basis @ (basis.T @ y)
    return np.asarray(np.swapaxes(centred, -1, -2) @ centred / max(len(basis) - basis.shape[1], 1))


def repeat_count(repeated: Integers | Floats) -> int:
    """Count the degrees of freedom of `repeat_covariance`."""
    if repeated.ndim == 1:
        return len(repeated) - len(np.unique(repeated))
    basis = _same_in_repeats(repeated, None)
    return len(basis) - basis.shape[1]


def _same_in_repeats(repeated: Integers | Floats, scale: Floats | None) -> Floats:
    """Return an orthonormal basis (n, r) of what is no noise, times the roots of the weights."""
    if repeated.ndim == 1:
        return averaging_rows(repeated.astype(np.int64), scale)[0].T
    design = np.asarray(repeated if scale is None else repeated * scale[:, None], dtype=float)
    return _span(design.tobytes(), design.shape)


@lru_cache(maxsize=8)
def _span(design: bytes, shape: tuple[int, ...]) -> Floats:
    """Return an orthonormal basis of the columns of a design: a table has few, which are asked for often."""
    left, values, _ = np.linalg.svd(np.frombuffer(design).reshape(shape), full_matrices=False)
    return np.asarray(left[:, values > 1e-9 * values[0]])
