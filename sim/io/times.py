"""Times in a table: numbers in the unit of the column, durations, times of day, and dates.

A duration or a time of day is h:mm:ss, with a fraction and days before it where it has them; a date is written as
in ISO 8601 (2026-05-01T12:00:00Z), without a zone in UTC. A spreadsheet and Parquet have both as types of their
own. Dates, and numbers of more than ten years (seconds since 1970), count from the earliest of their column. Other
ways of writing a time have two meanings (1:30, 1/5/2026) and are no numbers.
"""

from __future__ import annotations

import math
import re
from datetime import UTC, datetime

import numpy as np
import pandas as pd

from sim.arrays import Floats
from sim.io.units import from_si, to_si

_CLOCK = re.compile(r"(?:([0-9]+) days?,? )?([0-9]+):([0-5][0-9]):([0-5][0-9](?:[.,][0-9]*)?)")
_DATE = re.compile(
    "([0-9]{4})-([0-9]{2})-([0-9]{2})(?:[T ]([0-9]{2}):([0-9]{2})(?::([0-9]{2}(?:[.,][0-9]+)?))?)?"
    "(Z|[+-][0-9]{2}:?[0-9]{2})?"
)
_EPOCH, _LATEST = 3e8, 1e11  # s: what is longer is a date; beyond it no date, but another unit


def times_of(column: pd.Series, unit: str) -> Floats:
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
    return 86400.0 * int(days) + 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds.replace(",", "."))


def _date(word: str) -> float:
    match = _DATE.fullmatch(word)
    if match is None:
        return math.nan
    year, month, day, hours, minutes, seconds, zone = match.groups(default="0")
    try:
        date = datetime(int(year), int(month), int(day), int(hours), int(minutes), tzinfo=UTC).timestamp()
    except ValueError:
        return math.nan
    sign, offset = zone[0], zone[1:].replace(":", "")
    shift = (60 * int(offset[:2]) + int(offset[2:])) * (-60 if sign == "+" else 60) if offset else 0
    return date + shift + float(seconds.replace(",", "."))
