"""The first fit of a calibration, with weights of the runs where their noise is not normal.

Iteratively reweighted least squares: a fit, the noise of its residual, the weights of the runs
(`calibration.statistics.contaminated_normal`), and the fit again. From then on the weights stay, in all fits,
tests and errors. The held-out runs get weights, too, from the noise of the fitted ones.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from calibration.statistics.contaminated_normal import estimate
from calibration.statistics.fit import Fit, fit
from calibration.statistics.gls import Noise
from calibration.statistics.statistical_model import ForwardModel, Runs
from calibration.statistics.study import Study
from sim.arrays import Floats

HALF = 0.5  # a run of less weight is named
_ROUNDS = 2
_NAMED = 10  # runs
_FEWEST = 3  # runs that can agree by more than chance
_FAR_OFF = "{} farther from {} repeats than the noise of the others allows"

Model = TypeVar("Model", bound=ForwardModel)


def with_weights(model: Model, weight: Floats) -> Model:
    """Return the same model of the same runs with weights (n,)."""
    weighted = copy.copy(model)
    object.__setattr__(weighted, "runs", replace(model.runs, weight=weight))
    return weighted


def fit_weighted(study: Study, start: Mapping[str, float]) -> tuple[Study, Fit]:
    """Fit coefficients and nuisance parameters to the runs that a study uses, and weigh the runs if need be.

    Args:
        start: where the fit starts.

    Returns:
        The study, with the weights in its model's runs, and the fit. Without a share of worse runs it is the same
        study.
    """
    model, used = study.model, study.split.fitted
    names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    title = "fit" if study.progress else ""
    fitted = fit(model, start, names, used, title=title)
    for _ in range(_ROUNDS):
        residual, condition = model.runs.y - fitted.prediction, model.runs.condition
        noise = estimate(residual[used], condition[used])
        if noise is None:
            return study, fitted
        weight = np.ones(len(used))
        for rows in filter(np.any, (used, study.split.test)):
            weight[rows] = noise.weights(residual[rows], condition[rows])
        study = replace(study, model=with_weights(model, weight), noise=noise)
        fitted = fit(study.model, fitted.parameters, names, used, title=title)
    return study, fitted


def noise_of_any_run(study: Study, noise: Noise) -> Noise:
    """Return the noise of a run that may be one of the worse ones, by its variance."""
    spread = 1.0 if study.noise is None else study.noise.spread
    return Noise(noise.run * spread, noise.share / spread)


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
    said = ", ".join(map(str, rows[:_NAMED]))
    said += f" and {len(rows) - _NAMED} more" if len(rows) > _NAMED else ""
    if len(rows) == 1:
        return (f"1 of {runs} runs has a weight below one half (row {said}): {_FAR_OFF.format('it is', 'its')}",)
    return (
        f"{len(rows)} of {runs} runs have a weight below one half (rows {said}): "
        f"{_FAR_OFF.format('they are', 'their')}{f'. All of them have {alike}: check that' if alike else ''}",
    )
