"""Noise of a table: scatter of the repeats, and of the sessions.

Runs under the same condition give the covariance S (k, k) of one run's outputs, jointly: R_yr and θ are not
independent of the spins and the yaw rate. A session may shift all its runs together; its variance τ² per
output is what the sessions' mean residuals scatter beyond S/n. Repeats within a session do not average that
shift away, so the covariance of a session's n runs is

    Σ = I_n ⊗ S + 1 1ᵀ ⊗ diag(τ²).

τ² comes from the residuals of the fitted model, so an effect that the model lacks inflates it. It is
therefore held below `SESSION_SHARE` of a run's variance: sessions are taken to scatter no more than single
runs do, and a larger shift of a whole session counts as something that the model must explain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SESSION_SHARE = 1.0  # largest τ² in units of the variance of one run

Floats = NDArray[np.float64]
Labels = NDArray[np.int64]


@dataclass(frozen=True)
class Noise:
    """S (k, k) of a run and τ² (k,) of a session."""

    run: Floats
    session: Floats

    def whitener(self, session: Labels) -> _Whitener:
        return _Whitener(self, session)


class _Whitener:
    """Σ^−½ for the runs of `session`; applies to residuals (n, k, ...) and flattens them."""

    def __init__(self, noise: Noise, session: Labels):
        chol = np.linalg.cholesky(noise.run)
        self._inverse = np.linalg.inv(chol)
        block = self._inverse @ np.diag(noise.session) @ self._inverse.T
        self._values, self._vectors = np.linalg.eigh(block)
        self._values = np.maximum(self._values, 0)
        self._groups = [np.flatnonzero(session == s) for s in np.unique(session)]

    def __call__(self, table: Floats) -> Floats:
        """Whiten (n, k, ...) to (n k, ...)."""
        white = np.einsum("ab,nb...->na...", self._vectors.T @ self._inverse, table)
        for rows in self._groups:
            mean = white[rows].mean(0)
            shrink = 1 / np.sqrt(1 + len(rows) * self._values) - 1
            white[rows] += shrink.reshape(-1, *[1] * (white.ndim - 2)) * mean
        return np.asarray(white.reshape(-1, *table.shape[2:]))


def repeat_covariance(y: Floats, condition: Labels) -> Floats:
    """S from the scatter about the mean of each condition, pooled."""
    centred, freedom = centre_on_conditions(y, condition)
    return np.asarray(centred.T @ centred / freedom)


def centre_on_conditions(y: Floats, condition: Labels) -> tuple[Floats, int]:
    """Residuals from the condition means, and their degrees of freedom."""
    places = np.unique(condition, return_inverse=True)[1].reshape(-1)
    count = np.bincount(places)
    mean = np.stack([np.bincount(places, y[:, i]) / count for i in range(y.shape[1])], 1)
    return y - mean[places], len(y) - len(count)


def session_variance(residual: Floats, session: Labels, run: Floats) -> Floats:
    """τ² per output from the mean residuals of the sessions (moment estimate, within its limits)."""
    groups = [residual[session == s] for s in np.unique(session)]
    means = np.array([g.mean(0) for g in groups])
    within = np.mean([np.diag(run) / len(g) for g in groups], 0)
    return np.clip((means**2).mean(0) - within, 0.0, SESSION_SHARE * np.diag(run))
