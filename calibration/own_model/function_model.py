"""A function of one's own as a model of the calibration. It never sees an array in place of a parameter.

It is called once for all runs; or once for each trace, or for runs that have the same numbers of their own. What a
call returned is kept. So a change of a number of one trace costs the call of that trace.
"""

from __future__ import annotations

import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from tqdm import tqdm

from calibration.own_model.declared import Model
from calibration.own_model.possible_traces import possible_traces
from calibration.statistics.budget import count_predictions, spent, waiting
from calibration.statistics.forward import by_differences, linear, secants
from calibration.statistics.statistical_model import Parameter, Parameters, Predict
from calibration.table.reader import within_half_a_turn
from calibration.table.runs import Runs
from common.arrays import Flags, Floats, Integers
from common.errors import InputError

_KEPT = 16  # predictions
_NEXT = "next"  # session that can be made
_SPECIMEN = "specimen"  # of a run that can be made
NOT_ABOVE_0 = np.log(1e-300)  # stands for the logarithm of what is not above 0


class AskedColumns(dict[str, Any]):
    """Columns (n,), floats or words, that cannot be changed, and note for which of them a function asks."""

    def __init__(self, columns: Mapping[str, Any], asked: dict[str, None] | None = None):
        super().__init__(columns)
        self.asked = dict[str, None]() if asked is None else asked  # in order
        for values in columns.values():
            values.setflags(write=False)

    def __getitem__(self, name: str) -> Any:
        if name not in self:
            raise InputError(f"the model's function asks for column {name!r}; the table has {', '.join(self)}")
        self.asked[name] = None
        return super().__getitem__(name)

    def get(self, name: str, default: Any = None) -> Any:
        """Return a column if it is there."""
        return self[name] if name in self else default  # noqa: SIM401 (it is this)

    def rows(self, rows: Flags | Integers) -> AskedColumns:
        """Choose rows."""
        return AskedColumns({name: values[rows] for name, values in self.items()}, self.asked)


@dataclass(frozen=True)
class TableRuns(Runs):
    """Runs of a table of any columns; what was set is their inputs."""

    words: frozenset[str] = field(default=frozenset(), kw_only=True)  # inputs that number words

    @property
    def settings(self) -> dict[str, tuple[Floats, str]]:
        """What was set, as numbers of the table; words only if nothing else was set."""
        names = [name for name in self.input_names if name not in self.words] or self.input_names
        values = {name: self.inputs[:, self.input_names.index(name)] for name in names}
        return {
            name.removeprefix("ln "): (np.exp(column) if name.startswith("ln ") else column, "")
            for name, column in values.items()
        }


class Call(NamedTuple):
    """Runs for which the function is called together."""

    rows: Integers  # (n',)
    columns: AskedColumns  # of these
    own: Mapping[str, str]  # number that they have of their own -> its name among the parameters


@dataclass(frozen=True)
class FunctionModel:
    """A model of one's own with its runs: an `Experiment`."""

    model: Model
    runs: TableRuns
    columns: AskedColumns  # of the runs
    untestable: Mapping[str, str] = field(default_factory=dict)
    about: Floats | None = None  # (n, k) within half a turn of which angles are predicted; None: the measured ones
    own: Mapping[str, Sequence[float]] = field(default_factory=dict)  # settings that the lab can set, by column
    known: dict[tuple[float, ...], Floats] = field(default_factory=dict)  # call, parameters -> (n', k), the latest
    unsolved: dict[str, None] = field(default_factory=dict)  # parameters with values that are not finite, in words

    @cached_property
    def coefficients(self) -> tuple[Parameter, ...]:
        return self._numbers(known=False)

    @cached_property
    def nuisances(self) -> tuple[Parameter, ...]:
        return self._numbers(known=True)

    @cached_property
    def effects(self) -> tuple[Parameter, ...]:
        return tuple(effect.parameter for effect in self.model.effects)

    def _numbers(self, *, known: bool) -> tuple[Parameter, ...]:
        """List the numbers with a prior, or those without; what groups have of their own behind the others."""
        numbers = [number for number in self.model.numbers if (number.sigma is not None) == known]
        shared = [number.parameter for number in numbers if number.per is None]
        own = [number.of_groups(self.runs.groups(number.per)[1]) for number in numbers if number.per is not None]
        return (*shared, *chain.from_iterable(own))

    def everywhere(self, name: str, value: float) -> dict[str, float]:
        """Give one value to a parameter, or to all that groups have of it."""
        own = [of.name for of in (*self.coefficients, *self.nuisances) if of.of_group and of.of_group[0] == name]
        return dict.fromkeys(own or [name], value)

    @cached_property
    def calls(self) -> tuple[Call, ...]:
        """The runs of each call: all, or those of a trace, that have the same numbers of their own."""
        per = {number.name: number.per for number in self.model.numbers if number.per is not None}
        kinds = {kind: self.runs.groups(kind) for kind in {*per.values(), *(["trace"] if self.model.time else [])}}
        if not kinds:
            return (Call(np.arange(len(self.runs)), self.columns, {}),)
        each = np.stack([number for number, _ in kinds.values()], 1)
        calls = []
        for which in np.unique(each, axis=0).tolist():
            rows = np.flatnonzero((each == which).all(1))
            names = {kind: known[at] for at, (kind, (_, known)) in zip(which, kinds.items(), strict=True)}
            own = {name: f"{name} of {names[kind]}" for name, kind in per.items()}
            calls.append(Call(rows, self.columns.rows(rows), own))
        return tuple(calls)

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predict (P, n, k), see `ForwardModel`; angles within half a turn of what was measured."""
        return within_half_a_turn(
            self.returned(sets, title=title), self.runs.y if self.about is None else self.about, self.turns
        )

    def returned(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Compute what the function returns, scaled, (P, n, k), with a progress bar if it has a title."""
        bar = tqdm(sets, desc=title, unit="call", delay=1.0, leave=False, disable=not title or None)
        return np.reshape([self._predict(parameters) for parameters in bar], (len(sets), *self.runs.y.shape))

    @property
    def turns(self) -> Floats:
        """A whole turn of each output that is an angle, 0 of all others, (k,)."""
        return np.array([output.turn for output in self.model.outputs.values()])

    def _predict(self, parameters: Parameters) -> Floats:
        """Predict (n, k) by all calls."""
        prediction = np.full(self.runs.y.shape, np.nan)
        for place, call in enumerate(self.calls):
            if place and spent():  # as if it were not solved, so that many calls end within one
                break
            own = {name: parameters[of] for name, of in call.own.items() if of in parameters}
            given = {name: parameters.get(name, start) for name, start in (self._starts | own).items()}
            prediction[call.rows] = self._called(place, call, given)
        return prediction

    @cached_property
    def _starts(self) -> dict[str, float]:
        return {p.name: p.start for p in self.model.parameters}

    def _called(self, place: int, call: Call, values: Mapping[str, Any]) -> Floats:
        """Predict the runs of a call (n', k), by one for each combination of values that differ in it."""
        arrays = {name: value[call.rows] for name, value in values.items() if isinstance(value, np.ndarray)}
        differing = [name for name, value in arrays.items() if (value != value[0]).any()]
        plain = {**values, **{name: value[0].item() for name, value in arrays.items()}}
        if not differing:
            key = (place, *plain.values())
            if key not in self.known:
                self.known[key] = self._noted(evaluate(self.model, call.columns, plain), plain)
            found = self.known[key] = self.known.pop(key)  # the last of them
            while len(self.known) > _KEPT * len(self.calls):
                del self.known[next(iter(self.known))]
            return found
        every = np.stack([arrays[name] for name in differing], 1)
        kinds, kind = np.unique(every, axis=0, return_inverse=True)
        prediction = np.full((len(call.rows), self.runs.y.shape[1]), np.nan)
        for number, combination in enumerate(kinds.tolist()):
            if spent():
                break
            rows = kind.reshape(-1) == number
            one = plain | dict(zip(differing, combination, strict=True))
            prediction[rows] = self._noted(evaluate(self.model, call.columns.rows(rows), one), one)
        return prediction

    def _noted(self, prediction: Floats, values: Mapping[str, Any]) -> Floats:
        """Note the parameters if a prediction (n, k) is not finite; with NaN in it, it counts as not solved."""
        if (finite := np.isfinite(prediction)).all():
            return prediction
        self.unsolved[_in_words(values)] = None
        return np.where(finite, prediction, np.nan)

    @property
    def caveats(self) -> tuple[str, ...]:
        """Where the function gave no finite numbers, in words."""
        if not self.unsolved:
            return ()
        first, *others = self.unsolved
        more = f" and {len(others)} other sets of parameters" if others else ""
        return (f"the model's function gives no finite numbers with {first}{more}: nothing was fitted there",)

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return the linear model, by differences."""
        if self.turns.any():  # no step of a derivative ends a turn away
            self = replace(self, about=self.predict([at])[0])
        own = [p for p in along if p.of_group]
        if not own:
            return secants(self, at, along, title=title)
        # What all groups have of a number acts on different runs, so it is moved at once.
        declared = {
            n.name: n.parameter for n in self.model.numbers if n.name in {p.of_group[0] for p in own if p.of_group}
        }
        shared = [p for p in along if not p.of_group]
        of_runs = {**at, **{name: self._of_runs(name, at) for name in declared}}
        seen, slopes = by_differences(self, of_runs, [*shared, *declared.values()], title=title)
        place_of = {p.name: place for place, p in enumerate([*shared, *declared.values()])}
        columns = np.zeros((*seen.shape, len(along)))
        for place, p in enumerate(along):
            rows = slice(None) if p.of_group is None else self._rows_of[p.name]
            columns[rows, :, place] = slopes[rows, :, place_of[p.of_group[0] if p.of_group else p.name]]
        return linear(at, along, seen, columns)

    def _of_runs(self, name: str, at: Parameters) -> Floats:
        """Return what each run has of a number of groups, (n,)."""
        values = np.empty(len(self.runs))
        for call in self.calls:
            values[call.rows] = at[call.own[name]]
        return values

    @cached_property
    def _rows_of(self) -> dict[str, Integers]:
        """The runs of each number of a group."""
        rows: dict[str, list[Integers]] = {}
        for call in self.calls:
            for name in call.own.values():
                rows.setdefault(name, []).append(call.rows)
        return {name: np.concatenate(parts) for name, parts in rows.items()}

    def check(self, prediction: Floats) -> None:
        """Accept any prediction: `calibration.own_model.checks` has looked at it."""

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """Return the start as it is."""
        return start

    def possible(self) -> tuple[FunctionModel, list[dict[str, Any]]]:
        """Return a run for each of the table's conditions, with what the lab can set, named by its columns.

        Where specimens have numbers of their own, there is one of each specimen.
        """
        if self.runs.trace is not None:
            return self._possible_traces()
        names = [name.removeprefix("ln ") for name in self.runs.input_names]
        first = np.unique(self.runs.condition, return_index=True)[1]
        table = pd.DataFrame({name: values[first] for name, values in self.columns.items()}).assign(row=first)
        if any(number.per == "specimen" for number in self.model.numbers):
            number, known = self.runs.groups("specimen")
            table[_SPECIMEN] = [known[place] for place in number[first].tolist()]
            names = [_SPECIMEN, *names]
        for name, own in self.own.items():
            table = table.drop(columns=name).merge(pd.Series(own, name=name, dtype=float), how="cross")
        table = table.drop_duplicates(names)
        settings = [dict(zip(names, row, strict=True)) for row in table[names].itertuples(index=False, name=None)]
        runs = replace(
            self.runs.subset(table.pop("row").to_numpy()), condition=np.arange(len(table)),
            session=np.zeros(len(table), dtype=np.int64), session_names=(_NEXT,),
        )  # fmt: skip
        values = {name: table[name].to_numpy().astype(old.dtype) for name, old in self.columns.items()}
        return replace(self, runs=runs, columns=AskedColumns(values, self.columns.asked), known={}), settings

    def _possible_traces(self) -> tuple[FunctionModel, list[dict[str, Any]]]:
        """Return traces that can be made next (`calibration.own_model.possible_traces`), in one session."""
        names = [name.removeprefix("ln ") for name in self.runs.input_names[:-1]]
        known, longer = {name: self.columns[name] for name in names}, not self.turns.any()
        traces = possible_traces(self.runs, known, self.own, longer=longer)
        each, own = [len(trace.rows) for trace in traces], {str(self.model.time): [trace.time for trace in traces]}
        for name in self.own:
            own[name] = [np.full(len(trace.rows), trace.own[name]) for trace in traces]
        rows, changed = np.concatenate([trace.rows for trace in traces]), {}
        for name, column in self.columns.items():
            values = np.concatenate(own[name]) if name in own else column[rows]
            changed[name] = np.asarray(values).astype(column.dtype)
        number = np.repeat(np.arange(len(traces)), each)
        runs = replace(
            self.runs.subset(rows), condition=number, trace=number, time=changed[str(self.model.time)],
            trace_names=tuple(f"{_NEXT} {place}" for place in range(len(traces))), completion=None,
            session=np.zeros(len(rows), dtype=np.int64), session_names=(_NEXT,),
        )  # fmt: skip
        model = replace(self, runs=runs, columns=AskedColumns(changed, self.columns.asked), known={})
        return model, [trace.settings for trace in traces]


def evaluate(model: Model, columns: AskedColumns, parameters: Mapping[str, Any]) -> Floats:
    """Call a model's function once, and scale its outputs, (n, k): ratios as logarithms, differences as they are.

    Raises:
        InputError: the function fails, or an output is missing, is no number, or has another shape.
    """
    count, values = len(next(iter(columns.values()))), {name: float(value) for name, value in parameters.items()}
    count_predictions(count)
    try:
        with np.errstate(all="ignore"), waiting():
            returned = model.function(columns, values)
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        at = traceback.extract_tb(error.__traceback__)[-1]
        raise InputError(
            f"the model's function fails with {_in_words(values)}: {type(error).__name__}, {error} "
            f"({at.filename}, line {at.lineno})"
        ) from error
    if not isinstance(returned, Mapping):
        raise InputError(f"the model's function returns {type(returned).__name__}; return {{output: array (n,)}}")
    scaled = []
    for name, output in model.outputs.items():
        if name not in returned:
            raise InputError(f"the model's function returns no output {name!r}; it has {', '.join(returned)}")
        value = _real(name, returned[name], count)
        if value.shape not in ((), (count,)):
            raise InputError(f"the model's function returns {name!r} of shape {value.shape} for {count} rows; "
                             f"return one number for each row, ({count},)")  # fmt: skip
        value = np.broadcast_to(value, count)
        with np.errstate(all="ignore"):
            logarithm = np.where(value <= 0, NOT_ABOVE_0, np.log(value))
        scaled.append(logarithm if output.kind == "ratio" else value)
    return np.stack(scaled, 1)


def _real(name: str, value: Any, count: int) -> Floats:
    """Return an output as an array of real numbers, a Series by its index."""
    if isinstance(value, pd.Series) and len(value) == count:
        if set(value.index) != set(range(count)):
            raise InputError(
                f"the model's function returns {name!r} as a Series whose index does not number the {count} rows "
                "from 0; return an array"
            )
        value = value.sort_index()
    if np.ma.isMaskedArray(value) or np.iscomplexobj(value):
        kind = "complex numbers" if np.iscomplexobj(value) else "a masked array"
        raise InputError(f"the model's function returns {name!r} as {kind}; return a real number for each row")
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"the model's function returns {name!r} that is no array of numbers") from None


def _in_words(parameters: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in parameters.items())
