"""Generic correction: a small regression of the residual on the runs' inputs, for use when no effect explains it.

Features are the inputs, their squares and their products, standardised. They are added one at a time, as long as
left-out sessions are predicted better. Each output has its own weights. There may be no feature at all. The
correction describes the residual and does not explain it. It holds only between the runs that it was made from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.statistics.forward_model import Runs
from calibration.statistics.input_features import features
from calibration.statistics.noise import repeat_covariance
from calibration.statistics.splits import groups
from sim.arrays import Flags, Floats, Integers

_MOST = 6
_GAIN = 0.02  # share of the left-out error that a feature must save


@dataclass(frozen=True)
class Generic:
    """A correction to the prediction."""

    features: tuple[str, ...]  # in the order in which they were added
    correction: Floats  # (n, k), for all runs


def correct(runs: Runs, prediction: Floats, used: Flags) -> Generic:
    """Learn the residual of `prediction` (n, k) from the runs in `used` (n,)."""
    names, table = features(runs, used)
    scale = np.sqrt(np.diag(repeat_covariance(runs.y[used], runs.condition[used])))
    residual = (runs.y - prediction) / scale
    group = groups(runs)[0]
    chosen: list[int] = []
    error = _left_out(table[:, chosen], residual, group, used)
    while len(chosen) < _MOST:
        rest = [i for i in range(len(names)) if i not in chosen]
        if not rest:
            break
        tried = [_left_out(table[:, [*chosen, i]], residual, group, used) for i in rest]
        best = int(np.argmin(tried))
        if tried[best] > (1 - _GAIN) * error:
            break
        chosen.append(rest[best])
        error = tried[best]
    weights = _weights(table[used][:, chosen], residual[used])
    correction = _with_constant(table[:, chosen]) @ weights * scale if chosen else np.zeros_like(residual)
    return Generic(tuple(names[i] for i in chosen), correction)


def _with_constant(table: Floats) -> Floats:
    return np.column_stack([np.ones(len(table)), table])


def _weights(table: Floats, residual: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(_with_constant(table), residual, rcond=None)[0])


def _left_out(table: Floats, residual: Floats, group: Integers, used: Flags) -> float:
    """Mean square left on groups of runs that the weights have not seen; without features, of the residual."""
    if not table.shape[1]:
        return float((residual[used] ** 2).mean())
    left = []
    for own in np.unique(group[used]):
        learn, out = used & (group != own), used & (group == own)
        left.append(residual[out] - _with_constant(table[out]) @ _weights(table[learn], residual[learn]))
    return float((np.concatenate(left) ** 2).mean())
