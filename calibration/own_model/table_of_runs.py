"""A table of runs of any columns, for a model of one's own: one run a row.

Rows that lack what the function asks for are excluded, and copies of rows; a row that lacks some of the outputs
counts with the others. Columns that nobody asks for are notes, unless an output was computed from them.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, NamedTuple, cast

import numpy as np
import pandas as pd

from calibration.linear.gls import repeat_count
from calibration.own_model.checks import check_function
from calibration.own_model.declared import Model
from calibration.own_model.function_model import (
    AskedColumns,
    FunctionModel,
    TableRuns,
    evaluate,
    within_half_a_turn,
)
from calibration.statistics.study import middle_session
from calibration.table.excluded import MANY, Faults
from calibration.table.gaps import filled, gaps_in_words, is_missing, with_outputs, without_gaps
from calibration.table.runs import FEWEST_REPEATS
from common.arrays import Flags, Floats, Integers, Words
from common.errors import InputError, naming
from common.quantities import convert_columns, numbers_of
from common.tables import LINE, read_table, row_name
from common.units import find_unit, split

Noise = Mapping[str, float | str] | Literal["unknown"]
_FOLLOWS = 0.98  # correlation of ranks among repeats with an output that was computed from a column
_SESSION = re.compile("session|day|date|round|series|batch|trial|repeat|lot")  # in names of columns
_MOST = 200_000_000  # rows times settings
_TRUE = ("true", "yes", "1", "1.0")


class Roles(NamedTuple):
    """What columns of a table are, beside outputs and what the function asks for; see `softflagella.calibrate`."""

    session: str | None = None
    specimen: str | None = None
    held_out: str | Sequence[str] | None = None
    noise: Noise | None = None
    notes: Sequence[str] | None = None


def read_runs_of(
    source: str | Path | pd.DataFrame,
    model: Model,
    roles: Roles,
    *,
    own: Mapping[str, Sequence[float]] | None = None,
    title: str = "",
) -> tuple[FunctionModel, Flags | None]:
    """Read the runs of a model from a file or a table, check both, and say which are held out, (n,).

    Raises:
        InputError: the table lacks a column, or the model or what was measured has a fault.
    """
    with naming(source):
        table = (source if isinstance(source, pd.DataFrame) else read_table(source)).rename(columns=str)
        if table.columns.has_duplicates:
            raise InputError(f"the table has a column {table.columns[table.columns.duplicated()][0]!r} twice")
        result = _read(
            table, model, roles._replace(session=roles.session or ("session" in table and "session") or None)
        )
        caveats = check_function(result, title=title)
        held_out = _held_out(roles.held_out, result)
        if held_out is None and not middle_session(result.runs).any():
            raise InputError(
                "all rows have one setting and one session, so none can be held out; give more of them"
            )
        advice = _advice(result, roles)
        settings = [name for name in result.runs.settings if name not in result.runs.words]
        if own and (unknown := [name for name in own if name not in settings]):
            raise InputError(f"own: {unknown[0]!r} is no setting of this table; there are {', '.join(settings)}")
        return replace(result, own=own or {}, runs=replace(result.runs, caveats=(*caveats, *advice))), held_out


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


def _read(table: pd.DataFrame, model: Model, roles: Roles) -> FunctionModel:
    table, converted = _in_its_units(table, model)
    own = [name for name in (roles.session, roles.specimen) if name]
    for name in (*model.outputs, *(model.settings or ()), *own, *_names(roles.notes)):
        if not isinstance(name, str) or name not in table:
            raise InputError(f"the table has no column {name!r}; it has {', '.join(table.columns)}")
    outputs = table[list(model.outputs)].apply(numbers_of)
    columns = AskedColumns({name: _values(table[name]) for name in table.columns if name not in outputs})
    faults = _faults_of_outputs(table, outputs, model)
    settings = _settings(model, columns, faults)
    needed = list(dict.fromkeys([*columns.asked, *settings, *own]))
    _add_missing(faults, columns, needed)
    specimens = own[-1:] if roles.specimen else []
    was_set = np.column_stack([_as_numbers(columns[name]) for name in (*specimens, *settings)])
    faults.add_copies(was_set, outputs.to_numpy())
    if not (keep := faults.usable).any():
        raise InputError(f"the table has no usable row: {faults[0]}")
    columns, was_set, good, missing = columns.rows(keep), was_set[keep], outputs[keep], table[list(outputs)].isna()
    condition = np.unique(was_set, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)
    if len(condition) * (distinct := int(condition.max()) + 1) > _MOST:
        raise InputError(
            f"{distinct} settings in {len(condition)} rows are more than can be tested; name what repeats share "
            "in settings=[…] of the model, round it, or give fewer rows"
        )
    inputs, words = {}, []
    for name, values in zip(settings, was_set[:, len(specimens) :].T, strict=True):
        logarithmic = columns[name].dtype.kind == "f" and bool((values > 0).all())
        inputs[f"ln {name}" if logarithmic else name] = np.log(values) if logarithmic else values
        words += [name] if columns[name].dtype.kind != "f" else []
    session, session_names = _levels(roles.session, columns)
    specimen, specimen_names = _levels(roles.specimen, columns)
    kinds = model.outputs.items()
    compared = {name: np.log(good[name]) if o.kind == "ratio" else good[name] for name, o in kinds}
    for name, output in kinds:
        if output.turn:
            compared[name] = _about_their_mean(compared[name], condition, output.turn)
    runs = TableRuns(
        outputs=tuple(model.outputs),
        y=filled(pd.DataFrame(compared), condition),
        condition=condition,
        session=session,
        session_names=session_names,
        inputs=np.column_stack(list(inputs.values())),
        input_names=tuple(inputs),
        rows=np.flatnonzero(keep) + 1,
        excluded=(*faults.in_order, *gaps_in_words(table, missing & keep[:, None])),
        caveats=(),
        completion=without_gaps(missing.to_numpy()[keep]),
        specimen=specimen if roles.specimen else None,
        specimen_names=specimen_names if roles.specimen else (),
        sigma=_sigma(model, roles.noise),
        noise_known=roles.noise != "unknown",
        notes=_notes(columns, [*needed, *_names(roles.held_out)], roles.notes, good, condition),
        output_titles={name: o.title or name for name, o in kinds},
        output_scales={name: (1.0, o.unit.removeprefix("1")) for name, o in kinds if o.kind == "difference"},
        unit_checked={name: o.unit_checked for name, o in kinds},
        lines=table.index.to_numpy()[keep] if table.index.name == LINE else None,
        words=frozenset(words),
        converted=converted,
    )
    return FunctionModel(model, with_outputs(runs, range(len(runs.outputs))), columns)


def _about_their_mean(angles: pd.Series, condition: Integers, turn: float) -> pd.Series:
    """Change angles by whole turns, so that repeats are within half a turn of their circular mean."""
    first = angles.groupby(condition).transform("first")
    around = (angles - first) * (2 * np.pi / turn)
    sine, cosine = (part.groupby(condition).transform("mean") for part in (np.sin(around), np.cos(around)))
    mean = first + np.arctan2(sine, cosine) * (turn / (2 * np.pi))
    return cast(pd.Series, within_half_a_turn(angles, mean, turn))


def _values(column: pd.Series) -> Floats | Words:
    """Return a column as numbers, NaN for what is none; if most values are words as words, "" for a gap."""
    numbers, given = numbers_of(column).to_numpy(dtype=float), column.notna().to_numpy()
    if np.isfinite(numbers).sum() * 2 < given.sum():
        return np.where(given, column.astype(str).str.strip(), "").astype(str)
    return numbers


def _as_numbers(values: Floats | Words) -> Floats:
    """Return a column as numbers, those of its words where it has words."""
    numbers = values if values.dtype.kind == "f" else np.unique(values, return_inverse=True)[1]
    return np.asarray(numbers, dtype=float)


def _advice(model: FunctionModel, roles: Roles) -> list[str]:
    """Say what the table has and was not told, and what keeps its rows from being repeats."""
    runs, advice, table = model.runs, [], pd.DataFrame(dict(model.columns.items()))
    settings = [name.removeprefix("ln ") for name in runs.input_names]
    alike = [name for name in table.columns.difference([*settings, roles.specimen], sort=False)
             if _SESSION.search(name.lower())]  # fmt: skip
    free = [name for name in alike if 1 < table[name].nunique() <= len(table) / 2]
    if roles.session is None and len(runs.session_names) == 1 and free:
        advice.append(f"no session was given; column {free[0]} looks like one (--session {free[0]})")
    if runs.repeated(slice(None)) or runs.sigma is not None or not runs.noise_known:
        return advice
    advice.append('without repeats the noise is unknown; declare it: sigma="2 %" of the Output, or noise=')
    for role in ("specimen", "session"):
        if name := getattr(roles, role):
            others = [column for column in settings if column != name]
            if len(table) - len(table[others].drop_duplicates()) >= FEWEST_REPEATS:
                advice.append(f"rows of equal settings differ in {name} (--{role}), so they are no repeats")
    return advice


def _levels(name: str | None, columns: AskedColumns) -> tuple[Integers, tuple[str, ...]]:
    """Number the distinct values of a column, (n,), and name each; a number goes with the name of the column."""
    if name is None:
        return np.zeros(len(next(iter(columns.values()))), dtype=np.int64), ("all runs",)
    distinct, number = np.unique(columns[name], return_inverse=True)
    names = [f"{name} {value:g}" if distinct.dtype.kind == "f" else str(value) for value in distinct]
    return number.reshape(-1).astype(np.int64), tuple(names)


def _faults_of_outputs(table: pd.DataFrame, outputs: pd.DataFrame, model: Model) -> Faults:
    """Say of which rows the outputs cannot be used; refuse ratios of which many are not above 0."""
    missing, faults = table[list(outputs)].isna(), Faults(table)
    faults.add(missing.all(axis=1), "no output has a value")
    for name, output in model.outputs.items():
        faults.add_not_finite(name, ~np.isfinite(outputs[name]) & ~missing[name])
        low = (outputs[name] <= 0) & (output.kind == "ratio")
        if low.mean() > MANY:
            first = row_name(table, int(np.argmax(low)))
            raise InputError(
                f"{name} is not above 0 in {low.sum()} of {len(table)} rows, first in {first}, "
                "and cannot be compared as a ratio; declare its Output with kind='difference'"
            )
        faults.add(low, f"{name}{{}} is not above 0", [f"{value:g}" for value in outputs[name]])
    return faults


def _settings(model: Model, columns: AskedColumns, faults: Faults) -> list[str]:
    """Return the settings; default: the columns for which the function asks, found from rows that have them."""
    before = -1
    while before < (before := len(columns.asked)):
        _add_missing(faults, columns, columns.asked)
        if not (usable := faults.usable).any():
            raise InputError(f"the table has no usable row: {faults.get(0, 'it is empty')}")
        try:
            evaluate(model, columns.rows(usable), {p.name: p.start for p in model.parameters})
        except InputError:
            if len(columns.asked) == before:  # otherwise it may be due to what is missing
                raise
    if model.settings or columns.asked:
        return list(model.settings or columns.asked)
    raise InputError("the function asks for no column; name the model's settings, columns that repeats share")


def _add_missing(faults: Faults, columns: AskedColumns, names: Iterable[str]) -> None:
    """Add every row that lacks a value of a column."""
    for name in names:
        faults.add_not_finite(name, is_missing(columns[name]))


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
