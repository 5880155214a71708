"""Columns of a table as a function gets them: numbers or words, and which of them it asks for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from common.arrays import Flags, Floats, Integers, Words
from common.errors import InputError
from common.quantities import numbers_of


class AskedColumns(dict[str, Any]):
    """Columns (n,), floats or words, that note for which of them a function asks."""

    def __init__(self, columns: Mapping[str, Any], asked: dict[str, None] | None = None):
        super().__init__(columns)
        self.asked = dict[str, None]() if asked is None else asked  # in order

    def __getitem__(self, name: str) -> Any:
        self.asked[name] = None
        return super().__getitem__(name)

    def __missing__(self, name: str) -> Any:
        raise InputError(f"the model's function asks for column {name!r}; the table has {', '.join(self)}")

    def rows(self, rows: Flags | Integers) -> AskedColumns:
        """Choose rows."""
        return AskedColumns({name: values[rows] for name, values in self.items()}, self.asked)


def values_of_column(column: pd.Series) -> Floats | Words:
    """Return a column as numbers, NaN for what is none; if most values are words as words, "" for a gap."""
    numbers, given = numbers_of(column).to_numpy(dtype=float), column.notna().to_numpy()
    if np.isfinite(numbers).sum() * 2 < given.sum():
        return np.where(given, column.astype(str).str.strip(), "").astype(str)
    return numbers


def is_missing(values: Floats | Words) -> Flags:
    """Say where a column has no finite number, or no word, (n,)."""
    return np.asarray(~np.isfinite(values) if values.dtype.kind == "f" else values == "")


def levels(name: str, values: Floats | Words) -> tuple[Integers, tuple[str, ...]]:
    """Number the distinct values of a column, (n,), and name each; a number goes with the name of the column."""
    distinct, number = np.unique(values, return_inverse=True)
    plain = [f"{name} {value:g}" for value in distinct] if values.dtype.kind == "f" else map(str, distinct)
    return number.reshape(-1).astype(np.int64), tuple(plain)
