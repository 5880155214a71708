"""A small regression of the residual on the runs' inputs, for comparison; and forward selection of its terms.

Features are the inputs, their squares and their products, standardised. They are added one at a time, as long as
left-out sessions are predicted better. Each output has its own weights. There may be no feature at all. The
regression describes the residual and does not explain it. It holds only between the runs that it was made from.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from calibration.statistics.gls import repeat_covariance
from calibration.statistics.statistical_model import Runs, features
from calibration.statistics.study import groups, leave_one_group_out
from common.arrays import Flags, Floats, Integers

Terms = TypeVar("Terms", bound=tuple[object, ...])

_MOST = 6
_GAIN = 0.02  # share of the left-out error that a feature must save


@dataclass(frozen=True)
class Regression:
    """A correction to the prediction."""

    features: tuple[str, ...]  # in the order in which they were added
    correction: Floats  # (n, k), for all runs


def regress_residual(runs: Runs, prediction: Floats, used: Flags) -> Regression:
    """Learn the residual of `prediction` (n, k) from the runs in `used` (n,)."""
    names, table = features(runs, used)
    scale = np.sqrt(np.diag(repeat_covariance(runs.y[used], runs.repeats(used), runs.scale[used])))
    residual = runs.scale[:, None] * (runs.y - prediction) / scale
    group = groups(runs)[0]
    start: tuple[int, ...] = ()

    def scaled(chosen: tuple[int, ...]) -> Floats:
        """Multiply the constant and the features by the roots of the weights; no column without features."""
        columns = np.column_stack([np.ones(len(table)), table[:, list(chosen)]]) if chosen else table[:, :0]
        return np.asarray(runs.scale[:, None] * columns)

    chosen = select_forward(
        start,
        lambda chosen: [(*chosen, i) for i in range(len(names)) if i not in chosen],
        lambda chosen: _left_out_error(scaled(chosen), residual, group, used),
        most=_MOST,
        gain=_GAIN,
    )
    columns = scaled(chosen)
    weights = _weights(columns[used], residual[used])
    correction = columns / runs.scale[:, None] @ weights * scale
    return Regression(tuple(names[i] for i in chosen), correction)


def _weights(table: Floats, residual: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(table, residual, rcond=None)[0])


def _left_out_error(table: Floats, residual: Floats, group: Integers, used: Flags) -> float:
    """Compute the mean square left on groups that the weights have not seen; without features, of the residual."""
    if not table.shape[1]:
        return float((residual[used] ** 2).mean())
    errors = [
        residual[out] - table[out] @ _weights(table[learn], residual[learn])
        for learn, out in leave_one_group_out(group, used)
    ]
    return float((np.concatenate(errors) ** 2).mean())


def select_forward(
    start: Terms,
    larger: Callable[[Terms], Sequence[Terms]],
    left_out_error: Callable[[Terms], float],
    *,
    most: int,
    gain: float,
) -> Terms:
    """Choose terms, in the order in which they were added.

    Args:
        start: terms to begin with.
        larger: all choices that have one term more.
        left_out_error: of a choice, on runs that it has not seen.
        most: terms.
        gain: share of the error that a term must save.
    """
    chosen, least = start, left_out_error(start)
    while len(chosen) < most and (choices := larger(chosen)):
        tried = [left_out_error(choice) for choice in choices]
        best = int(np.argmin(tried))
        if tried[best] > (1 - gain) * least:
            break
        chosen, least = choices[best], tried[best]
    return chosen
