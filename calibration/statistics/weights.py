"""Weights of runs where the noise is not normal, and the first fit of a calibration, which finds them.

Most runs have the covariance S. A share π of them, those that were tracked wrongly, say, have c² S:

    y − f − b ~ (1 − π) N(0, S) + π N(0, c² S).

b is the departure of a condition from the model f, which all of its repeats share: a missing effect, or a shift of
the session. It is N(0, B), with B ≥ `_LACK` S, so that a departure of a whole condition costs its runs no weight.
Where two repeats differ by more than S allows, that one is more likely wrong which is farther from the model.

S, B and π are estimated by expectation maximisation with independent factors for b and for the kinds of the runs
(variational Bayes), from a robust start. c² is chosen among `_RATIOS` by the lower bound of the log likelihood.
One normal distribution stays unless the bound rises by more than ln n: BIC, for the two further numbers π and c².
The weight of a run is the mean of 1 over its factor in the variance,

    w = P(S) + P(c² S)/c².

`fit_weighted` reweights a fit iteratively: a fit, the noise of its residual, the weights of the runs, and the fit
again. From then on the weights stay, in all fits, tests and errors. The held-out runs get weights, too, from the
noise of the fitted ones.

Sources: Tukey (1960), Dempster, Laird and Rubin (1977); the bound, e.g. Bishop (2006), section 10.1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from calibration.linear.gls import Groups, Noise, inverse_root
from calibration.statistics.fit import Fit, beyond_its_ends, fit
from calibration.statistics.statistical_model import with_runs
from calibration.statistics.study import Study
from calibration.table.excluded import listed
from calibration.table.runs import FEWEST_REPEATS, Runs
from common.arrays import Floats, Integers

_RATIOS = (9.0, 25.0, 100.0)  # c²
_LACK = 1.0  # least variance of a condition's departure, in S
_MOST = 0.3  # largest π
_AT_START = 0.1  # π
_MAD = 1.4826  # median absolute deviation to standard deviation
_PASSES = 100
_SETTLED = 1e-3  # change of weights, and relative change of S, at which the iteration ends
HALF = 0.5  # a run of less weight is named
_ROUNDS = 2
_NAMED = 10  # runs
_FEWEST = 3  # runs that can agree by more than chance
_FAR_OFF = "{} farther from {} repeats than the noise of the others allows"


@dataclass(frozen=True)
class ContaminatedNormal:
    """Noise of runs, a share of which have a larger variance."""

    run: Floats  # (k, k) S
    lack: Floats  # (k, k) B
    share: float  # π
    ratio: float  # c²

    @property
    def spread(self) -> float:
        """Variance of any run over that of a run of S."""
        return 1 + self.share * (self.ratio - 1)

    def weights(self, residual: Floats, condition: Integers) -> Floats:
        """Compute the weights (..., n) of runs with residuals (..., n, k) from a model."""
        groups = Groups.of(condition)
        axes, lack = _axes(self.run, self.lack)
        white = residual[..., groups.order, :] @ axes.T
        weights = np.ones(white.shape[:-1])
        for _ in range(_PASSES):
            expected = _expect(white, weights, groups, lack, self.share, self.ratio)
            moved = float(np.abs(expected.weights - weights).max())
            weights = expected.weights
            if moved < _SETTLED:
                break
        return np.asarray(weights[..., groups.back])


class _Expected(NamedTuple):
    """What is expected of conditions and runs, on axes where S is 1 and B is diagonal."""

    weights: Floats  # (..., n)
    bad: Floats  # (..., n) probability of c² S
    departure: Floats  # (..., c, k) b
    variance: Floats  # (..., c, k) of b
    residual: Floats  # (..., n, k) without b
    logarithm: Floats  # (..., n) of the density of a run, without its constant


def _axes(run: Floats, lack: Floats) -> tuple[Floats, Floats]:
    """Return axes (k, k), on which S is 1 and B is diagonal, and that diagonal (k,), at least `_LACK`."""
    root = inverse_root(run)
    values, vectors = np.linalg.eigh(root @ lack @ root.T)
    return vectors.T @ root, np.maximum(values, _LACK)


def _expect(white: Floats, weights: Floats, groups: Groups, lack: Floats, share: float, ratio: float) -> _Expected:
    """Compute the departures of the conditions from the weights of the runs, and then these weights."""
    variance = 1 / (groups.add(weights[..., None]) + 1 / lack)
    departure = groups.add(weights[..., None] * white) * variance
    residual = white - departure[..., groups.place, :]
    distance = (residual**2).sum(-1) + variance.sum(-1)[..., groups.place]
    good = np.log1p(-share) - distance / 2
    if share == 0:
        return _Expected(np.ones_like(distance), np.zeros_like(distance), departure, variance, residual, good)
    bad = math.log(share) - distance / (2 * ratio) - white.shape[-1] / 2 * math.log(ratio)
    logarithm = np.logaddexp(good, bad)
    probability = np.exp(bad - logarithm)
    return _Expected(1 - probability * (1 - 1 / ratio), probability, departure, variance, residual, logarithm)


def estimate(residual: Floats, condition: Integers) -> ContaminatedNormal | None:
    """Estimate the noise from residuals (n, k) of a model; None where one normal distribution does as well."""
    groups = Groups.of(condition)
    rows = residual[groups.order]
    repeated = groups.sizes > 1
    if len(rows) - len(groups.sizes) < FEWEST_REPEATS:
        return None
    means = groups.add(rows) / groups.sizes[:, None]
    centred = (rows - means[groups.place])[repeated[groups.place]]
    scatter = _MAD * np.median(np.abs(centred), 0)
    if not (scatter > 0).all():
        return None
    scatter = scatter / math.sqrt(np.mean(1 - 1 / groups.sizes[repeated]))
    one = _maximise(rows, groups, scatter, None)[1]
    best, bound = max((_maximise(rows, groups, scatter, ratio) for ratio in _RATIOS), key=lambda found: found[1])
    return best if bound - one > math.log(len(rows)) else None


def _maximise(
    rows: Floats, groups: Groups, scatter: Floats, ratio: float | None
) -> tuple[ContaminatedNormal, float]:
    """Estimate S, B and π (0 without a ratio c²) from residuals (n, k), with the bound of the log likelihood."""
    n = len(rows)
    share, factor = (_AT_START, ratio) if ratio is not None else (0.0, 1.0)
    run = np.diag(scatter**2)
    lack = _LACK * run
    weights, bound = np.ones(n), -math.inf
    for _ in range(_PASSES):
        axes, diagonal = _axes(run, lack)
        expected = _expect(rows @ axes.T, weights, groups, diagonal, share, factor)
        b, variance = expected.departure, expected.variance
        bound = float(expected.logarithm.sum() + n * np.linalg.slogdet(axes)[1])
        bound += 0.5 * float((np.log(variance / diagonal) - (b**2 + variance) / diagonal + 1).sum())
        back = np.linalg.inv(axes)
        weighted = expected.weights[:, None]
        inner = (weighted * expected.residual).T @ expected.residual
        inner += np.diag((groups.add(weighted) * variance).sum(0))
        new = back @ inner @ back.T / n
        lack = back @ (b.T @ b + np.diag(variance.sum(0))) @ back.T / len(b)
        grown = np.diag(new) / np.diag(run) - 1
        moved = max(float(np.abs(expected.weights - weights).max()), float(np.abs(grown).max()))
        run, weights = new, expected.weights
        if ratio is not None:
            share = min(max(float(expected.bad.mean()), 0.5 / n), _MOST)
        if moved < _SETTLED:
            break
    return ContaminatedNormal(run, lack, share, factor), bound


def fit_weighted(study: Study, start: Mapping[str, float]) -> tuple[Study, Fit]:
    """Fit coefficients and nuisance parameters to the runs that a study uses, and weigh the runs if need be.

    Returns:
        The study, with the weights in its model's runs, and the fit. Without a share of worse runs it is the same
        study.
    """
    model, used = study.model, study.split.fitted
    names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    title = "fit" if study.progress else ""
    fitted = fit(model, start, names, used, title=title)
    if getattr(model, "rough", None):
        fitted = beyond_its_ends(fitted, used)
    for _ in range(_ROUNDS if model.runs.known_covariance is None else 0):
        residual, condition = model.runs.y - fitted.prediction, model.runs.condition
        noise = estimate(residual[used], condition[used])
        if noise is None:
            return study, fitted
        weight = np.ones(len(used))
        for rows in filter(np.any, (used, study.split.test)):
            weight[rows] = noise.weights(residual[rows], condition[rows])
        study = replace(study, model=with_runs(model, weight=weight), variance_ratio=noise.spread)
        fitted = fit(study.model, fitted.parameters, names, used, title=title)
    return study, fitted


def noise_of_any_run(study: Study, noise: Noise) -> Noise:
    """Return the noise of a run that may be one of the worse ones, by its variance."""
    return Noise(noise.run_covariance * study.variance_ratio, noise.session_ratio / study.variance_ratio)


def rows_of_little_weight(study: Study) -> tuple[int, ...]:
    """Return the rows of the table whose runs have less than half of the weight of a run of S."""
    runs = study.model.runs
    if runs.weight is None:
        return ()
    return tuple(sorted(runs.rows[study.split.kept & (runs.weight < HALF)].tolist()))


def alike(runs: Runs, rows: Sequence[int]) -> str:
    """Say in which settings some rows of the table agree, and the other runs do not; empty if in none."""
    some = np.isin(runs.rows, rows)
    if some.sum() < _FEWEST:
        return ""
    agree = [
        f"{name} = {values[some][0]:.4g}{unit}"
        for name, (values, unit) in runs.settings.items()
        if np.ptp(values[some]) < 1e-9 < np.ptp(values)
    ]
    session = np.unique(runs.session[some])
    if len(session) == 1 < len(runs.session_names):
        agree.append(f"session {runs.session_names[session[0]]}")
    return ", ".join(agree)


def caveat_of_weights(rows: Sequence[int], runs: int, alike: str = "") -> tuple[str, ...]:
    """Say which of so many runs have little weight, and what they have in common."""
    if not rows:
        return ()
    said = listed(rows, _NAMED)
    if len(rows) == 1:
        return (f"1 of {runs} runs has a weight below one half (row {said}): {_FAR_OFF.format('it is', 'its')}",)
    return (
        f"{len(rows)} of {runs} runs have a weight below one half (rows {said}): "
        f"{_FAR_OFF.format('they are', 'their')}{f'. All of them have {alike}: check that' if alike else ''}",
    )
