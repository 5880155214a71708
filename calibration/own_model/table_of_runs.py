"""A table of runs of any columns, for a model of one's own: one run a row.

Rows that lack what the function asks for are excluded, and copies of rows; a row that lacks some of the outputs
counts with the others. Columns that nobody asks for are notes, unless an output was computed from them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from calibration.linear.gls import repeat_count
from calibration.own_model.checks import check_function
from calibration.own_model.declared import Model
from calibration.own_model.function_model import AskedColumns, FunctionModel, TableRuns, evaluate
from calibration.statistics.study import middle_session
from calibration.table.excluded import MANY
from calibration.table.reader import (
    FEWEST_READINGS,
    Declaration,
    TableReader,
    as_numbers,
    is_missing,
    open_table,
    require,
)
from calibration.table.runs import FEWEST_REPEATS
from common.arrays import Flags, Floats, Integers, Words
from common.errors import InputError, naming
from common.quantities import convert_columns
from common.tables import row_name
from common.units import find_unit, split

Noise = Mapping[str, float | str] | Literal["unknown"]
_FOLLOWS = 0.98  # correlation of ranks among repeats with an output that was computed from a column
_SESSION = re.compile("session|day|date|round|series|batch|trial|repeat|lot")  # in names of columns
_MOST = 200_000_000  # rows times settings
_HEAD = 0.2  # share of the runs of a group to which its own numbers are fitted where it is left out
_TRUE = ("true", "yes", "1", "1.0")


class Roles(NamedTuple):
    """What columns of a table are, beside outputs and what the function asks for; see `softflagella.calibrate`."""

    session: str | None = None
    specimen: str | None = None
    held_out: str | Sequence[str] | None = None
    noise: Noise | None = None
    notes: Sequence[str] | None = None
    trace: str | None = None


def read_function_model(
    source: str | Path | pd.DataFrame, model: Model, roles: Roles, *, title: str = ""
) -> FunctionModel:
    """Read the runs of a model from a file or a table, and check both.

    Raises:
        InputError: the table lacks a column, or the model or what was measured has a fault.
    """
    with naming(source):
        table = open_table(source)
        session = roles.session or ("session" if "session" in table else roles.trace)
        if model.time and not roles.trace:
            raise InputError(f"a table of traces needs the column of their names, trace=; time is {model.time}")
        if roles.trace and not model.time:
            raise InputError(
                f'trace {roles.trace} needs a model with a column of the time: sf.Model(…, time="t_s")'
            )
        result = _read(table, model, roles._replace(session=session))
        caveats = check_function(result, title=title)
        return replace(result, runs=replace(result.runs, caveats=(*caveats, *_advice(result, roles))))


def read_runs_of(
    source: str | Path | pd.DataFrame,
    model: Model,
    roles: Roles,
    *,
    own: Mapping[str, Sequence[float]] | None = None,
    title: str = "",
) -> tuple[FunctionModel, Flags | None]:
    """Read the runs of a model as `read_function_model` does, and say which are held out, (n,).

    Raises:
        InputError: as there; or none can be held out.
    """
    result = read_function_model(source, model, roles, title=title)
    with naming(source):
        if len(result.runs.trace_names) == 1:
            raise InputError("the table has one trace only, so none can be held out; give several, best repeats")
        held_out = _held_out(roles.held_out, result)
        if held_out is None and not middle_session(result.runs).any():
            raise InputError(
                "all rows have one setting and one session, so none can be held out; give more of them"
            )
        settings = [name for name in result.runs.settings if name not in result.runs.words]
        if own and (unknown := [name for name in own if name not in settings]):
            raise InputError(f"own: {unknown[0]!r} is no setting of this table; there are {', '.join(settings)}")
        return replace(result, own=own or {}), held_out


def _in_its_units(table: pd.DataFrame, model: Model) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Convert columns to the units in which a model asks for them, and say which."""
    outputs = {name: o.unit for name, o in model.outputs.items() if name not in table and find_unit(o.unit)}
    told: list[str] = []
    for name, word in {**outputs, **model.units}.items():
        unit = find_unit(word)
        column = name if unit is None or split(name).unit else f"{name}_{unit.suffix}"
        table, notes = convert_columns(table.rename(columns={name: column}), [column], "the table")
        table = table.rename(columns={column: name})
        told += notes
    return table, tuple(told)


def _read(original: pd.DataFrame, model: Model, roles: Roles) -> FunctionModel:
    table, converted = _in_its_units(original, model)
    require(table, _names(roles.notes))
    own = [name for name in (roles.specimen, roles.session, roles.trace, model.time) if name]
    for number in model.numbers:
        if number.per and not getattr(roles, number.per):
            raise InputError(f"{number.name} is a number per {number.per}: name its column, {number.per}=")
    same = {name: (name, 1.0) for name in model.outputs}
    required = [*(model.settings or ()), *own]
    kinds = {model.time: float} if model.time else {}
    declared = Declaration(
        model.outputs, same, required, roles.session, roles.specimen, roles.trace, model.time, kinds
    )
    reader = TableReader(table, declared, original)
    _set_aside_low(reader)
    if model.time:  # a reading that lacks an output is a gap in its trace
        for name in model.outputs:
            reader.set_aside_not_finite(name, ~np.isfinite(reader.measured[name]))
    columns = AskedColumns(reader.columns)
    settings = _settings(model, columns, reader)
    needed = [*columns.asked, *settings, *own]
    reader.set_aside_lacking(needed)
    known = _by_trace(reader.runs([name for name in (roles.specimen, *settings) if name]))
    count, distinct = len(known["rows"]), int(known["condition"].max()) + 1
    if model.time is None and count * distinct > _MOST:
        raise InputError(
            f"{distinct} settings in {count} rows are more than can be tested; name what repeats share in "
            "settings=[…] of the model, round it, or give fewer rows"
        )
    rows = known["rows"] - 1
    columns, good = columns.rows(rows), reader.measured.iloc[rows]
    inputs = {}
    for name in settings:
        values = as_numbers(columns[name])
        logarithmic = columns[name].dtype.kind == "f" and bool((values > 0).all())
        inputs[f"ln {name}" if logarithmic else name] = np.log(values) if logarithmic else values
    if model.time:
        inputs[model.time] = known["time"]
    runs = TableRuns(
        **known,
        inputs=np.column_stack(list(inputs.values())),
        input_names=tuple(inputs),
        heads=_heads(model, known),
        caveats=(),
        sigma=_sigma(model, roles.noise),
        noise_known=roles.noise != "unknown",
        notes={}
        if model.time
        else _notes(columns, [*needed, *_names(roles.held_out)], roles.notes, good, known["condition"]),
        unit_checked={name: output.unit_checked for name, output in model.outputs.items()},
        words=frozenset(name for name in settings if columns[name].dtype.kind != "f"),
        converted=converted,
    )
    return FunctionModel(model, runs.with_outputs(range(len(runs.outputs))), columns)


def _by_trace(known: dict[str, Any]) -> dict[str, Any]:
    """Sort fields of runs by trace, then by time."""
    if "trace" not in known:
        return known
    order = np.lexsort((known["time"], known["trace"]))
    return {name: field[order] if isinstance(field, np.ndarray) else field for name, field in known.items()}


def _heads(model: Model, known: Mapping[str, Any]) -> Flags | None:
    """Say which runs are the first of those that have numbers of their own, (n,); None without such numbers.

    They are the first of each trace, where there are traces, whether a number is that of a trace or of many.
    """
    kinds = {"trace" if model.time else number.per for number in model.numbers if number.per}
    heads = np.zeros(len(known["rows"]), dtype=bool)
    for group in (known[kind] for kind in kinds):
        for place in np.unique(group):
            rows = np.flatnonzero(group == place)
            heads[rows[: max(FEWEST_READINGS, math.ceil(_HEAD * len(rows)))]] = True
    return heads if kinds else None


def _advice(model: FunctionModel, roles: Roles) -> list[str]:
    """Say what the table has and was not told, and what keeps its rows from being repeats."""
    runs, advice, table = model.runs, [], pd.DataFrame(dict(model.columns.items()))
    settings = [name.removeprefix("ln ") for name in runs.input_names]
    alike = [name for name in table.columns.difference([*settings, roles.specimen], sort=False)
             if _SESSION.search(name.lower())]  # fmt: skip
    free = [name for name in alike if 1 < table[name].nunique() <= len(table) / 2]
    if roles.session is None and len(runs.session_names) == 1 and free:
        advice.append(f"no session was given; column {free[0]} looks like one (--session {free[0]})")
    if runs.trace is not None or runs.repeated(slice(None)) or runs.sigma is not None or not runs.noise_known:
        return advice
    advice.append(
        f'with fewer than {FEWEST_REPEATS} repeats the noise is unknown; declare it: sigma="2 %" of the Output'
    )
    for role in ("specimen", "session"):
        if name := getattr(roles, role):
            others = [column for column in settings if column != name]
            if len(table) - len(table[others].drop_duplicates()) >= FEWEST_REPEATS:
                advice.append(f"rows of equal settings differ in {name} (--{role}), so they are no repeats")
    return advice


def _set_aside_low(reader: TableReader) -> None:
    """Set aside rows with a ratio that is not above 0; refuse a table with many of them."""
    for name in (name for name, output in reader.declared.outputs.items() if output.kind == "ratio"):
        if (low := reader.measured[name] <= 0).mean() > MANY:
            first = row_name(reader.table, int(np.argmax(low)))
            raise InputError(
                f"{name} is not above 0 in {low.sum()} of {len(low)} rows, first in {first}, and cannot be "
                "compared as a ratio; declare its Output with kind='difference'"
            )
        reader.set_aside(low, f"{name}{{}} is not above 0", [f"{value:g}" for value in reader.measured[name]])


def _settings(model: Model, columns: AskedColumns, reader: TableReader) -> list[str]:
    """Return the settings; default: the columns for which the function asks, found from rows that have them."""
    before = -1
    while before < (before := len(columns.asked)):
        reader.set_aside_lacking(columns.asked)
        usable = reader.usable
        if model.time:
            usable = usable & reader.of_first_trace
        try:
            evaluate(model, columns.rows(usable), {p.name: p.start for p in model.parameters})
        except InputError:
            if len(columns.asked) == before:  # otherwise it may be due to what is missing
                raise
    settings = [name for name in model.settings or columns.asked if name != model.time]
    if settings or model.time:
        return settings
    raise InputError("the function asks for no column; name the model's settings, columns that repeats share")


def _notes(
    columns: AskedColumns,
    known: Container[str],
    wanted: Sequence[str] | None,
    outputs: pd.DataFrame,
    condition: Integers,
) -> dict[str, Floats | Words]:
    """Return the columns that are wanted as notes; default: all others from which no output was computed."""
    if wanted is not None:
        return {name: columns[name] for name in _names(wanted)}
    notes = {name: v for name, v in columns.items() if name not in known and not is_missing(v).all()}
    if repeat_count(condition) < FEWEST_REPEATS:
        return notes
    numbers = {name: values for name, values in notes.items() if values.dtype.kind == "f"}
    ranks = outputs.assign(**numbers).groupby(condition).rank()
    correlation = (ranks - ranks.groupby(condition).transform("mean")).corr()[list(outputs)].abs()
    computed = {name for name in numbers if (correlation.loc[name] > _FOLLOWS).any()}
    return {name: values for name, values in notes.items() if name not in computed}


def _sigma(model: Model, noise: Noise | None) -> Floats | None:
    """Return the declared standard deviation of each output, (k,), if there is one."""
    given = dict(noise) if isinstance(noise, Mapping) else {}
    declared = {name: output.sigma for name, output in model.outputs.items() if output.sigma is not None} | given
    if not (given or noise in (None, "unknown")) or (declared and set(declared) != set(model.outputs)):
        raise InputError(
            f"noise {noise or declared}; give 'unknown', or a standard deviation above 0 for each output, "
            f"{', '.join(model.outputs)}"
        )
    outputs = model.outputs.items()
    return np.array([o.deviation(declared[name], f"noise of {name}") for name, o in outputs]) if declared else None


def _names(given: str | Sequence[str] | None) -> list[str]:
    if not isinstance(given, str | Iterable | None):
        raise InputError(f'held_out, notes: {given!r}; give a name as text, such as "{given}", or a list of names')
    return [given] if isinstance(given, str) else list(map(str, given or ()))


def _held_out(given: str | Sequence[str] | None, model: FunctionModel) -> Flags | None:
    """Say which runs are held out, (n,): those of sessions, or where a column says so."""
    wanted, runs = _names(given), model.runs
    if not wanted:
        return None
    known = [{name, name.rpartition(" ")[2]} for name in runs.session_names]
    if len(wanted) == 1 and wanted[0] in model.columns:
        held = np.array([str(value).lower() in _TRUE for value in model.columns[wanted[0]]])
    elif unknown := set(wanted).difference(*known):
        sessions = ", ".join(runs.session_names)
        raise InputError(f"held_out {min(unknown)!r} is no session and no column; there are {sessions}")
    else:
        held = np.isin(runs.session, [place for place, each in enumerate(known) if each & set(wanted)])
    if held.all() or not held.any():
        raise InputError(
            f"{int(held.sum())} of {len(runs)} runs are held out ({', '.join(wanted)}); hold out some"
        )
    return np.asarray(held)
