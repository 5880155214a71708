"""Naming what a model lacks in the manner of sparse identification: localise, select from a library, test.

1. Half of the repeats of every condition fit the coefficients and the nuisance parameters, with their priors.
2. Localise: outputs whose residual follows the inputs, their squares and products (an F test for each output).
3. Select: the library is the signals of all effects. The one that lowers the sum of squares on those outputs most
   is taken, as long as its F test passes, with at most three.
4. Confirm: each that was selected is tested on the other half, with the others in the model (F test). Tests of a
   stage share α (Bonferroni).

The halves do not share noise of runs, so the last test is valid whatever was selected. They share sessions, whose
scatter it does not know. Derivatives are those of the model as given. It is our own writing of a common pattern:
sparse regression, Brunton, Proctor and Kutz (2016); splitting of the sample, Cox (1975).
"""

from __future__ import annotations

import numpy as np
from scipy.stats import f as f_distribution

from benchmarks.calibration.planted import Linear
from calibration.statistics.statistical_model import features, prior_rows, repeat_covariance, start_values
from sim.arrays import Flags, Floats

_LEVEL = 0.05
_MOST = 3


def identify(model: Linear, used: Flags, testable: list[str]) -> frozenset[str]:
    """Effects that are confirmed; none if nothing is."""
    first = _half(model, used)
    scale = np.sqrt(np.diag(repeat_covariance(model.runs.y[used], model.runs.condition[used])))
    fitted = (*model.coefficients, *model.nuisances)
    rows = prior_rows(fitted, start_values(model))[0]
    effects = [e.name for e in model.effects]
    library = {name: model.D[..., effects.index(name)] / scale for name in testable}
    base = np.concatenate([model.J, model.G], -1) / scale[:, None]
    residual = (model.runs.y - model.prediction) / scale

    where = _localised(model, first, _unabsorbed(base, rows, residual, first))
    if not where.any():
        return frozenset()

    def squares(names: tuple[str, ...], half: Flags) -> tuple[float, int]:
        """Sum of squares on the localised outputs, and degrees of freedom."""
        columns = [base, *(library[name][..., None] for name in names)]
        table = np.concatenate(columns, -1)[half][:, where].reshape(-1, base.shape[-1] + len(names))
        values = residual[half][:, where].ravel()
        columns_and_priors = np.concatenate([table, np.pad(rows, ((0, 0), (0, len(names))))])
        residuals = np.concatenate([values, np.zeros(len(rows))])
        residuals = residuals - columns_and_priors @ np.linalg.lstsq(columns_and_priors, residuals, rcond=None)[0]
        return float(residuals @ residuals), len(values) - len(model.coefficients) - len(names)

    chosen: tuple[str, ...] = ()
    while len(chosen) < _MOST:
        candidates = [name for name in testable if name not in chosen]
        best = min(candidates, key=lambda name: squares((*chosen, name), first)[0])
        if _p(squares(chosen, first), squares((*chosen, best), first)) > _LEVEL / len(candidates):
            break
        chosen = (*chosen, best)
    second = used & ~first
    complete = squares(chosen, second)
    return frozenset(
        name
        for name in chosen
        if _p(squares(tuple(n for n in chosen if n != name), second), complete) < _LEVEL / len(chosen)
    )


def _half(model: Linear, used: Flags) -> Flags:
    """Every other repeat of each condition."""
    first = np.zeros(len(used), dtype=bool)
    for condition in np.unique(model.runs.condition[used]):
        first[np.flatnonzero(used & (model.runs.condition == condition))[::2]] = True
    return first


def _unabsorbed(base: Floats, rows: Floats, residual: Floats, half: Flags) -> Floats:
    """What coefficients and numbers leave of a half, (n', k)."""
    table = np.concatenate([base[half].reshape(-1, base.shape[-1]), rows])
    values = np.concatenate([residual[half].ravel(), np.zeros(len(rows))])
    unabsorbed = values - table @ np.linalg.lstsq(table, values, rcond=None)[0]
    return np.asarray(unabsorbed[: half.sum() * residual.shape[1]].reshape(-1, residual.shape[1]))


def _localised(model: Linear, half: Flags, residual: Floats) -> Flags:
    """(k,) outputs whose residual follows the inputs."""
    _, table = features(model.runs, half)
    table = np.column_stack([np.ones(half.sum()), table[half]])
    unexplained = residual - table @ np.linalg.lstsq(table, residual, rcond=None)[0]
    before, after = (residual**2).sum(0), (unexplained**2).sum(0)
    n, p = len(residual), table.shape[1]
    ratio = (before - after) / p / (after / (n - p))
    return np.asarray(f_distribution.sf(ratio, p, n - p) < _LEVEL / residual.shape[1])


def _p(smaller: tuple[float, int], larger: tuple[float, int]) -> float:
    """p-value of the terms that the larger model has more."""
    more = smaller[1] - larger[1]
    if not more:
        return 1.0
    ratio = (smaller[0] - larger[0]) / more / (larger[0] / larger[1])
    return float(f_distribution.sf(ratio, more, larger[1]))
