"""The locked runs: which they are, errors on them, agreement with a model. The last fit, to all runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm as normal
from scipy.stats import t as student

from calibration.statistics.fit import Fit
from calibration.statistics.forward_model import Model, Parameter, Runs, stepped
from calibration.statistics.noise import Linear, inverse_root, least_squares, sums
from calibration.statistics.priors import with_prior
from calibration.statistics.splits import groups
from sim.arrays import Flags, Floats

_DRAWS = 2000


def middle_session(data: Runs) -> Flags:
    """The runs (n,) of the middle session by name, which needs no extrapolation; a block if there are few."""
    group, names = groups(data)
    return np.asarray(group == len(names) // 2)


def errors(data: Runs, prediction: Floats, rows: Flags) -> tuple[float, dict[str, float]]:
    """Relative rms over runs and outputs (θ in rad), and per output."""
    square = ((data.y - prediction)[rows] ** 2).mean(0)
    each = dict(zip(data.outputs, np.sqrt(square).tolist(), strict=True))
    return float(np.sqrt(square.mean())), each


def error_interval(data: Runs, prediction: Floats, rows: Flags, seed: int) -> tuple[float, float]:
    """95 % interval of the relative rms by resampling conditions."""
    square = ((data.y - prediction)[rows] ** 2).mean(1)
    condition = data.condition[rows]
    kinds = np.unique(condition)
    means = np.array([square[condition == c].mean() for c in kinds])
    rng = np.random.default_rng(seed)
    drawn = np.sqrt(means[rng.integers(0, len(kinds), (2000, len(kinds)))].mean(1))
    return float(np.quantile(drawn, 0.025)), float(np.quantile(drawn, 0.975))


def locked_p_value(fitted: Fit, data: Runs, rows: Flags, *, seed: int) -> float:
    """Probability that noise alone puts the locked runs `rows` (n,) as far from the model.

    The statistic is the sum of squares of the residual, whitened by S. Its null distribution is drawn with the
    noise of runs and sessions, the error of the fitted parameters, and the uncertainty of S.
    """
    root = inverse_root(fitted.noise.run)
    residual = (data.y - fitted.prediction)[rows] @ root.T
    J = root @ fitted.jacobian[rows]
    rng = np.random.default_rng(seed)
    sessions = np.unique(data.session[rows], return_inverse=True)[1].reshape(-1)
    n, k = residual.shape
    freedom = max(len(data) - n - len(np.unique(data.condition[~rows])), k + 1)
    spread = np.linalg.cholesky(fitted.covariance + 1e-15 * np.diag(np.diag(fitted.covariance)))
    count = 0
    for _ in range(_DRAWS):
        drawn = rng.normal(size=(n, k))
        drawn += np.sqrt(fitted.noise.share) * rng.normal(size=(sessions.max() + 1, k))[sessions]
        drawn += J @ (spread @ rng.normal(size=len(spread)))
        repeats = rng.normal(size=(freedom, k))
        drawn = drawn @ inverse_root(repeats.T @ repeats / freedom).T
        count += float((drawn**2).sum()) >= float((residual**2).sum())
    return (1 + count) / (1 + _DRAWS)


def one_step(data: Runs, fitted: Fit, rows: Flags) -> Linear:
    """The linear step that fits a fitted model to other runs, those in `rows` (n,), with its priors."""
    table = np.concatenate([fitted.jacobian, (data.y - fitted.prediction)[..., None]], -1)
    products = sums(inverse_root(fitted.noise.run) @ table[rows], data.session[rows], len(fitted.noise.run))
    return least_squares(with_prior(products, fitted.fitted, fitted.parameters), passes=3)


@dataclass(frozen=True)
class Delivered:
    """The model that is handed on: fitted to all runs."""

    parameters: dict[str, float]
    fitted: tuple[Parameter, ...]
    covariance: Floats  # (p, p); a 95 % interval is 1.96 standard deviations to each side


def fitted_to_all(model: Model, fitted: Fit, rows: Flags, *, moved: bool = True) -> Delivered:
    """A fitted model after one linear step that fits it to all runs in `rows`; without the step if not `moved`.

    Its covariance allows for the estimates of S and ρ, as the intervals of the fit do.
    """
    found = one_step(model.runs, fitted, rows)
    wider = student.ppf(0.975, fitted.freedom) / normal.ppf(0.975)
    covariance = fitted.inflation * found.covariance * np.outer(wider, wider)
    step = found.step if moved else np.zeros_like(found.step)
    return Delivered(stepped(fitted.fitted, fitted.parameters, step), fitted.fitted, covariance)
