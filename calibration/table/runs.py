"""The runs of a table, ready to be compared: with each other, and with a model.

**Gaps.** A run may lack some of its outputs. Let T put S_mo S_oo⁻¹ r_o for what is missing (m) of a residual r,
from what was measured (o) of the same run. Then (T r)ᵀ S⁻¹ (T r) = r_oᵀ S_oo⁻¹ r_o: where T acts on residuals,
derivatives and drawn noise alike, least squares are those of the measured values alone, and nothing is filled in.
A run with a gap is no repeat of another one, so S is that of whole runs. The shift of a session is weighted as if
its runs were whole.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import Any, Self

import numpy as np
from scipy.special import fdtrc

from calibration.linear.gls import repeat_count, repeat_covariance
from calibration.linear.memory import Memory, NoiseOfTraces
from calibration.table.excluded import Excluded, count_of_rows, summary_of_excluded
from common.arrays import Flags, Floats, Integers

_DIFFER = 0.001  # p-value below which repeats differ with sessions or notes
FEWEST_REPEATS = 8  # runs, for a covariance from repeats alone
_LEAST_OF_A_DESIGN = 1.5  # degrees of freedom, per output, that a design of repeats must leave
_KINDS = 3  # values of an input of which some can predict the others
_CUBIC = 0.2  # share of a cube that lower powers must leave
_BLOCKS = 5  # of a trace, that are resampled


@dataclass(frozen=True)
class Runs:
    """Measured runs, ready to be compared: n runs of k outputs."""

    outputs: tuple[str, ...]  # (k,) names
    y: Floats  # (n, k), scaled so that errors are relative
    condition: Integers  # (n,) repeats share a number
    session: Integers  # (n,) 0, 1, …: runs made together
    session_names: tuple[str, ...]  # by number
    inputs: Floats  # (n, q) what was set or noted, scaled (some by logarithm)
    input_names: tuple[str, ...]  # (q,)
    rows: Integers  # (n,) numbers in the table, from 1
    excluded: tuple[Excluded, ...]  # rows and columns of the table
    caveats: tuple[str, ...]  # what these runs cannot show, in words
    _: KW_ONLY
    converted: tuple[str, ...] = ()  # columns that were renamed, converted, or are tested as groupings, in words
    weight: Floats | None = None  # (n,) variance of a run is S over it; None: 1
    completion: Floats | None = None  # T, (n, k, k); None: no gaps. y is arbitrary there
    sigma: Floats | None = None  # (k,) declared standard deviation of a run
    noise_known: bool = True  # not so if it was declared to be unknown
    specimen: Integers | None = None  # (n,) 0, 1, …: what was run; None: not noted
    specimen_names: tuple[str, ...] = ()  # by number
    notes: Mapping[str, Any] = field(default_factory=dict)  # column -> (n,), not of the model
    lines: Integers | None = None  # (n,) of the rows in the file; None: it has none
    output_titles: Mapping[str, str] = field(default_factory=dict)  # in words; default: the name
    # Factor and unit in which residuals are shown; default: per cent.
    output_scales: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    unit_checked: Mapping[str, bool] = field(default_factory=dict)  # outputs of which it may be declared
    differing: Floats | None = None  # (n, c) by which repeats were found to differ
    trace: Integers | None = None  # (n,) 0, 1, …: runs are readings of traces, sorted by trace, then by time
    trace_names: tuple[str, ...] = ()  # by number
    time: Floats | None = None  # (n,) of a reading
    time_name: str = "time"
    # Of the noise along traces. With it y is white along them, and so is what is predicted.
    memory: Memory | None = None
    noise_of_traces: NoiseOfTraces | None = None  # see `calibration.statistics.traces`
    heads: Flags | None = None  # (n,) see `left_out`
    states: Mapping[str, Floats] = field(default_factory=dict)  # (n,) of readings, beside the inputs

    @property
    def scale(self) -> Floats:
        """Root of the weights, (n,)."""
        return np.ones(len(self.y)) if self.weight is None else np.sqrt(self.weight)

    def __len__(self) -> int:
        return len(self.y)

    @property
    def along(self) -> Floats:
        """What a shift of all runs of a session is in each of them, (n,)."""
        return self.scale if self.memory is None else self.scale * self.memory.level

    def groups(self, kind: str) -> tuple[Integers, tuple[str, ...]]:
        """Number the traces, sessions or specimens of the runs, (n,), and name them."""
        number = getattr(self, kind)
        assert number is not None
        return number, getattr(self, f"{kind}_names")

    def raw(self, table: Floats) -> Floats:
        """Take the whitening from a table (n, …)."""
        return table if self.memory is None else self.memory.colour(table)

    def whitened(self, table: Floats) -> Floats:
        """Whiten a table (n, …) along traces."""
        return table if self.memory is None else self.memory.whiten(table)

    @property
    def plane(self) -> tuple[str, str] | None:
        """Outputs that are a place in a plane, which runs follow one another along; None: no such."""
        return None

    @property
    def parts(self) -> tuple[Integers, tuple[str, ...]] | None:
        """Number and name what is held out, (n,), where it is neither sessions nor blocks of them."""
        return None

    @property
    def blocks(self) -> tuple[Integers, tuple[str, ...]] | None:
        """Number and name what is left out in turn, (n,), where it is neither sessions nor blocks of them."""
        return None

    @property
    def pieces(self) -> list[tuple[slice, Runs]]:
        """Rows of one kind, and these as runs of their own outputs, in the order of rows and outputs."""
        return [(slice(len(self)), self)]

    def white_features(self, table: Floats) -> Floats:
        """Whiten features (n, f), which an output may follow, along traces."""
        return self.whitened(table)

    def scatter(self, run_covariance: Floats) -> Floats:
        """Return the standard deviation (k,) of a run, from the covariance (k, k) with which fits weigh it."""
        return np.sqrt(np.diag(run_covariance))

    def deviations(self, run_covariance: Floats, rows: Flags | slice = slice(None)) -> Floats:
        """Compute the standard deviation (k,) that the outputs of some rows have by noise alone, from S (k, k)."""
        return self.scatter(run_covariance)

    def left_out(self, rows: Flags) -> Flags:
        """Return runs (n,) less those to which a group's own numbers are fitted where it is left out."""
        return rows if self.heads is None else rows & ~self.heads

    @property
    def together(self) -> Integers:
        """Number what is left out together, (n,): conditions, or traces."""
        return self.condition if self.trace is None else self.trace

    @property
    def made_at_once(self) -> Integers:
        """Number what a lab makes at once, (n,): runs, traces or swims."""
        return np.arange(len(self)) if self.trace is None else self.trace

    @property
    def resampled(self) -> Integers:
        """Number what is resampled, (n,): conditions, or a fifth of a trace."""
        if self.trace is None:
            return self.condition
        first, count = np.unique(self.trace, return_index=True, return_counts=True)[1:]
        place = np.arange(len(self)) - np.repeat(first, count)
        return np.asarray(self.trace * _BLOCKS + place * _BLOCKS // np.repeat(count, count))

    @property
    def traces_are_sessions(self) -> bool:
        """Whether no session has two traces."""
        return self.trace is not None and len(np.unique(self.trace)) == len(np.unique(self.session))

    @property
    def known_covariance(self) -> Floats | None:
        """S, (k, k), where it is not estimated from runs."""
        if self.noise_of_traces is not None:
            return self.noise_of_traces.run_covariance
        return None if self.sigma is None else np.diag(self.sigma**2)

    def noise(self, rows: Flags) -> tuple[Floats, float]:
        """Estimate S (k, k) from the runs in `rows`, with its degrees of freedom, unless it is declared."""
        if self.noise_of_traces is not None:
            return self.noise_of_traces.run_covariance, self.noise_of_traces.freedom
        if self.sigma is not None:
            return np.diag(self.sigma**2), math.inf
        repeats = self.repeats(rows)
        return repeat_covariance(self.y[rows], repeats, self.scale[rows]), repeat_count(repeats)

    def guessed_noise(self, rows: Flags, residual: Floats) -> dict[str, Any]:
        """Return what to change in runs whose noise is unknown: a guess from a residual (n, k) in `rows`."""
        if self.noise_known and (self.sigma is not None or self.repeated(rows)):
            return {}
        freedom = 0 if self.sigma is not None else repeat_count(self.repeats(rows))
        if self.sigma is not None or freedom >= self.y.shape[1]:
            return {"noise_known": False}
        spread = residual[rows].std(0)
        return {"noise_known": False, "sigma": np.where(spread > 0, spread, 1.0)}

    def repeated(self, rows: Flags | slice) -> bool:
        """Tell whether there are repeats, or mirror runs in their place, from which the noise can be estimated."""
        if repeat_count(self.repeat_ids[rows]) >= FEWEST_REPEATS or not self.mirrored[1][rows].any():
            return repeat_count(self.repeat_ids[rows]) >= FEWEST_REPEATS
        return repeat_count(np.column_stack([self._mirror_design(rows), self._alone(rows)])) >= FEWEST_REPEATS

    def _alone(self, rows: Flags | slice) -> Floats:
        """Make a level for each run with a gap."""
        return np.equal.outer(np.arange(len(self)), np.flatnonzero(self.gaps.any(1)))[rows].astype(float)

    @property
    def gaps(self) -> Flags:
        """Outputs that were not measured, (n, k)."""
        if self.completion is None:
            return np.zeros(self.y.shape, dtype=bool)
        return np.asarray(np.diagonal(self.completion, axis1=1, axis2=2) == 0)

    @property
    def repeat_ids(self) -> Integers:
        """The condition (n,); a run with a gap has one of its own."""
        own = self.condition.max() + 1 + np.arange(len(self))
        return np.where(self.gaps.any(1), own, self.condition)

    def values(self, rows: Flags) -> int:
        """Count the measured values of some runs (n,)."""
        return int((~self.gaps[rows]).sum())

    def completed(self, table: Floats) -> Floats:
        """Multiply a table (..., n, k) with T."""
        return table if self.completion is None else np.einsum("nab,...nb->...na", self.completion, table)

    def compared(self, prediction: Floats) -> Floats:
        """Change a prediction (..., n, k) at gaps so that y less it is T times what it was."""
        return prediction if self.completion is None else self.y + self.completed(prediction - self.y)

    def title_of(self, output: str) -> str:
        """Return the words for an output."""
        return self.output_titles.get(output, output)

    def scale_of(self, output: str) -> tuple[float, str]:
        """Return the factor and the unit in which residuals of an output are shown."""
        return self.output_scales.get(output, (100.0, "%"))

    def row_name(self, place: int) -> str:
        """Name the row of a run, from 0, in the table, and its line in the file if it has one."""
        return f"row {self.rows[place]}" + (f" (line {self.lines[place]})" if self.lines is not None else "")

    def repeats(self, rows: Flags | slice = slice(None)) -> Integers | Floats:
        """Tell what is the same in repeats among some rows, by these alone: the condition (n',), or a design.

        A design (n', m) is taken where repeats differ otherwise, too: levels of condition and session, and what
        was noted (`noted_of_repeats`) or found (`differing`). Repeats in several sessions differ by what changed
        between these, which is no noise of a run. Where fewer than `FEWEST_REPEATS` runs are repeated, mirror runs
        serve as repeats, but for what is odd and linear in the inputs; without them the noise is unknown, and
        what is smooth in the inputs is not counted with it.
        """
        session, noted = self.session[rows], self.noted_of_repeats[rows]
        condition = self.repeat_ids[rows]
        if self.trace is not None:  # their noise is not estimated from rows
            return condition
        alone = self._alone(rows)
        differing = np.empty((len(condition), 0)) if self.differing is None else self.differing[rows]
        if (count := repeat_count(condition)) < FEWEST_REPEATS:
            designs = [np.column_stack([_levels(session), features(self, rows)[1][rows], alone, differing])]
            if self.mirrored[1][rows].any():
                designs.insert(0, np.column_stack([self._mirror_design(rows), alone, differing]))
            return next((d for d in designs if repeat_count(d) >= max(FEWEST_REPEATS, count)), condition)
        crossed = len(np.unique(np.stack([condition, session]), axis=1).T) > len(np.unique(condition))
        levels = [_levels(f) for f in ((condition, session) if crossed else (condition,))]
        plain = np.column_stack([levels[0], differing]) if differing.size else condition
        if not crossed and not noted.size:
            return plain
        design = np.column_stack([*levels, noted, differing])
        each = [np.where(level[:, None], noted, 0.0) for level in levels[-1].T.astype(bool)] if crossed else []
        for further in (design, np.column_stack([design, *each])):  # what is noted may act otherwise in a session
            # An S of few degrees of freedom would make the null distribution of every test too wide.
            enough = repeat_count(further) >= _LEAST_OF_A_DESIGN * self.y.shape[1]
            if enough and _differ_more(self.y[rows], plain, further):
                plain = further
        return plain

    def _mirror_design(self, rows: Flags | slice) -> Floats:
        """Make levels of mirrored conditions and sessions, and the direction, alone and times each input."""
        mirrored, direction = self.mirrored
        odd = direction[rows, None] * np.column_stack([np.ones(len(self)), self.inputs])[rows]
        return np.column_stack([_levels(mirrored[rows]), _levels(self.session[rows]), odd])

    @property
    def least_surviving(self) -> float:
        """The share of an effect's signal that fitted numbers must leave for a test of the effect."""
        return 0.03

    @property
    def stretches(self) -> str:
        """What is left out together, in a word."""
        return "conditions"

    @property
    def subject(self) -> str:
        """What the runs are of, in a word: "model", or "robot"."""
        return "model"

    @property
    def row(self) -> str:
        """What a row is, in a word: "run", "reading" of a trace, or "pose"."""
        return "run" if self.trace is None else "reading"

    def nearer(self, used: Flags) -> list[Flags]:
        """List sets of runs (n,) among `used` at one end of the settings; a claim must carry over to the rest.

        Of each input of three values or more, those up to the median.
        """
        columns = self.inputs.T.round(9)
        kinds = [np.unique(column[used]) for column in columns]
        several = [(c, float(np.median(k))) for c, k in zip(columns, kinds, strict=True) if len(k) >= _KINDS]
        return [used & (column <= middle) for column, middle in several]

    @property
    def mirrored(self) -> tuple[Integers, Floats]:
        """Number the conditions (n,), mirror images alike, and return the direction ±1 of each run, (n,)."""
        return self.condition, np.zeros(len(self))

    @property
    def noted_of_repeats(self) -> Floats:
        """Notes (n, c) in which repeats may differ."""
        return np.empty((len(self), 0))

    @property
    def partners(self) -> Floats:
        """Settings (n, q) that runs must share so that a shift between them is no effect of a setting."""
        return self.inputs if self.trace is None else self.inputs[:, :-1]  # but for the time

    @property
    def settings(self) -> dict[str, tuple[Floats, str]]:
        """What was set or noted, as people read it: name -> values (n,) and unit."""
        return {name: (column, "") for name, column in zip(self.input_names, self.inputs.T, strict=True)}

    @property
    def drawn(self) -> tuple[str, tuple[str, Integers, tuple[str, ...]]]:
        """What residuals are drawn against: a setting; and the kinds in colour: a name, (n,), and their names."""
        return next(iter(self.settings)), ("session", self.session, self.session_names)

    @property
    def identities(self) -> Mapping[str, Floats]:
        """What is 1 for true columns, in words -> its logarithm in each run, (n,); NaN where it is unknown."""
        return {}

    def with_outputs(self, kept: Sequence[int]) -> Self:
        """Keep some outputs, and let those of a run stand for the one that it lacks (`completion`)."""
        gaps = self.gaps[:, kept]
        names, completion = tuple(self.outputs[i] for i in kept), without_gaps(gaps)
        runs = replace(self, outputs=names, y=self.y[:, kept], completion=completion if gaps.any() else None)
        if gaps.any() and repeat_count(runs.repeats()) >= FEWEST_REPEATS:
            run = repeat_covariance(runs.y, runs.repeats())
            for T, gap in zip(completion, gaps, strict=True):
                T[np.ix_(gap, ~gap)] = np.linalg.solve(run[np.ix_(~gap, ~gap)], run[np.ix_(~gap, gap)]).T
        return runs

    def subset(self, rows: Flags | Integers) -> Any:
        """Choose the runs in `rows`: flags (n,), or places."""
        of_runs = {k: v for k, v in vars(self).items() if isinstance(v, np.ndarray) and k != "sigma"}
        arrays: dict[str, Any] = {k: v[rows] for k, v in of_runs.items()}
        of_names: dict[str, Any] = {
            key: {name: values[rows] for name, values in getattr(self, key).items()} for key in ("notes", "states")
        }
        return replace(self, **arrays, **of_names)


def without_gaps(gaps: Flags) -> Floats:
    """Make `Runs.completion` of gaps (n, k) for which nothing stands."""
    return np.eye(gaps.shape[1]) * ~gaps[:, :, None]


def lines_of_excluded(runs: Runs) -> list[str]:
    """Say what of the table is not used, a line for each reason."""
    total = len(runs) + count_of_rows(runs.excluded)
    return [f"excluded: {line}" for line in summary_of_excluded(runs.excluded, total)]


def _levels(factor: Integers) -> Floats:
    """Make one column of ones and zeros for each level of a factor (n,)."""
    return (factor[:, None] == np.unique(factor)).astype(float)


def _differ_more(y: Floats, condition: Integers | Floats, design: Floats) -> bool:
    """Tell by F-tests of the outputs (n, k) whether a design of repeats takes more from them than noise allows."""
    plain, further = repeat_count(condition), repeat_count(design)
    if further < 1 or plain == further:
        return False
    with_design = np.diag(repeat_covariance(y, design)) * further
    taken = np.diag(repeat_covariance(y, condition)) * plain - with_design
    ratio = taken / (plain - further) / np.maximum(with_design / further, 1e-300)
    return bool(fdtrc(plain - further, further, ratio).min() < _DIFFER / len(ratio))


def features(runs: Runs, used: Flags | slice) -> tuple[tuple[str, ...], Floats]:
    """Name and compute the inputs that differ, their squares, products and cubes for all runs, (n, f).

    Standardised on the runs in `used` (n,). Those of one kind of rows are 0 in the others.
    """
    if len(runs.pieces) > 1:
        columns_of: dict[str, Floats] = {}
        for rows, kind in runs.pieces:
            of_kind, table = features(kind, used[rows] if isinstance(used, np.ndarray) else used)
            for name, column in zip(of_kind, table.T, strict=True):
                columns_of.setdefault(name, np.zeros(len(runs)))[rows] = column
        return tuple(columns_of), np.stack(list(columns_of.values()), 1)
    given = np.column_stack([runs.inputs, *runs.states.values()])
    spread = given[used].std(0)
    varied = np.flatnonzero(spread > 1e-9).tolist()
    inputs = (given[:, varied] - given[used][:, varied].mean(0)) / spread[varied]
    given_names = (*runs.input_names, *runs.states)
    names, columns = [given_names[i] for i in varied], list(inputs.T)
    for i in range(len(varied)):
        for j in range(i, len(varied)):
            product = inputs[:, i] * inputs[:, j]
            if product[used].std() > 1e-9:
                names.append(f"{names[i]} × {names[j]}" if i != j else f"({names[i]})²")
                columns.append((product - product[used].mean()) / product[used].std())
    for i, column in zip(varied, inputs.T, strict=True):
        lower = np.stack([np.ones_like(column), column, column**2], 1)
        weights = np.linalg.lstsq(lower[used], column[used] ** 3, rcond=None)[0]
        cube = column**3 - lower @ weights  # beyond lower powers; little for two or three levels
        if cube[used].std() > _CUBIC * (column[used] ** 3).std():
            names.append(f"({given_names[i]})³")
            columns.append(cube / cube[used].std())
    return tuple(names), np.stack(columns, 1) if columns else np.empty((len(runs), 0))
