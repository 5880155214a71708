"""Sessions in which one output is in another unit than in the others.

The runs of a session are compared with the repeats in other sessions, or where few are shared, with the model as
given. A column in another unit differs by the factor between two units, and the sessions differ by far less in all
else: a change of `_NEAR` in a factor is taken for no slip.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from calibration.statistics.statistical_model import Runs
from common.arrays import Floats

_SCALES = (10.0, 60.0, 2 * math.pi, 180 / math.pi, 30 / math.pi, 100.0, 1000.0)
_NEAR = 1.15  # factor between a slip and the ratio of a session to the others
_FEWEST = 3  # runs of a session that are compared


class Slip(NamedTuple):
    """An output that is `factor` times in one session what it is in the others."""

    output: int
    session: str
    factor: float


def unit_slips(runs: Runs, given: Floats, differences: tuple[str, ...] = ()) -> Iterator[Slip]:
    """Find slips, at most one in an output.

    Args:
        given: (n, k) prediction of the model as given.
        differences: outputs that are no logarithms, such as angles.
    """
    sessions = [np.flatnonzero(runs.session == s) for s in range(len(runs.session_names))]
    for i, name in enumerate(runs.outputs):
        measured = ~runs.gaps[:, i]
        with np.errstate(divide="ignore", invalid="ignore"):
            y, model = (np.log(np.abs(c[:, i])) if name in differences else c[:, i] for c in (runs.y, given))
        measured &= np.isfinite(y) & np.isfinite(model)
        offsets = []
        for s, rows in enumerate(sessions):
            here, others = rows[measured[rows]], measured & (runs.session != s)
            if len(here) < _FEWEST or others.sum() < _FEWEST:
                continue
            same = [(r, others & (runs.condition == runs.condition[r])) for r in here]
            shared = [y[r] - np.median(y[alike]) for r, alike in same if alike.any()]
            residual = y - model
            alone = float(np.median(residual[here]))
            apart = np.median(shared) if len(shared) >= _FEWEST else alone - np.median(residual[others])
            offsets.append((abs(alone) if len(sessions) == 2 else abs(float(apart)), s, float(apart)))
        if offsets:
            _, s, apart = max(offsets)  # of two sessions, that which the model as given does not agree with
            if any(abs(abs(apart) - math.log(scale)) < math.log(_NEAR) for scale in _SCALES):
                yield Slip(i, runs.session_names[s], math.exp(apart))
