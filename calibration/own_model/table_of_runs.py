"""A table of runs of any columns, for a model of one's own: one run a row.

Rows that lack what the function asks for are excluded, and copies of rows; a row that lacks some of the outputs
counts with the others. Columns that nobody asks for are notes.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from calibration.own_model.checks import check_function
from calibration.own_model.columns import AskedColumns, is_missing, levels, values_of_column
from calibration.own_model.declared import Model
from calibration.own_model.function_model import FunctionModel, TableRuns, evaluate
from calibration.statistics.copies import COPY, find_copies
from calibration.statistics.excluded import MANY, Excluded
from calibration.statistics.gaps import filled, gaps_in_words, not_finite, with_outputs, without_gaps
from calibration.statistics.gls import repeat_count
from calibration.statistics.statistical_model import FEWEST_REPEATS
from common.arrays import Flags, Floats, Integers, Words
from common.errors import InputError, naming
from common.quantities import numbers_of
from common.tables import LINE, read_table, row_name

Noise = Mapping[str, float] | Literal["unknown"]


_FOLLOWS = 0.98  # correlation of ranks among repeats with an output that was computed from a column
_TRUE = ("true", "yes", "1", "1.0")


class Roles(NamedTuple):
    """What columns of a table are, beside outputs and what the function asks for."""

    session: str | None = None
    specimen: str | None = None
    held_out: str | Sequence[str] | None = None
    noise: Noise | None = None
    notes: Sequence[str] | None = None


_NONE = Roles()


def read_runs_of(
    source: str | Path | pd.DataFrame, model: Model, roles: Roles = _NONE
) -> tuple[FunctionModel, Flags | None]:
    """Read the runs of a model from a file or a table, check both, and say which are held out, (n,).

    Raises:
        InputError: the table lacks a column, or the model or what was measured has a fault.
    """
    with naming(source):
        table = (source if isinstance(source, pd.DataFrame) else read_table(source)).rename(columns=str)
        if table.columns.has_duplicates:
            raise InputError(
                f"the table has two columns {table.columns[table.columns.duplicated()][0]!r}; drop one"
            )
        return _read(table, model, roles)


def _read(table: pd.DataFrame, model: Model, roles: Roles) -> tuple[FunctionModel, Flags | None]:
    if roles.session is None and "session" in table:
        roles = roles._replace(session="session")
    split = [roles.held_out] if isinstance(roles.held_out, str) and roles.held_out in table else []
    own = [name for name in (roles.session, roles.specimen, *split) if name]
    for what, names in (("output", model.outputs), ("setting", model.settings or ()), ("column", own),
                        ("note", roles.notes or ())):  # fmt: skip
        _refuse_unknown(what, names, table)
    outputs, titles = table[list(model.outputs)].apply(numbers_of), map(str, table)
    columns = AskedColumns({name: values_of_column(table[name]) for name in titles if name not in outputs})
    faults = _faults_of_outputs(table, outputs, model)
    settings = _settings(model, columns, table, faults)
    needed = list(dict.fromkeys([*columns.asked, *settings, *own]))
    _add_missing(faults, columns, needed, table)
    specimen = [roles.specimen] if roles.specimen else []
    set_values = np.column_stack([_as_numbers(columns[name]) for name in (*specimen, *settings)])
    _add_copies(faults, table, set_values, outputs)
    keep = np.array([row not in faults for row in range(len(table))])
    if not keep.any():
        raise InputError(f"the table has no usable row: {faults[0]}")
    columns, good = columns.rows(keep), outputs[keep]
    condition = np.unique(set_values[keep], axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)
    one_session = np.zeros(len(good), dtype=np.int64), ("all runs",)
    session, session_names = levels(roles.session, columns[roles.session]) if roles.session else one_session
    kind, kinds = levels(roles.specimen, columns[roles.specimen]) if roles.specimen else (None, ())
    logarithmic = [name for name in settings if columns[name].dtype.kind == "f" and (columns[name] > 0).all()]
    inputs = {
        f"ln {name}" if name in logarithmic else name: np.log(value) if name in logarithmic else value
        for name, value in zip(settings, set_values[keep, len(specimen) :].T, strict=True)
    }
    missing = table[list(outputs)].isna()
    runs = TableRuns(
        outputs=tuple(model.outputs),
        y=filled(_as_compared(good, model), condition),
        condition=condition,
        session=session,
        session_names=session_names,
        inputs=np.column_stack(list(inputs.values())),
        input_names=tuple(inputs),
        rows=np.flatnonzero(keep) + 1,
        excluded=(*(faults[row] for row in sorted(faults)), *gaps_in_words(table, missing & keep[:, None])),
        caveats=(),
        completion=without_gaps(missing.to_numpy()[keep]),
        specimen=kind,
        specimen_names=kinds,
        sigma=_sigma(model, roles.noise),
        noise_known=roles.noise != "unknown",
        notes=_notes(columns, needed, roles.notes, good, condition),
        output_titles={name: output.title for name, output in model.outputs.items()},
        output_scales={
            name: (1.0, output.unit.removeprefix("1"))
            for name, output in model.outputs.items()
            if output.kind == "difference"
        },
        lines=table.index.to_numpy()[keep] if table.index.name == LINE else None,
        words=frozenset(name for name in settings if columns[name].dtype.kind != "f"),
    )
    result = FunctionModel(model, with_outputs(runs, range(len(runs.outputs))), columns)
    check_function(result)
    return result, _held_out(roles.held_out, columns[split[0]] if split else None, runs)


def _refuse_unknown(what: str, names: Iterable[str], table: pd.DataFrame) -> None:
    for name in names:
        if name not in table:
            raise InputError(f"the table has no column {name!r} ({what}); it has {', '.join(map(str, table))}")


def _faults_of_outputs(table: pd.DataFrame, outputs: pd.DataFrame, model: Model) -> dict[int, Excluded]:
    """Say of which rows the outputs cannot be used, by their place.

    Raises:
        InputError: many values are not above 0 that are to be compared as ratios.
    """
    missing = table[list(outputs)].isna()
    lacking = np.flatnonzero(missing.all(axis=1)).tolist()
    faults = {row: Excluded("no output has a value", row_name(table, row)) for row in lacking}
    for name, values in outputs.items():
        for row in np.flatnonzero(~np.isfinite(values) & ~missing[name]).tolist():
            faults.setdefault(row, not_finite(table, row, str(name)))
        low = np.flatnonzero(values <= 0).tolist() if model.outputs[str(name)].kind == "ratio" else []
        if len(low) > MANY * len(table):
            raise InputError(
                f"{name} is not above 0 in {len(low)} of {len(table)} rows, first in {row_name(table, low[0])}, "
                "and cannot be compared as a ratio; declare its Output with kind='difference'"
            )
        for row in low:
            faults.setdefault(
                row, Excluded(f"{name}{{}} is not above 0", row_name(table, row), f" = {values.iloc[row]:g}")
            )
    return faults


def _settings(model: Model, columns: AskedColumns, table: pd.DataFrame, faults: dict[int, Excluded]) -> list[str]:
    """Return the settings; default: the columns for which the function asks, found from rows that have them."""
    while True:
        before = len(columns.asked)
        _add_missing(faults, columns, columns.asked, table)
        usable = np.array([row not in faults for row in range(len(table))])
        if not usable.any():
            raise InputError(f"the table has no usable row: {faults.get(0, 'it is empty')}")
        try:
            evaluate(model, columns.rows(usable), {p.name: p.start for p in model.parameters})
        except InputError:
            if len(columns.asked) == before:  # otherwise it may be due to what is missing
                raise
        if len(columns.asked) == before:
            break
    if model.settings or columns.asked:
        return list(model.settings or [name for name in columns if name in columns.asked])
    raise InputError("the function asks for no column; name the model's settings, columns that repeats share")


def _add_missing(
    faults: dict[int, Excluded], columns: AskedColumns, names: Iterable[str], table: pd.DataFrame
) -> None:
    """Add every row that lacks a value of a column."""
    for name in names:
        for row in np.flatnonzero(is_missing(columns[name])).tolist():
            faults.setdefault(row, not_finite(table, row, name))


def _as_numbers(values: Floats | Words) -> Floats:
    """Return a column as numbers, those of its words where it has words."""
    return np.asarray(
        values if values.dtype.kind == "f" else np.unique(values, return_inverse=True)[1], dtype=float
    )


def _add_copies(
    faults: dict[int, Excluded], table: pd.DataFrame, set_values: Floats, outputs: pd.DataFrame
) -> None:
    """Add every usable row that is a copy of an earlier one."""
    usable = [row for row in np.flatnonzero(outputs.notna().all(axis=1)).tolist() if row not in faults]
    for place, earlier in find_copies(set_values[usable], outputs.to_numpy()[usable]).items():
        row = usable[place]
        faults[row] = Excluded(COPY, row_name(table, row), f" ({row_name(table, usable[earlier])})")


def _notes(
    columns: AskedColumns,
    needed: Container[str],
    wanted: Sequence[str] | None,
    outputs: pd.DataFrame,
    condition: Integers,
) -> dict[str, Floats | Words]:
    """Return the columns that are wanted as notes; default: all others that do not follow from an output."""
    if wanted is not None:
        return {name: columns[name] for name in wanted}
    return {
        name: values
        for name, values in columns.items()
        if name not in needed and not is_missing(values).all() and not _follows(values, outputs, condition)
    }


def _follows(values: Floats | Words, outputs: pd.DataFrame, condition: Integers) -> bool:
    """Tell whether a column goes with an output among repeats, as a time from which a speed was computed."""
    if values.dtype.kind != "f":
        return False
    ranks = outputs.assign(**{"": values}).groupby(condition).rank()
    correlation = (ranks - ranks.groupby(condition).transform("mean")).corr()[""].drop("").abs()
    return bool((correlation > _FOLLOWS).any()) and repeat_count(condition) >= FEWEST_REPEATS


def _as_compared(outputs: pd.DataFrame, model: Model) -> pd.DataFrame:
    """Return outputs as they are compared: logarithms of what is compared as a ratio."""
    kinds = {name: output.kind for name, output in model.outputs.items()}
    return pd.DataFrame({name: np.log(v) if kinds[str(name)] == "ratio" else v for name, v in outputs.items()})


def _sigma(model: Model, noise: Noise | None) -> Floats | None:
    """Return the declared standard deviation of each output, (k,), if there is one."""
    declared = {name: output.sigma for name, output in model.outputs.items() if output.sigma is not None}
    if noise is not None and not isinstance(noise, str):
        declared |= noise
    elif noise not in (None, "unknown"):
        raise InputError(f"noise {noise!r}; give 'unknown', or a standard deviation for each output by its name")
    for name, sigma in declared.items():
        if name not in model.outputs or not 0 < float(sigma) < math.inf:
            raise InputError(f"noise of {name!r}: {sigma}; give numbers above 0 for {', '.join(model.outputs)}")
    lacking = [name for name in model.outputs if name not in declared]
    if declared and lacking:
        raise InputError(
            f"noise is given for {', '.join(declared)} and not for {', '.join(lacking)}; give all or none"
        )
    return np.array([float(declared[name]) for name in model.outputs]) if declared else None


def _held_out(given: str | Sequence[str] | None, column: Floats | Words | None, runs: TableRuns) -> Flags | None:
    """Say which runs are held out, (n,): where a column says so, or those of sessions."""
    if given is None:
        return None
    if column is not None:
        held = np.array([str(value).lower() in _TRUE for value in column])
    else:
        wanted = [given] if isinstance(given, str) else list(map(str, given))
        known = [{name, name.rpartition(" ")[2]} for name in runs.session_names]
        for name in wanted:
            if not any(name in each for each in known):
                raise InputError(
                    f"held_out {name!r} is no session and no column; there are {', '.join(runs.session_names)}"
                )
        held = np.isin(runs.session, [place for place, each in enumerate(known) if each & set(wanted)])
    if held.all() or not held.any():
        raise InputError(f"{int(held.sum())} of {len(runs)} runs are held out ({given}); hold out some, not all")
    return np.asarray(held)
