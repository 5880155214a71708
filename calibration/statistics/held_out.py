"""Held-out runs: the errors of a model on them, its agreement with them, and the final refit to all runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm as normal
from scipy.stats import t as student

from calibration.statistics.fit import Fit
from calibration.statistics.statistical_model import (
    ForwardModel,
    Linear,
    Parameter,
    Runs,
    inverse_root,
    least_squares,
    repeat_count,
    stepped,
    sums,
    with_prior,
)
from sim.arrays import Flags, Floats

_DRAWS = 2000


def errors(data: Runs, prediction: Floats, rows: Flags) -> tuple[float, dict[str, float]]:
    """Compute the relative rms over runs and outputs (θ in rad), and per output; each run by its weight.

    The residual of a run counts as √w times itself, which noise alone makes as large as S says.
    """
    square = _scaled_square(data, prediction, rows).mean(0)
    each = dict(zip(data.outputs, np.sqrt(square).tolist(), strict=True))
    return float(np.sqrt(square.mean())), each


def error_interval(data: Runs, prediction: Floats, rows: Flags, seed: int) -> tuple[float, float]:
    """Estimate the 95 % interval of the relative rms by resampling conditions."""
    square = _scaled_square(data, prediction, rows).mean(1)
    condition = data.condition[rows]
    kinds = np.unique(condition)
    means = np.array([square[condition == c].mean() for c in kinds])
    rng = np.random.default_rng(seed)
    drawn = np.sqrt(means[rng.integers(0, len(kinds), (_DRAWS, len(kinds)))].mean(1))
    return float(np.quantile(drawn, 0.025)), float(np.quantile(drawn, 0.975))


def _scaled_square(data: Runs, prediction: Floats, rows: Flags) -> Floats:
    """Compute w r² of the runs in `rows`, (n', k)."""
    return np.asarray(((data.y - prediction) * data.scale[:, None])[rows] ** 2)


def held_out_p_value(fitted: Fit, data: Runs, rows: Flags, *, seed: int) -> float:
    """Estimate the probability that noise alone puts the held-out runs `rows` (n,) as far from the model.

    The statistic is the sum of squares of the residual, whitened by S. Its null distribution is drawn with the
    noise of runs and sessions, the error of the fitted parameters, and the uncertainty of S.
    """
    root = inverse_root(fitted.noise.run)
    scale = data.scale[rows, None]
    residual = scale * (data.y - fitted.prediction)[rows] @ root.T
    J = scale[..., None] * (root @ fitted.jacobian[rows])
    rng = np.random.default_rng(seed)
    sessions = np.unique(data.session[rows], return_inverse=True)[1].reshape(-1)
    n, k = residual.shape
    freedom = max(repeat_count(data.repeats(~rows)), k + 1)
    spread = np.linalg.cholesky(fitted.covariance + 1e-15 * np.diag(np.diag(fitted.covariance)))
    count = 0
    for _ in range(_DRAWS):
        drawn = rng.normal(size=(n, k))
        drawn += scale * np.sqrt(fitted.noise.share) * rng.normal(size=(sessions.max() + 1, k))[sessions]
        drawn += J @ (spread @ rng.normal(size=len(spread)))
        repeats = rng.normal(size=(freedom, k))
        drawn = drawn @ inverse_root(repeats.T @ repeats / freedom).T
        count += float((drawn**2).sum()) >= float((residual**2).sum())
    return (1 + count) / (1 + _DRAWS)


def one_step(data: Runs, fitted: Fit, rows: Flags) -> Linear:
    """Compute the linear step that fits a fitted model to other runs, those in `rows` (n,), with its priors."""
    table = np.concatenate([fitted.jacobian, (data.y - fitted.prediction)[..., None]], -1)
    root = inverse_root(fitted.noise.run)
    products = sums(root @ table[rows], data.session[rows], len(root), data.scale[rows])
    return least_squares(with_prior(products, fitted.fitted, fitted.parameters), passes=3)


@dataclass(frozen=True)
class FinalRefit:
    """The model that is handed on: fitted to all runs."""

    parameters: dict[str, float]  # name -> value
    fitted: tuple[Parameter, ...]  # those that were fitted
    covariance: Floats  # (p, p); a 95 % interval is 1.96 standard deviations to each side


def refit_to_all(model: ForwardModel, fitted: Fit, rows: Flags, *, moved: bool = True) -> FinalRefit:
    """Fit a fitted model to all runs in `rows` by one linear step; without the step if not `moved`.

    The covariance allows for the estimates of S and ρ, as the intervals of the fit do.
    """
    refit = one_step(model.runs, fitted, rows)
    step = refit.step if moved else np.zeros_like(refit.step)
    at = replace(
        fitted,
        parameters=stepped(fitted.fitted, fitted.parameters, step),
        covariance=fitted.inflation * refit.covariance,
    )
    return final_refit(at)


def final_refit(fitted: Fit) -> FinalRefit:
    """Hand on a fit to all runs; its intervals, those of Student's t, become those of a normal distribution."""
    wider = student.ppf(0.975, fitted.freedom) / normal.ppf(0.975)
    return FinalRefit(fitted.parameters, fitted.fitted, fitted.covariance * np.outer(wider, wider))
