"""Runs that a verdict proposes, looked up among measured ones that were kept back.

From each published table of runs the highest, or the lowest, third of the values of a setting is left out. Where
the rest is ambiguous, the settings that were left out are what the lab can set. For each run of the proposed batch
the left-out run with the nearest settings is taken as measured, and decides; as many left-out runs drawn at random
stand beside it. Of traces one of the first two is left out, and the others keep the first half of their readings.

Usage: python -m benchmarks proposals [FOLDER]     (with tables that are not in the project)

Takes ten minutes, with all tables half an hour.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

import softflagella as sf
from benchmarks.common import heading, row
from calibration.own_model.model_file import load_model
from common.arrays import Floats
from common.errors import InputError
from tests.oracles.others import MODELS, SETS, named, table_of

_NEW = 99  # session of what was left out
_FEWEST = 4  # values of a setting of which a third is left out
_TRACES = 2  # of a table that are left out, one after the other: the first ones
_ALIKE = 0.05  # largest difference of settings that count as the same, of their range or logarithm


class Reduced(NamedTuple):
    """A table of which a part was left out."""

    without: str  # in words
    kept: pd.DataFrame
    left_out: pd.DataFrame
    own: dict[str, tuple[float, ...]]  # what the lab can set


def reduced_runs(rows: pd.DataFrame, settings: list[str]) -> Iterator[Reduced]:
    """Yield a table of runs without the highest and the lowest third of the values of each setting."""
    for name in settings:
        values = np.unique(rows[name]) if pd.api.types.is_numeric_dtype(rows[name]) else np.empty(0)
        third = len(values) // 3
        for words, out in (("highest", values[-third:]), ("lowest", values[:third])):
            if len(values) >= _FEWEST:
                kept = ~rows[name].isin(out)
                yield Reduced(f"{words} {name}", rows[kept], rows[~kept], {name: tuple(map(float, out))})


def reduced_traces(rows: pd.DataFrame, trace: str, time: str) -> Iterator[Reduced]:
    """Yield a table of traces without one, and with the first half of the readings of the others."""
    for name, left_out in list(rows.groupby(trace, sort=False))[:_TRACES]:
        others = rows[rows[trace] != name]
        if len(others[trace].unique()) > 1:
            half = others.groupby(trace)[time].transform(lambda times: times <= times.median())
            yield Reduced(f"{name}, and half of each other", others[half], left_out, {})


def nearest(batch: list[dict[str, Any]], left_out: pd.DataFrame) -> tuple[pd.DataFrame, Floats]:
    """Return the left-out run nearest to each of a batch, none twice, and its largest difference of a setting."""
    names = [name for name in batch[0] if name in left_out and pd.api.types.is_numeric_dtype(left_out[name])]
    table = left_out[names].to_numpy(dtype=float)
    span = np.maximum(np.ptp(table, axis=0), 1e-12)
    free, chosen, far = np.ones(len(table), dtype=bool), [], []
    for run in batch[: len(table)]:
        away = (np.abs(table - [run[name] for name in names]) / span).max(1)
        place = int(np.argmin(np.where(free, away, np.inf)))
        free[place] = False
        chosen.append(place)
        far.append(float(away[place]))
    return left_out.iloc[chosen], np.array(far)


def decided(new: pd.DataFrame, verdict: sf.ModelVerdict, roles: dict[str, Any]) -> str:
    """Let left-out runs decide, as those of a new session; say what is left, or why nothing was judged."""
    made = new if roles["trace"] else new.assign(**{roles["session"] or "session": _NEW})
    try:
        return sf.decide(made, verdict, verdict.model, **roles).decided or "nothing"
    except InputError as refused:
        return f"refused: {refused}"


def main(folder: str = "") -> None:
    """Print a line for each ambiguous table, and how many there were."""
    tried = ambiguous = 0
    print(heading("set", "left out", "may explain", "decides, expected", "as proposed", "decided by these",
                  "by as many at random", "the whole table names"))  # fmt: skip
    for name, measured in SETS.items():
        table = table_of(measured, folder)
        if table is None:
            continue
        model, rows = load_model(MODELS / measured.model, table)
        rows = rows if isinstance(rows, pd.DataFrame) else sf.read_table(rows)
        roles: dict[str, Any] = {
            "session": measured.session,
            "specimen": measured.specimen,
            "trace": measured.trace,
        }
        try:
            whole: Any = sf.calibrate(rows, model, progress=False, held_out=measured.held_out, **roles)
        except InputError as refused:
            print(row(measured.title, refused))
            continue
        settings = [name for name in whole.runs.settings if name in rows]
        cases = (
            reduced_traces(rows, measured.trace, str(model.time))
            if measured.trace
            else reduced_runs(rows, settings)
        )
        for case in cases:
            try:
                verdict: Any = sf.calibrate(case.kept, model, progress=False, own=case.own, **roles)
            except InputError:
                continue
            tried += 1
            if verdict.next_batch is None:
                continue
            ambiguous += 1
            batch = [dict(run) for run in verdict.next_batch.settings]
            if measured.trace:
                new, far = case.left_out, np.zeros(1)
                random = new
            else:
                new, far = nearest(batch, case.left_out)
                random = case.left_out.sample(len(new), random_state=1)
            said = [decided(part, verdict, roles) for part in (new, random)]
            print(row(
                name, case.without, " or ".join(e.title for e in verdict.explanations),
                f"{100 * verdict.next_batch.decides:.0f} %", f"{np.count_nonzero(far < _ALIKE)} of {len(far)}",
                *said, named(whole.facts),
            ))  # fmt: skip
    print(f"{tried} tables, {ambiguous} ambiguous")
