"""Is the residual more than noise? Lack of fit and projected scores, by one parametric bootstrap.

With W = Σ^−½ and Q = orth(W ∂f/∂C), what the coefficients absorb is projected out:

    r = (I − QQᵀ) W (y − f),   d_j = (I − QQᵀ) W ∂f/∂ε_j,   z_j = d̂_jᵀ r.

Three statistics: the χ² of the condition means (lack of fit against pure error), a kernel score rᵀ K r that looks
for smooth structure over the runs' inputs, and max |z_j| over the catalogue. Their null
distribution comes from data drawn with the fitted noise (repeats and sessions), each draw going through the
same steps: S and τ² estimated anew, coefficients refitted (linearised). So the p-values account for the
fit, for the noise being estimated, and for correlated candidates.

Source: score tests after projection, Rao (1948); kernel score, e.g. Liu, Lin, Ghosh (2007).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.fit import Fit
from calibration.model import Floats, Runs
from calibration.noise import Noise, repeat_covariance, session_variance

DRAWS = 600
TESTABLE = 0.1  # survived share of an effect's signal below which the coefficients absorb it
_FIT_PASSES = 2


@dataclass(frozen=True)
class Scores:
    """Statistics of one residual."""

    lack: float  # χ² of condition means
    kernel: float
    z: Floats  # (e,) projected score of each effect
    survived: Floats  # (e,) |d_j| / |W ∂f/∂ε_j|
    length: Floats  # (e,) |d_j|: signal per unit of the effect, in standard deviations


@dataclass(frozen=True)
class Misfit:
    """Observed statistics and their p-values."""

    scores: Scores
    lack_p: float
    kernel_p: float
    score_p: float  # of max |z|
    critical_z: float  # quantile of max |z| at the level

    @property
    def general_p(self) -> float:
        """Lack of fit by either general test (Bonferroni)."""
        return min(1.0, 2 * min(self.lack_p, self.kernel_p))

    @property
    def p_value(self) -> float:
        """Any departure: general tests and scores together (Bonferroni)."""
        return min(1.0, 2 * min(self.general_p, self.score_p))


class _Tester:
    """Fixed design of the runs used; statistics of any residual."""

    def __init__(self, data: Runs, used: NDArray[np.bool_], J: Floats, D: Floats):
        self.session, self.condition = data.session[used], data.condition[used]
        self.J, self.D = J, D
        inputs = data.inputs[used]
        spread = inputs.std(0)
        inputs = (inputs - inputs.mean(0)) / np.where(spread > 0, spread, 1.0)
        distance = ((inputs[:, None] - inputs[None]) ** 2).sum(-1)
        self.K = np.exp(-distance / 2)

    def scores(self, residual: Floats) -> tuple[Scores, Noise]:
        """Statistics of a residual (n, k) after a linear refit with its own noise."""
        run = repeat_covariance(residual, self.condition)
        noise = Noise(run, np.zeros(len(run)))
        for _ in range(_FIT_PASSES + 1):
            white = noise.whitener(self.session)
            J, r = white(self.J), white(residual)
            Q = np.linalg.qr(J)[0]
            step = np.linalg.lstsq(J, r, rcond=None)[0]
            left = residual - self.J @ step
            fitted = noise
            noise = Noise(run, session_variance(left, self.session, run))
        r = r - Q @ (Q.T @ r)
        whole = white(self.D) if self.D.shape[-1] else np.zeros((len(r), 0))
        projected = whole - Q @ (Q.T @ whole)
        size = np.linalg.norm(projected, axis=0)
        z = projected.T @ r / np.maximum(size, 1e-300)
        table = r.reshape(len(residual), -1)
        means = np.stack([np.bincount(self.condition, c) for c in table.T], 1)
        count = np.bincount(self.condition).astype(float)
        lack = float((means[count > 0] ** 2 / count[count > 0, None]).sum())
        kernel = float(np.einsum("na,nm,ma->", table, self.K, table))
        survived = size / np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
        return Scores(lack, kernel, z, survived, size), fitted


def check_misfit(
    fitted: Fit,
    data: Runs,
    used: NDArray[np.bool_],
    directions: Floats,
    *,
    level: float,
    seed: int,
    draws: int = DRAWS,
) -> Misfit:
    """Test the residual of a fit.

    Args:
        fitted: model fitted to the runs in `used`.
        directions: ∂f/∂ε of the candidates, (n, k, e), at their null; e may be 0.
        level: α of the critical |z|.
        seed: of the bootstrap.
    """
    tester = _Tester(data, used, fitted.jacobian[used], directions[used])
    observed, noise = tester.scores((data.y - fitted.prediction)[used])
    testable = observed.survived >= TESTABLE
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(noise.run)
    shifts = np.sqrt(noise.session)
    sessions = np.unique(tester.session, return_inverse=True)[1].reshape(-1)
    lack, kernel, largest = np.empty(draws), np.empty(draws), np.zeros(draws)
    for i in range(draws):
        drawn = rng.normal(size=(len(sessions), len(root))) @ root.T
        drawn += (rng.normal(size=(sessions.max() + 1, len(root))) * shifts)[sessions]
        null, _ = tester.scores(drawn)
        lack[i], kernel[i] = null.lack, null.kernel
        if testable.any():
            largest[i] = np.abs(null.z[testable]).max()
    top = float(np.abs(observed.z[testable]).max()) if testable.any() else 0.0
    return Misfit(
        scores=observed,
        lack_p=_p_value(lack, observed.lack),
        kernel_p=_p_value(kernel, observed.kernel),
        score_p=_p_value(largest, top) if testable.any() else 1.0,
        critical_z=float(np.quantile(largest, 1 - level)),
    )


def _p_value(null: Floats, observed: float) -> float:
    return float((1 + np.count_nonzero(null >= observed)) / (1 + len(null)))
