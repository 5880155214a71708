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

from calibration.statistics.gls import SESSION_SHARE, Gls, inverse_root
from sim.arrays import Floats, Integers

_SHARES = 9  # values of ρ at which the deviance is computed
_AT_ONCE = 25  # residuals
_RIDGE = 1e-11  # so that columns without any signal get a large variance
_ABSORBED = 1e-9  # share of a column below which what is left of it is rounding
_SMALLEST = 1e-280  # pivot


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
        repeated: Integers | Floats,
        *,
        scale: Floats | None = None,
        further: Sequence[int] = (),
    ):
        """Multiply the columns with each other.

        Args:
            absorbed: J, (n, k, p).
            precision: 1/σ² of their priors, 0 for those that are free, (p,).
            columns: (n, k, P, v) of P places.
            models: place and columns of each.
            session: (n,) numbers of the runs' sessions.
            repeated: what tells repeats, see `Runs.repeats`.
            scale: (n,) roots of the weights of the runs; default 1.
            further: parameters that a model has beside its columns; default none.
        """
        n, k, self.p = absorbed.shape
        self.absorbed, self.columns, self.models = absorbed, columns, tuple(models)
        self.without = Gls(absorbed, precision, session, scale, repeated)
        self._further = np.array(further if len(further) else [0] * len(self.models))
        self._places, self._count = columns.shape[2:]
        self._picks, self._sizes = self.without.picks, self.without.sizes
        whole = math.log1p(SESSION_SHARE * self._sizes.mean())
        self._levels = np.linspace(0.0, whole, _SHARES) if len(self._sizes) > 1 else np.array([whole])
        shares = np.expm1(self._levels) / self._sizes.mean()
        table = np.concatenate([absorbed, columns.reshape(n, k, -1)], -1) * self.without.scale[:, None, None]
        less = 1 / (1 + shares[:, None] * self._sizes) - 1  # (g, s)
        self._less = less
        means = np.tensordot(self._picks, table, 1)
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
        base = _Minimum.of(without + log_determinant)
        count, models = len(residual), len(self.models)
        gain, share = np.empty((models, count)), np.empty((models, count))
        weights, errors = np.zeros((models, self._count, count)), np.full((models, self._count, count), np.inf)
        for q in sorted({len(chosen) for _, chosen in self.models}):
            which = np.array([i for i, (_, chosen) in enumerate(self.models) if len(chosen) == q])
            place = np.array([self.models[i][0] for i in which])
            chosen = np.array([self.models[i][1] for i in which]).T  # (q, models)
            toward = b[chosen, place]  # (q, models, g, b)
            inverse, step, log_own = _swept(C[chosen[:, None], chosen, place], toward)
            deviance = without - (step * toward).sum(0)
            minimum = _Minimum.of((deviance + log_determinant + log_own).swapaxes(0, 1))
            least = minimum.value(deviance.swapaxes(0, 1))
            parameters = q + self._further[which, None]
            gain[which] = base.value(without) - least - parameters * math.log(residual[0].size)
            share[which] = self._share(minimum)
            for place_of_weight, column in enumerate(chosen):
                weights[which, column] = minimum.value(step[place_of_weight].swapaxes(0, 1))
                variance = minimum.value(inverse[place_of_weight, place_of_weight].swapaxes(0, 1))
                errors[which, column] = np.sqrt(np.maximum(variance, 0.0))
        weights, errors = np.moveaxis(weights, -1, 0), np.moveaxis(errors, -1, 0)
        return LinearFits(gain.T, weights, errors, share.T, self._share(base))

    def _share(self, minimum: _Minimum) -> Floats:
        """Compute ρ at minima."""
        levels = np.interp(minimum.middle + minimum.fraction, np.arange(len(self._levels)), self._levels)
        return np.asarray(np.expm1(levels) / self._sizes.mean())

    def _absorb(self, residual: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Absorb J at every ρ.

        Returns:
            C (v, v, P, g, b), b (v, P, g, b), and without a place the deviance and ln |A| (g, b).
        """
        count, _, k = residual.shape
        p, places, columns = self.p, self._places, self._count
        root = inverse_root(self.without.noise(residual))
        residual = residual * self.without.scale[:, None]
        inverse = np.swapaxes(root, -1, -2) @ root
        flat = inverse.reshape(count, k * k)
        of_absorbed, across, own = (flat @ part for part in self._products)  # (g, b, ...)
        A = of_absorbed.reshape(-1, count, p, p) + np.diag(self.without.precision)
        across = across.reshape(-1, count, p, places * columns)
        weighted = residual @ inverse
        toward = weighted.reshape(count, -1) @ self._weighted  # (g, b, p + P v)
        means, weighted_means = self._picks @ residual, self._picks @ weighted  # (b, s, k)
        square = (weighted * residual).sum((1, 2)) + self._less @ (means * weighted_means).sum(-1).T
        covariance = np.linalg.inv(A)
        step = (covariance @ toward[..., :p, None])[..., 0]
        left = toward[..., p:] - (step[..., None, :] @ across)[..., 0, :]
        solution = (covariance @ across).reshape(-1, count, p, places, columns).transpose(0, 1, 3, 2, 4)
        by_place = across.reshape(-1, count, p, places, columns).transpose(0, 1, 3, 4, 2)
        own = own.reshape(-1, count, places, columns, columns)
        own[..., range(columns), range(columns)] *= 1 + _RIDGE
        C = own - by_place @ solution
        same = range(columns)
        C[..., same, same] = np.maximum(C[..., same, same], _ABSORBED * own[..., same, same])
        C = np.ascontiguousarray(C.transpose(3, 4, 2, 0, 1))
        b = np.ascontiguousarray(left.reshape(-1, count, places, columns).transpose(3, 2, 0, 1))
        deviance = square - (step * toward[..., :p]).sum(-1) + self._determinant[:, None]
        return C, b, deviance, np.linalg.slogdet(A)[1]


def _swept(normal: Floats, toward: Floats) -> tuple[Floats, Floats, Floats]:
    """Invert small matrices (q, q, ...) and solve for (q, ...), all at once, by sweeps (Goodnight 1979).

    Returns:
        The inverses (q, q, ...), the solutions (q, ...) and the logarithms of the determinants (...).
    """
    table = np.concatenate([normal, toward[:, None]], 1)
    log_determinant = np.zeros(toward.shape[1:])
    for k in range(len(table)):
        pivot = np.maximum(table[k, k], _RIDGE * normal[k, k] + _SMALLEST)  # above rounding
        log_determinant += np.log(pivot)
        table[k, k] = 1.0
        table[k] /= pivot
        for i in range(len(table)):
            if i != k:
                factor = table[i, k].copy()
                table[i, k] = 0.0
                table[i] -= factor * table[k]
    return table[:, :-1], table[:, -1], log_determinant


@dataclass(frozen=True)
class _Minimum:
    """Where a function of ρ is smallest: between the ρ at `middle` − 1 and those at `middle` + 1."""

    middle: Integers  # (...)
    fraction: Floats  # (...) of the step between two ρ, from `middle`

    @classmethod
    def of(cls, values: Floats) -> _Minimum:
        """Find the minimum of the parabola through three values (g, ...)."""
        if len(values) == 1:
            return cls(np.zeros(values.shape[1:], dtype=np.int64), np.zeros(values.shape[1:]))
        middle = np.clip(values.argmin(0), 1, len(values) - 2)
        low, centre, high = _neighbours(values, middle)
        curvature = np.maximum(low - 2 * centre + high, 1e-12)
        return cls(middle, np.clip((low - high) / (2 * curvature), -1.0, 1.0))

    def value(self, values: Floats) -> Floats:
        """Interpolate values (g, ..., further axes) there, by the parabola through three of them."""
        if len(values) == 1:
            return values[0]
        low, centre, high = _neighbours(values, self.middle)
        t = self.fraction.reshape(self.fraction.shape + (1,) * (centre.ndim - self.fraction.ndim))
        return np.asarray(centre + t * (high - low) / 2 + t**2 * (low - 2 * centre + high) / 2)


def _neighbours(values: Floats, middle: Integers) -> tuple[Floats, Floats, Floats]:
    """Take the values (g, ...) before, at and after the places `middle`."""
    others = np.indices(middle.shape, sparse=True)
    return values[(middle - 1, *others)], values[(middle, *others)], values[(middle + 1, *others)]
