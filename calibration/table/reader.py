"""A table of runs, one run a row, read by a declaration: which columns it has, and how they are compared.

Ratios are compared by their logarithms, differences as they are. Rows that lack what is needed are excluded with
number and reason, and so are copies of rows (`calibration.table.excluded`). A row that lacks some of the outputs
counts with the others (`Runs.completion`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from calibration.table.declared import Output
from calibration.table.excluded import COPY, Excluded, find_copies, listed, pasted
from calibration.table.runs import without_gaps
from common.arrays import Flags, Floats, Integers, Words
from common.errors import InputError
from common.quantities import numbers_of
from common.tables import LINE, read_table, row_name


class Declaration(NamedTuple):
    """What a table of runs has."""

    outputs: Mapping[str, Output]  # by their names
    columns: Mapping[str, tuple[str, float]]  # of the outputs, and factors to the units in which they are compared
    needed: Sequence[str]  # columns of which every row has a value
    session: str | None  # column that says which runs were made together
    specimen: str | None  # column that says what was run
    trace: str | None = None  # column that says to which trace a reading belongs
    time: str | None = None  # column of its time
    kinds: Mapping[str, type] = {}  # column -> float or str; others are what most of their values are
    largest: float = math.inf  # of a value
    fewest: int = 1  # rows


FEWEST_READINGS = 3  # of a trace


def open_table(source: str | Path | pd.DataFrame) -> pd.DataFrame:
    """Read a file, unless it is a table already; refuse one with two columns of one name."""
    table = (source if isinstance(source, pd.DataFrame) else read_table(source)).rename(columns=str)
    if table.columns.has_duplicates:
        raise InputError(f"the table has a column {table.columns[table.columns.duplicated()][0]!r} twice")
    return table


def require(table: pd.DataFrame, names: Iterable[object]) -> None:
    """Refuse a table that lacks a column."""
    for name in names:
        if not isinstance(name, str) or name not in table:
            raise InputError(f"the table has no column {name!r}; it has {', '.join(table.columns)}")


class TableReader:
    """A table that is being read: what its columns hold, and which rows cannot be used."""

    def __init__(self, table: pd.DataFrame, declared: Declaration, original: pd.DataFrame):
        """Read columns in the units that are declared, and set aside what is ruled out; `original`: as opened."""
        outputs = [declared.columns[name][0] for name in declared.outputs]
        require(table, [*outputs, *declared.needed])
        self.table, self.declared = table, declared
        self.measured = table[outputs].apply(numbers_of)
        self.measured = self.measured.where(self.measured.abs() < declared.largest)
        others = (str(name) for name in table if name not in outputs)
        self.columns: dict[str, Any] = {name: self._values(name) for name in others}  # (n,) each
        self.missing = table[outputs].isna()
        self.faults: dict[int, Excluded] = {}  # of rows, by their places; the first fault of a row counts
        self.set_aside((original.astype(str) == [*map(str, original)]).all(axis=1), "the header again")
        self.set_aside(self.missing.all(axis=1), "no output has a value")
        self.set_aside_lacking(declared.needed)
        for name in outputs:
            self.set_aside_not_finite(name, ~np.isfinite(self.measured[name]) & ~self.missing[name])

    def _values(self, name: str) -> Floats | Words:
        """Return a column as numbers, NaN for what is none, or as words, "" for a gap."""
        column, kind = self.table[name], self.declared.kinds.get(name)
        if kind is str:
            return column.astype(str).to_numpy(dtype=str)
        numbers, given = numbers_of(column).to_numpy(dtype=float), column.notna().to_numpy()
        if kind is float:
            return np.where(np.abs(numbers) < self.declared.largest, numbers, math.nan)
        if np.isfinite(numbers).sum() * 2 >= given.sum():
            return numbers
        return np.where(given, column.astype(str).str.strip(), "").astype(str)

    def set_aside(self, bad: Any, reason: str, values: Sequence[object] = ()) -> None:
        """Set aside the rows where `bad` (n,), with their values (n,) if these are told."""
        for row in np.flatnonzero(bad).tolist():
            value = f" = {values[row]}" if len(values) else ""
            self.faults.setdefault(row, Excluded(reason, row_name(self.table, row), value))

    def set_aside_not_finite(self, column: str, bad: Any) -> None:
        """Set aside the rows where `bad` (n,): their value of a column is missing, or no number."""
        missing = self.table[column].isna()
        self.set_aside(bad & missing, f"{column} has no value")
        self.set_aside(bad & ~missing, f"{column}{{}} is not a finite number", self.table[column].tolist())

    def set_aside_lacking(self, names: Iterable[str]) -> None:
        """Set aside the rows that lack a value of a column."""
        for name in names:
            self.set_aside_not_finite(name, is_missing(self.columns[name]))

    def _set_aside_copies(self, inputs: Floats, outputs: Floats) -> None:
        """Set aside the usable rows with all outputs (n, k) that are copies of an earlier one."""
        whole = np.flatnonzero(self.faultless & np.isfinite(outputs).all(axis=1))
        rows = self.table.iloc[whole].astype(str).reset_index(drop=True)
        number = rows.groupby([*rows], sort=False, dropna=False).ngroup()
        copies = pasted(number.to_numpy().astype(np.int64), inputs[whole])
        places = np.setdiff1d(np.arange(len(whole)), list(copies))
        again = find_copies(inputs[whole][places], outputs[whole][places])
        copies |= {int(places[place]): int(places[earlier]) for place, earlier in again.items()}
        for place, earlier in copies.items():
            name, original = (row_name(self.table, int(whole[at])) for at in (place, earlier))
            self.faults[int(whole[place])] = Excluded(COPY, name, f" ({original})")

    @property
    def faultless(self) -> Flags:
        """The rows that are not set aside, (n,)."""
        return ~np.isin(np.arange(len(self.table)), list(self.faults))

    @property
    def excluded(self) -> list[Excluded]:
        """The rows that are set aside, in order."""
        return [self.faults[row] for row in sorted(self.faults)]

    @property
    def usable(self) -> Flags:
        """The rows that are not set aside, (n,), unless they are too few."""
        usable, fewest, first = self.faultless, self.declared.fewest, next(iter(self.excluded), "")
        if usable.sum() >= fewest:
            return usable
        if fewest > 1:
            why = f" ({first})" if first else ""
            raise InputError(f"{usable.sum()} usable runs{why}; a calibration needs at least {fewest}")
        raise InputError(f"the table has no usable row: {first or 'it is empty'}")

    def runs(self, shared: Sequence[str]) -> dict[str, Any]:
        """Make fields of `Runs` of the usable rows that are no copies; repeats share the columns `shared`."""
        was_set = np.column_stack(
            [np.zeros(len(self.table)), *(as_numbers(self.columns[name]) for name in shared)]
        )
        of_traces = self._traces(was_set) if self.declared.trace else {}
        if not of_traces:
            self._set_aside_copies(was_set, self.measured.to_numpy())
        usable, outputs, specimen = self.usable, self.declared.outputs, self.declared.specimen
        condition = np.unique(was_set[usable], axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)
        if of_traces:
            condition = same_times(condition, of_traces["trace"], of_traces["time"])
        y = pd.DataFrame({name: self._compared(name, usable, condition) for name in outputs})
        # At a gap stands the mean of the repeats, or of all runs, so that all arithmetic is finite.
        y = y.fillna(y.groupby(condition).transform("mean")).fillna(y.mean())
        session, session_names = self._levels(self.declared.session, usable)
        specimens, specimen_names = self._levels(specimen, usable) if specimen else (None, ())
        return {
            "outputs": tuple(outputs),
            "y": y.to_numpy(dtype=float),
            "condition": condition,
            "session": session,
            "session_names": session_names,
            "rows": np.flatnonzero(usable) + 1,
            "excluded": (*self.excluded, *self._gaps(usable)),
            "completion": without_gaps(self.missing.to_numpy()[usable]),
            "specimen": specimens,
            "specimen_names": specimen_names,
            **of_traces,
            "lines": self.table.index.to_numpy()[usable] if self.table.index.name == LINE else None,
            "output_titles": {name: output.title or name for name, output in outputs.items()},
            "output_scales": {
                name: (1.0, output.unit.removeprefix("1"))
                for name, output in outputs.items()
                if output.kind == "difference"
            },
        }

    def _traces(self, was_set: Floats) -> dict[str, Any]:
        """Check the traces, set aside those that cannot be used, and make their fields of `Runs`."""
        column = self.declared.trace
        assert column is not None
        assert self.declared.time is not None
        time = self.columns[self.declared.time]
        first: dict[bytes, str] = {}
        for rows in self._rows_of_traces():
            name = f"trace {str(self.columns[column][rows[0]]).removesuffix('.0')!r}"
            if (back := np.flatnonzero(np.diff(time[rows]) < 0)).size:
                at = row_name(self.table, int(rows[back[0] + 1]))
                raise InputError(
                    f"{name} goes back in time in {at}: sort the table, or give what are two traces two names"
                )
            content = np.column_stack([time[rows], was_set[rows], self.measured.iloc[rows]]).tobytes()
            same = first.setdefault(content, name)
            bad = np.isin(np.arange(len(self.table)), rows)
            if len(rows) < FEWEST_READINGS:
                self.set_aside(bad, f"{name} has {len(rows)} reading{'s' * (len(rows) > 1)} only")
            elif same != name:
                self.set_aside(bad, f"{name} repeats {same}, value for value")
        usable = self.usable
        trace, levels = self._levels(column, usable)
        names = tuple(name.removeprefix("trace ") for name in levels)
        return {"trace": trace, "trace_names": names, "time": time[usable], "time_name": self.declared.time}

    @property
    def of_first_trace(self) -> Flags:
        """The rows of the trace of the first faultless row, (n,)."""
        assert self.declared.trace is not None
        names = self.columns[self.declared.trace]
        return np.asarray(names == names[int(np.argmax(self.faultless))])

    def _rows_of_traces(self) -> list[Integers]:
        """List the faultless rows of each trace, in the order of their first rows."""
        assert self.declared.trace is not None
        rows = np.flatnonzero(self.faultless)
        number = np.unique(self.columns[self.declared.trace][rows], return_inverse=True)[1].reshape(-1)
        traces = np.split(rows[np.argsort(number, kind="stable")], np.cumsum(np.bincount(number))[:-1])
        return sorted(traces, key=lambda rows: int(rows[0]))

    def _compared(self, name: str, usable: Flags, condition: Integers) -> pd.Series:
        """Return an output of the usable rows as it is compared, (n',)."""
        output, (column, factor) = self.declared.outputs[name], self.declared.columns[name]
        values = self.measured.loc[usable, column] * factor
        if output.kind == "ratio":
            return pd.Series(np.log(values.abs()))
        return _about_their_mean(values, condition, output.turn) if output.turn else values

    def _gaps(self, usable: Flags) -> Iterator[Excluded]:
        """Name the usable rows that lack an output, a line for each output."""
        for name, missing in (self.missing & usable[:, None]).items():
            if rows := [row_name(self.table, row) for row in np.flatnonzero(missing).tolist()]:
                yield Excluded(f"column {name}: no value in {listed(rows)}; the other outputs there count")

    def _levels(self, name: str | None, usable: Flags) -> tuple[Integers, tuple[str, ...]]:
        """Number the distinct values of a column, (n',), and name each; a number goes with the column's name."""
        if name is None:
            return np.zeros(usable.sum(), dtype=np.int64), ("all runs",)
        distinct, number = np.unique(self.columns[name][usable], return_inverse=True)
        names = [f"{name} {value:g}" if distinct.dtype.kind == "f" else str(value) for value in distinct]
        return number.reshape(-1).astype(np.int64), tuple(names)


def same_times(settings: Integers, trace: Integers, time: Floats) -> Integers:
    """Number readings (n,) so that those of equal settings share a number where their times are the same.

    They are the same within half a step of the longest trace of these settings.
    """
    key = np.zeros((len(time), 3))  # settings, and the time in the grid of their longest trace, or beside it
    for kind in np.unique(settings):
        rows = np.flatnonzero(settings == kind)
        longest = np.argmax(np.bincount(trace[rows]))
        grid = np.unique(time[rows][trace[rows] == longest])
        middles = (grid[1:] + grid[:-1]) / 2
        nearest = np.searchsorted(middles, time[rows])
        step = np.diff(grid, prepend=2 * grid[0] - grid[1] if len(grid) > 1 else grid[0] - 1)
        near = np.abs(time[rows] - grid[nearest]) <= step[nearest] / 2
        key[rows] = np.stack([settings[rows], np.where(near, nearest, -1), np.where(near, 0.0, time[rows])], 1)
    return np.unique(key, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)


def is_missing(values: Floats | Words) -> Flags:
    """Say where a column has no finite number, or no word, (n,)."""
    return np.asarray(~np.isfinite(values) if values.dtype.kind == "f" else values == "")


def as_numbers(values: Floats | Words) -> Floats:
    """Return a column as numbers, those of its words where it has words."""
    numbers = values if values.dtype.kind == "f" else np.unique(values, return_inverse=True)[1]
    return np.asarray(numbers, dtype=float)


def within_half_a_turn(values: Any, about: Any, turns: Any) -> Any:
    """Change angles by whole turns, of size `turns`, to within half a turn of others; where that is 0, nothing."""
    return values + turns * np.round((about - values) / np.where(turns, turns, 1.0))


def _about_their_mean(angles: pd.Series, condition: Integers, turn: float) -> pd.Series:
    """Change angles by whole turns, so that repeats are within half a turn of their circular mean."""
    first = angles.groupby(condition).transform("first")
    around = (angles - first) * (2 * np.pi / turn)
    sine, cosine = (part.groupby(condition).transform("mean") for part in (np.sin(around), np.cos(around)))
    mean = first + np.arctan2(sine, cosine) * (turn / (2 * np.pi))
    return pd.Series(within_half_a_turn(angles, mean, turn))
