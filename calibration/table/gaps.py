"""Rows of a table that lack some of what was measured: gaps, see `calibration.statistics.statistical_model`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
import pandas as pd

from calibration.linear.gls import repeat_count, repeat_covariance
from calibration.table.excluded import Excluded, listed
from calibration.table.runs import FEWEST_REPEATS, Runs
from common.arrays import Flags, Floats, Integers, Words
from common.tables import row_name

Measured = TypeVar("Measured", bound=Runs)


def is_missing(values: Floats | Words) -> Flags:
    """Say where a column has no finite number, or no word, (n,)."""
    return np.asarray(~np.isfinite(values) if values.dtype.kind == "f" else values == "")


def filled(outputs: pd.DataFrame, condition: Integers) -> Floats:
    """Return outputs as an array (n, k); at a gap stands the mean of the repeats, or of all runs.

    So all arithmetic is finite.
    """
    repeats = outputs.groupby(condition).transform("mean")
    return outputs.fillna(repeats).fillna(outputs.mean()).to_numpy(dtype=float)


def without_gaps(gaps: Flags) -> Floats:
    """Make `Runs.completion` of gaps (n, k) for which nothing stands."""
    return np.eye(gaps.shape[1]) * ~gaps[:, :, None]


def with_outputs(data: Measured, kept: Sequence[int]) -> Measured:
    """Keep some outputs, and let those of a run stand for the one that it lacks (`Runs.completion`)."""
    gaps = data.gaps[:, kept]
    names, completion = tuple(data.outputs[i] for i in kept), without_gaps(gaps)
    data = replace(data, outputs=names, y=data.y[:, kept], completion=completion if gaps.any() else None)
    if gaps.any() and repeat_count(data.repeats()) >= FEWEST_REPEATS:
        run = repeat_covariance(data.y, data.repeats())
        for T, gap in zip(completion, gaps, strict=True):
            T[np.ix_(gap, ~gap)] = np.linalg.solve(run[np.ix_(~gap, ~gap)], run[np.ix_(~gap, gap)]).T
    return data


def gaps_in_words(table: pd.DataFrame, missing: pd.DataFrame) -> list[Excluded]:
    """Name the rows that lack an output, a line for each output."""
    lines = []
    for column in (name for name in missing if missing[name].any()):
        rows = [row_name(table, i) for i in np.flatnonzero(missing[column]).tolist()]
        lines.append(Excluded(f"column {column}: no value in {listed(rows)}; the other outputs there count"))
    return lines
