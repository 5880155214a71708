"""Columns in the units that a program needs: R_yr_mm or "R_yr [mm]" becomes R_yr_cm.

A program names its columns with their units ("R_yr_cm"). A table may have the same quantity in another unit of
the same kind, as a suffix or in brackets, in upper or lower case. The notes say what was converted.

A column of times has numbers, durations or times of day (h:mm:ss, with a fraction and days before it where it has
them), or dates as in ISO 8601 (2026-05-01T12:00:00Z), without a zone in UTC; a spreadsheet and Parquet have all of
them as types of their own. Dates, and numbers of more than ten years (seconds since 1970), count from the earliest
of their column. Other ways of writing a time have two meanings (1:30, 1/5/2026) and are no numbers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
import pandas as pd

from common.arrays import Floats
from common.errors import InputError
from common.units import Unit, convert, find_unit, from_si, of_kind, split, to_si

_NONE: Mapping[str, str] = {}
_CASE_COUNTS = {"l", "r"}  # L and R are the head's
_CLOCK = re.compile(r"(?:([0-9]+) days?,? )?([0-9]+):([0-5][0-9]):([0-5][0-9](?:[.,][0-9]*)?)")
_DATE = re.compile("[0-9]{4}-[0-9]{2}-[0-9]{2}")
_EPOCH, _LATEST = 3e8, 1e11  # s: what is longer is a date; beyond it no date, but another unit


class Converted(NamedTuple):
    """A table with columns in the wanted units, and what was converted, in words."""

    table: pd.DataFrame
    notes: tuple[str, ...]


def convert_columns(
    table: pd.DataFrame, wanted: Iterable[str], where: str, synonyms: Mapping[str, str] = _NONE
) -> Converted:
    """Rename and convert columns to those that are wanted; all others stay as they are.

    Args:
        table: as read; it is not changed. A value that is no number becomes NaN where its column is converted.
        wanted: names, with a unit as suffix ("R_yr_cm") or without ("N").
        where: the table's name, for messages.
        synonyms: other names of a quantity, in lower case -> its name without unit; a name may be a unit ("rpm").

    Raises:
        InputError: two columns hold the same quantity, or a column has no unit.
    """
    notes = []
    for name in wanted:
        candidates = [*([name] if name in table else []), *_alike(table, name, synonyms)]
        if len(candidates) > 1:
            raise InputError(f"{where}: {' and '.join(candidates)} are the same quantity; drop all but one")
        if not candidates:
            _check_bare(table, name, where, synonyms)
        if candidates in ([], [name]):
            continue
        column, target = candidates[0], split(name).unit
        given = _unit(column, synonyms)
        if given is None or target is None or given == target:
            notes.append(f"column {column} read as {name}")
        else:
            numbers = numbers_of(table[column])
            table = table.assign(**{column: convert(numbers, given.suffix, target.suffix)})
            notes.append(f"column {column} converted from {given.text} to {target.text} ({name})")
        table = table.rename(columns={column: name})
    return Converted(table, tuple(notes))


def numbers_of(column: pd.Series) -> pd.Series:
    """Convert a column to float64, with NaN for what is no number."""
    unit = split(str(column.name)).unit
    if unit is not None and unit.kind == "time":
        return pd.Series(_times_of(column, unit.suffix), index=column.index, name=column.name)
    if column.dtype.kind in "mM":  # a duration or a date where no time belongs
        return pd.Series(math.nan, index=column.index, name=column.name)
    try:
        return pd.to_numeric(column, errors="coerce").astype(float)
    except (TypeError, ValueError, OverflowError):  # dates, lists, whole numbers of hundreds of digits
        return column.map(_number)


def _number(value: object) -> float:
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return math.nan


def _times_of(column: pd.Series, unit: str) -> Floats:
    """Convert a column of times to numbers in a unit, with NaN for what is no time.

    Args:
        column: numbers in this unit, or durations or dates, as types or as text.
        unit: suffix of the unit, such as "s".
    """
    if column.dtype.kind == "M":
        column = column - column.min()
    if column.dtype.kind == "m":
        return np.asarray(from_si(column.dt.total_seconds().to_numpy(dtype=float), unit))
    numbers = pd.to_numeric(column, errors="coerce").to_numpy(dtype=float, na_value=math.nan)
    if np.isnan(numbers).any():
        words = [str(value) for value in column]
        for kind in (_date, _clock):
            seconds = np.array([kind(word) for word in words])
            if not np.isnan(seconds).all():
                return np.asarray(from_si(seconds - np.nanmin(seconds) if kind is _date else seconds, unit))
    size = to_si(np.abs(numbers), unit)
    numbers = np.where(size < _LATEST, numbers, math.nan)
    first = np.nanmin(numbers, initial=math.inf)
    return numbers - first if _EPOCH < to_si(first, unit) < _LATEST else numbers


def _clock(word: str) -> float:
    match = _CLOCK.fullmatch(word)
    if match is None:
        return math.nan
    days, hours, minutes, seconds = match.groups(default="0")
    return 86400.0 * float(days) + 3600.0 * float(hours) + 60.0 * float(minutes) + float(seconds.replace(",", "."))


def _date(word: str) -> float:
    try:
        date = datetime.fromisoformat(word) if _DATE.match(word) else None
    except ValueError:
        date = None
    return math.nan if date is None else (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def _alike(table: pd.DataFrame, wanted: str, synonyms: Mapping[str, str]) -> list[str]:
    """List columns of another name that hold a quantity, in any unit of its kind."""
    quantity, target = split(wanted)
    kind = target.kind if target else None
    names = []
    for column in map(str, table):
        unit = _unit(column, synonyms)
        if column != wanted and (unit.kind if unit else None) == kind:
            name = split(column).quantity if target else column
            if _same(name, quantity, synonyms):
                names.append(column)
    return names


def _same(name: str, quantity: str, synonyms: Mapping[str, str]) -> bool:
    name = synonyms.get(name.lower(), name)
    return name == quantity or (name.lower() == quantity.lower() and name.lower() not in _CASE_COUNTS)


def _unit(column: str, synonyms: Mapping[str, str]) -> Unit | None:
    return split(column).unit or (find_unit(column) if column.lower() in synonyms else None)


def _check_bare(table: pd.DataFrame, wanted: str, where: str, synonyms: Mapping[str, str]) -> None:
    """Refuse a column that has the right name and no unit.

    Raises:
        InputError: there is one; the message lists the names that it could have.
    """
    quantity, target = split(wanted)
    for column in map(str, table):
        if target and find_unit(column) is None and _same(column, quantity, synonyms):
            choices = ", ".join(f"{quantity}_{suffix}" for suffix in of_kind(target.kind))
            raise InputError(f"{where}: column {column!r} has no unit; name it one of {choices}")
