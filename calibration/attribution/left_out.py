"""What left-out runs say: each is predicted from the other sessions, by one linear step, and gains are paired.

Numbers of a group, such as the start of a trace, are known to the other runs with a covariance C, which is large
where these hardly know them. So white residuals r become (1 + J C Jᵀ)^−½ r, with their derivatives J.

Two gains share the runs without either model, so their own standard errors say nothing about which one is larger.
So two models are compared by the difference of the log likelihoods, paired over conditions: with C conditions of
differences D_c,

    D = Σ_c D_c,   σ_D² = C Var D_c,

and the models are as good as each other while D ≤ t σ_D, with the 97.5 % quantile t of Student's distribution of
C − 1 degrees of freedom: a few conditions prove little.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from calibration.linear.gls import Noise, solve_normal
from calibration.statistics.fit import Fit
from calibration.statistics.signed_ranks import signed_rank_p
from calibration.statistics.study import Study, leave_one_group_out
from common.arrays import Floats, Integers

_QUANTILE = 0.975


class PairedGain(NamedTuple):
    """By how much a model predicts left-out runs better than another one, in log likelihood."""

    of_conditions: Floats  # (c,)

    @property
    def gain(self) -> float:
        return float(self.of_conditions.sum())

    @property
    def error(self) -> float:
        """Standard error, over conditions."""
        count = len(self.of_conditions)
        return float(self.of_conditions.std(ddof=1)) * math.sqrt(count) if count > 1 else math.inf

    @property
    def certain(self) -> bool:
        """Whether its 95 % interval is above zero."""
        return self.gain > float(stdtrit(max(len(self.of_conditions) - 1, 1), _QUANTILE)) * self.error

    @property
    def consistent(self) -> bool:
        """Whether conditions gain, by a signed-rank test: one that gains far more than others proves no less."""
        some = self.of_conditions[self.of_conditions != 0]
        return len(some) > 1 and signed_rank_p(some) < 1 - _QUANTILE


def paired_gain(study: Study, one: Fit, other: Fit) -> PairedGain:
    """Compare the predictions of `one` with those of `other`, in the noise of `one`."""
    return gain_of_residuals(study, *left_out_residuals(study, other, one))


def gain_of_residuals(study: Study, before: Floats, after: Floats, b: float = 1.0) -> PairedGain:
    """Compare two left-out residuals, in the noise b S."""
    rows = left_out_rows(study)
    gains = ((before**2 - after**2) / (2 * b)).reshape(len(rows), -1).sum(1)
    condition = np.unique(study.model.runs.resampled[rows], return_inverse=True)[1].reshape(-1)
    return PairedGain(np.asarray(np.bincount(condition, weights=gains), dtype=float))


def session_gain(study: Study, base: Fit, refit: Fit) -> tuple[float, float]:
    """Sum the gain in log likelihood over left-out sessions, with its standard error (linearised refits).

    With whitened residuals r of the refit and r + d of the base, a session gains ½|d|² + d·r, |d| of it by noise.
    """
    before, after = left_out_residuals(study, base, refit)
    return float(before @ before - after @ after) / 2, float(np.linalg.norm(before - after))


def left_out_residuals(study: Study, base: Fit, refit: Fit) -> tuple[Floats, Floats]:
    """Compute `left_out_residual` of the base and of the refit, both in the noise of the refit."""
    return left_out_residual(study, base, refit.noise), left_out_residual(study, refit, refit.noise)


def left_out_residual(study: Study, fitted: Fit, noise: Noise) -> Floats:
    """Whiten the residual of all fitted runs, in the order of `left_out_rows`, each from the other sessions."""
    data, parts = study.model.runs, []
    for learn, out in leave_one_group_out(data, study.split.fitted):
        step, covariance = solve_normal(fitted.normal_of_fit(data, learn, noise))
        predicted = (data.y - fitted.prediction)[out] - fitted.tangents[out] @ step
        whiten = noise.whitener(data.session[out], data.scale[out], data.along[out])
        white, own = whiten(predicted), [place for place, p in enumerate(fitted.fitted) if p.of_group]
        if own:
            slopes = whiten(fitted.tangents[out][..., own])
            white = _known_so_well(white, slopes, covariance[np.ix_(own, own)])
        parts.append(white)
    return np.concatenate(parts)


def _known_so_well(white: Floats, slopes: Floats, covariance: Floats) -> Floats:
    """Multiply a white residual (m,) by (1 + J C Jᵀ)^−½, with slopes J (m, q) and C (q, q)."""
    sizes = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    variances, axes = np.linalg.eigh(covariance / np.outer(sizes, sizes))
    spread = slopes @ (sizes[:, None] * axes * np.sqrt(np.maximum(variances, 0.0)))
    vectors, spreads, _ = np.linalg.svd(spread, full_matrices=False)
    return np.asarray(white + vectors @ ((1 / np.sqrt(1 + spreads**2) - 1) * (vectors.T @ white)))


def left_out_rows(study: Study) -> Integers:
    """Return the places of the runs of a left-out residual."""
    left_out = leave_one_group_out(study.model.runs, study.split.fitted)
    return np.concatenate([np.flatnonzero(out) for _, out in left_out])


def left_out_error(study: Study, fitted: Fit) -> float:
    """Compute the relative rms error on left-out runs, in the noise of the fit."""
    white = left_out_residual(study, fitted, fitted.noise)
    return math.sqrt(float((white**2).mean())) * fitted.noise.rms
