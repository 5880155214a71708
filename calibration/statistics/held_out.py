"""Held-out runs: the errors of a model on them, its agreement with them, and the final refit to all runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm as normal
from scipy.stats import t as student

from calibration.statistics.fit import Fit
from calibration.statistics.gls import Gls, inverse_root, repeat_count
from calibration.statistics.statistical_model import ForwardModel, Parameter, Runs, stepped
from sim.arrays import Flags, Floats

_DRAWS, _AT_ONCE = 2000, 50


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
    root, scale, rng = inverse_root(fitted.noise.run), data.scale[rows, None], np.random.default_rng(seed)
    residual = scale * (data.y - fitted.prediction)[rows] @ root.T
    freedom = max(repeat_count(data.repeats(~rows)), len(root) + 1)
    linear = Gls(fitted.jacobian[rows], np.zeros(len(fitted.names)), data.session[rows], data.scale[rows])
    spread = np.asarray(np.linalg.cholesky(fitted.covariance + 1e-15 * np.diag(np.diag(fitted.covariance))))
    as_far = 0
    for _ in range(_DRAWS // _AT_ONCE):
        drawn = linear.draw(rng, fitted.noise.run, np.tile(fitted.noise.share, (_AT_ONCE, 1)), spread)
        repeats = rng.normal(size=(_AT_ONCE, freedom, len(root)))
        of_repeats = inverse_root(np.swapaxes(repeats, -1, -2) @ repeats / freedom)
        white = scale * drawn @ root.T @ np.swapaxes(of_repeats, -1, -2)
        as_far += int(np.count_nonzero((white**2).sum((-1, -2)) >= (residual**2).sum()))
    return (1 + as_far) / (1 + _DRAWS)


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
    refit = fitted.products(model.runs, rows).solve(passes=3)
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
