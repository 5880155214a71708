"""Which traces are possible: those that were made, each also read more often and for longer, with other settings.

What was driven along a trace, such as a voltage, is no setting. It is not known how it goes on, so that trace can
only be made again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from calibration.table.runs import Runs
from common.arrays import Floats, Integers

_MOST = 6  # traces of the table that others are like


class PossibleTrace(NamedTuple):
    """A trace that can be made next."""

    settings: dict[str, Any]  # column -> value, and how it is read
    rows: Integers  # (m,) readings of the table that those of the trace are like
    time: Floats  # (m,)
    own: Mapping[str, float]  # columns that the lab sets


def possible_traces(
    runs: Runs, columns: Mapping[str, Any], own: Mapping[str, Sequence[float]], *, longer: bool
) -> list[PossibleTrace]:
    """List traces that can be made next, those of the fewest readings first.

    Args:
        columns: settings of the readings, by name.
        own: values that the lab can set, by name.
        longer: whether a model can be compared with itself at times that were not read.
    """
    alike: dict[tuple[Any, ...], tuple[Integers, dict[str, Any]]] = {}
    for number in range(len(runs.trace_names)):
        rows = np.flatnonzero(runs.trace == number)
        values = {name: np.asarray(column)[rows] for name, column in columns.items()}
        fixed = {name: column[0].item() for name, column in values.items() if (column == column[0]).all()}
        driven = [column.tobytes() for name, column in values.items() if name not in fixed]
        alike.setdefault((*fixed.items(), *driven), (rows, fixed))
    chosen = np.unique(np.linspace(0, len(alike) - 1, min(len(alike), _MOST)).round().astype(int))
    assert runs.time is not None
    traces: list[PossibleTrace] = []
    for rows, fixed in (list(alike.values())[place] for place in chosen.tolist()):
        as_read = runs.time[rows]
        further = _readings(as_read) if longer and len(fixed) == len(columns) else [("as often", as_read)]
        for chosen_values in product(*own.values()):
            changes = dict(zip(own, chosen_values, strict=True))
            for words, time in further:
                like = rows[np.maximum(np.searchsorted(as_read, time, side="right") - 1, 0)]
                span = f"{time[0]:.4g} to {time[-1]:.4g}"
                settings = {**fixed, **changes, runs.time_name: span, "readings": len(time), "read": words}
                traces.append(PossibleTrace(settings, like, time, changes))
    return sorted(traces, key=lambda trace: len(trace.time))


def _readings(time: Floats) -> Iterator[tuple[str, Floats]]:
    """Yield the times of a trace (m,), the same more often, and for longer."""
    distinct = np.unique(time)
    yield "as often", time
    if len(distinct) > 1:
        yield "twice as often", np.unique(np.concatenate([distinct, (distinct[1:] + distinct[:-1]) / 2]))
        after = distinct - distinct[0] + float(np.median(np.diff(distinct)))
        yield "twice as long", np.append(distinct, distinct[-1] + after)
