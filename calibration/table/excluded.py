"""Rows and columns of a table that are not used, and why.

A reader of tables and the search for outliers give a reason for each row. Rows of one reason are counted and named
together; what is particular to a row, its value, is told of a single row alone.

**Copies.** A copied row is no repeat, and makes the noise look smaller than it is. Two measurements under one
condition differ by noise. An output that is recorded in steps d, with standard deviation s between repeats, is
equal in two of them with probability

    p = d / (2 √π s),   at most 1,

the density of their difference at 0, times d. A row whose outputs all equal those of an earlier row of the same
condition is a copy if less than `_CHANCE` such pairs are expected in the whole table: (pairs of repeats) × ∏ p.
Outputs in coarse steps may agree by chance, and their rows are kept. Outputs are taken as independent.

Whole rows, all columns of the table, tell more: rows that are pasted come together. They are copies, however
coarse the outputs, where

- every row is there 2 times, or 4, 6, …, or 3, 6, …, and at least `_MANY_ROWS` are distinct;
- a block of rows in order equals one before it, so long that of rows of which half agree less than `_CHANCE` such
  blocks are expected, and of the other rows at this distance with equal settings no more than half agree.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from calibration.linear.gls import repeat_count, repeat_covariance
from common.arrays import Flags, Floats, Integers

COPY = "a copy of an earlier row, equal in all inputs and outputs{}"
_MANY_ROWS, _DISTANCES = 10, 5  # distinct rows; distances that are tried
_CHANCE = 0.01  # equal pairs that are expected by chance
_ROUNDING = 1e-9  # relative difference below which two numbers are one, converted from another unit
_TYPICAL = 0.01  # relative standard deviation that is assumed where no repeats but copies are left
MANY = 0.2  # share of the rows; if more are excluded, the rest may not be a fair sample


class Excluded(NamedTuple):
    """What is not used: a row with its name, such as "row 7 (line 9)", or else a column."""

    reason: str  # "{}" stands for the value
    row: str = ""
    value: str = ""  # of the row, such as " = 3"

    def __str__(self) -> str:
        words = self.reason.replace("{}", self.value)
        return f"{self.row}: {words}" if self.row else words


def summary_of_excluded(excluded: Sequence[Excluded], total: int) -> list[str]:
    """Group excluded rows by their reason, the most frequent first; columns follow."""
    groups: dict[str, list[Excluded]] = {}
    for each in excluded:
        if each.row:
            groups.setdefault(each.reason, []).append(each)
    by_frequency = sorted(groups.values(), key=lambda group: -len(group))
    return [_words(group, total) for group in by_frequency] + [str(each) for each in excluded if not each.row]


def _words(group: Sequence[Excluded], total: int) -> str:
    if len(group) == 1:
        return str(group[0])
    numbers = listed([each.row.removeprefix("row ") for each in group])
    return f"{len(group)} of {total} rows (rows {numbers}): {Excluded(group[0].reason)}"


def listed(names: Sequence[object], most: int = 3) -> str:
    """List the first names, and count the others: 2, 3, 5 and 4 more."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(map(str, names[:most])) + more


def count_of_rows(excluded: Sequence[Excluded]) -> int:
    """Count the rows among excluded rows and columns."""
    return sum(bool(each.row) for each in excluded)


def caveat_of_excluded(excluded: Sequence[Excluded], total: int) -> tuple[str, ...]:
    """Warn where many of the `total` rows are excluded."""
    count = count_of_rows(excluded)
    if count <= MANY * total:
        return ()
    return (
        f"{count} of {total} rows ({100 * count / total:.0f} %) were excluded: see why, and whether the rest is a "
        "fair sample of the runs",
    )


def pasted(number: Integers, inputs: Floats) -> dict[int, int]:
    """Find rows that were pasted whole, by the numbers (n,) of distinct ones: place -> place of the first one."""
    counts, copied = np.bincount(number), np.zeros(len(number), dtype=bool)
    times = int(np.gcd.reduce(counts, initial=0))
    if times > 1 and len(counts) >= _MANY_ROWS:
        nth = pd.Series(number).groupby(number).cumcount().to_numpy()
        return _with_first(number, nth >= counts[number] // times)
    before = pd.Series(np.arange(len(number))).groupby(number).diff().dropna().astype(int)
    for distance in before.value_counts().index[:_DISTANCES].tolist():
        same = number[distance:] == number[:-distance]
        alike, settings = same.sum(), (inputs[distance:] == inputs[:-distance]).all(axis=1).sum()
        blocks = np.flatnonzero(np.diff(same, prepend=False, append=False)).reshape(-1, 2)
        for start, end in blocks.tolist():
            long = end - start
            if settings * 0.5**long < _CHANCE and 2 * (alike - long) <= settings - long:
                copied[start + distance : end + distance] = True
    return _with_first(number, copied)


def _with_first(number: Integers, copied: Flags) -> dict[int, int]:
    """Return the places of copied rows (n,), and of the first row that has the number of each."""
    first = np.unique(number, return_index=True)[1][number]
    return {place: int(first[place]) for place in np.flatnonzero(copied).tolist()}


def find_copies(inputs: Floats, outputs: Floats) -> dict[int, int]:
    """Find copied rows of inputs (n, q) and outputs (n, k): place -> place of the row that it repeats."""
    rows = pd.DataFrame(np.column_stack([inputs, outputs]))
    if not (copied := rows.duplicated().to_numpy()).any():
        return {}
    condition = np.unique(inputs, axis=0, return_inverse=True)[1].reshape(-1)
    sizes = np.bincount(condition)
    pairs = float((sizes * (sizes - 1) / 2).sum())
    chance = math.prod(_equal(values, condition[~copied]) for values in outputs[~copied].T)
    number = rows.groupby([*rows]).ngroup().to_numpy().astype(np.int64)
    return _with_first(number, copied) if pairs * chance < _CHANCE else {}


def _equal(values: Floats, condition: Integers) -> float:
    """Estimate the probability that two repeats of an output (n,) are equal."""
    distinct = np.unique(values)
    gaps = np.diff(distinct)
    gaps = gaps[gaps > _ROUNDING * np.abs(distinct[1:])]
    if not len(gaps):
        return 1.0
    scatter = _TYPICAL * float(np.median(np.abs(values)))
    if repeat_count(condition):
        scatter = math.sqrt(repeat_covariance(values[:, None], condition)[0, 0])
    return min(1.0, float(gaps.min()) / (2 * math.sqrt(math.pi) * scatter)) if scatter else 1.0
