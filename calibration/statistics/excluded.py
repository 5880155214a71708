"""Rows and columns of a table that are not used, and why.

A reader of tables and the search for outliers give a reason for each row. Rows of one reason are counted and named
together; what is particular to a row, its value, is told of a single row alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from calibration.statistics.copies import COPY, find_copies
from common.arrays import Flags, Floats
from common.tables import row_name

MANY = 0.2  # share of the rows; if more are excluded, the rest may not be a fair sample


class Excluded(NamedTuple):
    """What is not used: a row with its name, such as "row 7 (line 9)", or else a column."""

    reason: str  # "{}" stands for the value
    row: str = ""
    value: str = ""  # of the row, such as " = 3"

    def __str__(self) -> str:
        words = self.reason.replace("{}", self.value)
        return f"{self.row}: {words}" if self.row else words


class Faults(dict[int, Excluded]):
    """Rows of a table that cannot be used, by their place, from 0; the first fault of a row counts."""

    def __init__(self, table: pd.DataFrame):
        super().__init__()
        self.table = table

    def add(self, bad: Any, reason: str, values: Any = ()) -> None:
        """Add the rows where `bad` (n,), with their values (n,) if these are told."""
        for row in np.flatnonzero(bad).tolist():
            value = f" = {values[row]}" if len(values) else ""
            self.setdefault(row, Excluded(reason, row_name(self.table, row), value))

    def add_not_finite(self, column: str, bad: Any) -> None:
        """Add the rows where `bad` (n,): their value of a column is missing, or no number."""
        missing = self.table[column].isna()
        self.add(bad & missing, f"{column} has no value")
        self.add(bad & ~missing, f"{column}{{}} is not a finite number", self.table[column].tolist())

    def add_copies(self, inputs: Floats, outputs: Floats) -> None:
        """Add the usable rows with all outputs (n, k) that are copies of an earlier one."""
        whole = np.flatnonzero(self.usable & np.isfinite(outputs).all(axis=1))
        for place, earlier in find_copies(inputs[whole], outputs[whole]).items():
            name, original = (row_name(self.table, int(whole[at])) for at in (place, earlier))
            self[int(whole[place])] = Excluded(COPY, name, f" ({original})")

    @property
    def usable(self) -> Flags:
        """The rows without a fault, (n,)."""
        return ~np.isin(np.arange(len(self.table)), list(self))

    @property
    def in_order(self) -> list[Excluded]:
        """The faults by their rows."""
        return [self[row] for row in sorted(self)]


def summary_of_excluded(excluded: Sequence[Excluded], total: int) -> list[str]:
    """Group rows by their reason, the most frequent first; columns follow.

    Args:
        excluded: rows and columns.
        total: rows of the table.
    """
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
