"""Faults of the columns of a table, which are named before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibration.linear.gls import repeat_covariance
from calibration.table.runs import Runs
from common.arrays import Floats, Integers
from common.errors import InputError

_ROUNDING = 1e-24  # variance of repeats that are equal, over the mean square


def refuse_equal_repeats(runs: Runs, repeated: Integers | Floats, columns: Sequence[str]) -> None:
    """Refuse an output that is the same in all repeats, from which its noise cannot be estimated."""
    variances = np.diag(repeat_covariance(runs.y, repeated))
    for place in np.flatnonzero(variances <= _ROUNDING * np.mean(runs.y**2, 0))[:1].tolist():
        raise InputError(
            f"{columns[place]} is the same in all repeats; drop copies of rows, give unrounded values, or leave "
            "it out"
        )
