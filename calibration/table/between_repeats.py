"""What the runs say without a model: columns that contradict each other, and what repeats differ with.

**Identities.** Some outputs follow from others (`Runs.identities`). What is left of an identity is tested along
each setting, within sessions, and in the mean of the sessions, beyond `_TOLERANCE`, since a number of the model
may be off by so much in all runs.

**Between repeats.** A note of which the model knows nothing (an operator, a humidity, the angle of a camera by its
sine and cosine and by those of its double, the order of the runs) should not matter to a run. Let M take away what
repeats share, what sessions differ by, and what the model knows of the runs (course, temperature, time). Then M y
is regressed on M c, c being the columns of the note:

    F = (|P M y|²/a) / (|(1 − P) M y|²/b),   P onto the a columns M c, b degrees of freedom left.

The null distribution comes from M y permuted within repeats, then through M again (Freedman and Lane 1983). All
tests of a table are compared by p of an F-distribution, which resolves more than the draws do, and the least of
them is judged by the draws, which are the same for all outputs (Westfall and Young 1993). What is found joins M,
and the others are tested again. A note that M takes away with it is named in its place, too. No run is compared
with the model, so all runs take part, those too that are held out.

A session is no such note: numbers that differ in one are looked for with the model
(`calibration.attribution.moves`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from scipy.special import fdtrc, ndtri

from calibration.linear.gls import repeat_count, repeat_covariance
from calibration.table.reader import is_missing
from calibration.table.runs import FEWEST_REPEATS, Runs
from common.arrays import Flags, Floats, Integers
from common.errors import InputError

SHARE_OF_LEVEL = 0.25  # of the level of a claim: 1 % beside the 4 % of all tests with the model
ORDER = "order of the runs"
_DRAWS, _FEWEST_DRAWS = 999, 199
_VALUES = 10_000_000  # of all draws, where a table is long
_TOLERANCE = 0.02  # of an identity in all runs, and least break along a setting
_MOST_KINDS = 12  # of a note in words
_FREE = 0.05  # share of what a note differs by within sessions that M must leave
_FEWEST = 5  # degrees of freedom of what is left
_FAR, _MAD = 4.0, 1.4826  # residuals are clipped at so many robust standard deviations
_NONE, _TINY = 1e-9, 1e-300
_EQUAL = 1e-24  # variance of repeats that are equal, over the mean square


class NoteColumn(NamedTuple):
    """A note as numbers (n, a), each with a name; NaN where it was not noted."""

    note: str
    names: tuple[str, ...]  # (a,) of what its columns are for: "operator B", "humidity", "cos view_deg"
    table: Floats
    against: str = ""  # the kind to which those in words are compared
    of_reading: bool = False  # whether it is times what is read


@dataclass(frozen=True)
class Difference:
    """An identity that breaks, or an output that differs with a note between repeats."""

    output: str  # its name, or the identity in words
    column: str  # the note, or the setting along which an identity breaks; "" in all runs
    where: str  # in which runs it has the stated size
    size: float  # on the scale of y: from one kind to another, or from end to end; the amplitude over an angle
    z: float
    p: float  # of the whole table
    against: str = ""  # to what it is compared there
    of_reading: bool = False  # whether it is how such an offset follows what is read
    numbers: Mapping[str, Floats] = field(default_factory=dict)  # name of a number of the fit -> its column (n,)
    instead: tuple[str, ...] = ()  # notes that cannot be told from it
    kind: str = ""  # of a trace, see `calibration.table.between_traces`; `column` is its name


class _Test(NamedTuple):
    column: NoteColumn
    p: float  # of an F-distribution
    null: Floats  # (D,) the same of the draws


def refuse_equal_repeats(runs: Runs, repeated: Integers | Floats, columns: Sequence[str]) -> None:
    """Refuse an output that is the same in all repeats, from which its noise cannot be estimated."""
    variances = np.diag(repeat_covariance(runs.y, repeated))
    for place in np.flatnonzero(variances <= _EQUAL * np.mean(runs.y**2, 0))[:1].tolist():
        raise InputError(
            f"{columns[place]} is the same in all repeats; drop copies of rows, give unrounded values, or leave "
            "it out"
        )


def usable(values: Any) -> bool:
    """Tell whether a note can be tested: it differs, is no running number, and has few kinds if it is in words."""
    noted, there = _noted(values)
    kinds = np.unique(noted[there])
    if noted.dtype.kind == "U":
        return 1 < len(kinds) <= _MOST_KINDS
    steps = np.diff(noted[there])
    return len(kinds) > 1 and not (steps > 0).all() and not (steps < 0).all()


def _noted(values: Any) -> tuple[Any, Flags]:
    """Return a note as numbers or as words, (n,), and where there is one."""
    noted = np.asarray(values).astype(float if np.asarray(values).dtype.kind in "fiu" else str)
    return noted, ~is_missing(noted)


def columns_of(runs: Runs) -> list[NoteColumn]:
    """Make columns of every note, and of the order of the runs."""
    columns = []
    for note, values in {**{k: v for k, v in runs.notes.items() if usable(v)}, ORDER: runs.rows}.items():
        noted, there = _noted(values)
        if noted.dtype.kind == "U":
            kinds, count = np.unique(noted[there], return_counts=True)
            others = np.delete(kinds, np.argmax(count))
            table = np.where(there[:, None], noted[:, None] == others, np.nan)
            common = f"{note} {kinds[np.argmax(count)]}"
            columns.append(NoteColumn(note, tuple(f"{note} {kind}" for kind in others), table, common))
        elif note.endswith(("_deg", "_rad")):
            for turns, of in ((1, note), (2, f"2 {note}")):
                angle = turns * (np.radians(noted) if note.endswith("_deg") else noted)
                table = np.column_stack([np.cos(angle), np.sin(angle)])
                columns.append(NoteColumn(note, (f"cos {of}", f"sin {of}"), table))
        else:
            columns.append(NoteColumn(note, (note,), _from_end_to_end(noted[:, None])))
    return columns


def _from_end_to_end(values: Floats) -> Floats:
    """Scale values to −½ at the least and ½ at the largest."""
    low, high = np.nanmin(values), np.nanmax(values)
    return np.asarray((values - (low + high) / 2) / max(high - low, _TINY))


def find_differences(runs: Runs, *, level: float, seed: int = 0) -> tuple[Difference, ...]:
    """Find what differs between repeats, and identities that break, at the level of a claim of the model."""
    rng = np.random.default_rng(seed)
    keys = rng.random((min(max(_VALUES // len(runs), _FEWEST_DRAWS), _DRAWS), len(runs)))
    outputs, found, broken = range(len(runs.outputs)), [], []
    columns, taken = [columns_of(runs) for _ in outputs], [list[NoteColumn]() for _ in outputs]
    tests: dict[int | str, list[_Test]] = {n: _breaks(runs, d, keys, rng) for n, d in runs.identities.items()}
    tests |= {k: _of_output(runs, k, columns[k], [], keys) for k in outputs}
    while every := [(subject, test) for subject, of in tests.items() for test in of]:
        least = np.min([test.null for _, test in every], axis=0)
        subject, best = min(every, key=lambda each: each[1].p)
        p = float(1 + np.count_nonzero(least <= best.p)) / (1 + len(keys))
        if p > level * SHARE_OF_LEVEL:
            break
        z = float(-ndtri(max(best.p, _TINY) / 2))
        if isinstance(subject, str):
            del tests[subject]
            where, size = _broken(runs, runs.identities[subject], best.column.note)
            broken.append(Difference(subject, best.column.note, where, size, z, p))
            continue
        columns[subject] += _of_reading(runs, subject, best.column)
        again = _of_output(runs, subject, columns[subject], [*taken[subject], best.column], keys)
        before, left = ({test.column.note for test in of} for of in (tests[subject], again))
        lost = sorted(before - left - {best.column.note})
        found.append(_between(runs, subject, best.column, taken[subject], z, p, tuple(lost)))
        taken[subject].append(best.column)
        tests[subject] = again
    return (*broken, *found)


def _of_reading(runs: Runs, k: int, column: NoteColumn) -> list[NoteColumn]:
    """Let the offset of one kind follow what is read: make the column times the mean of the repeats' output."""
    if column.of_reading:
        return []
    read = runs.y[:, [k]] - _centred(runs.y[:, [k]], _repeats(runs, [])[0])  # means of repeats
    return [column._replace(table=column.table * _from_end_to_end(read), of_reading=True)]


def _repeats(runs: Runs, taken: Sequence[NoteColumn]) -> tuple[Integers, Floats]:
    """Number the repeats (n,), and make columns (n, c) of what they may differ by: sessions, and what is known."""
    known = [runs.session[:, None] == np.unique(runs.session), runs.inputs]
    known += [np.nan_to_num(column.table) for column in taken]
    if repeat_count(runs.condition) >= FEWEST_REPEATS:
        return runs.condition, np.column_stack(known)
    mirrored, direction = runs.mirrored
    specimen = np.zeros_like(mirrored) if runs.specimen is None else runs.specimen
    group = np.unique(np.column_stack([mirrored, specimen]), axis=0, return_inverse=True)[1].reshape(-1)
    return group, np.column_stack([*known, direction[:, None] * runs.inputs])


def _centred(table: Floats, group: Integers) -> Floats:
    """Take the mean of each group (n,) from columns (n, c)."""
    levels = (group[:, None] == np.unique(group)).astype(float)
    return np.asarray(table - levels @ ((levels.T @ table) / levels.sum(0)[:, None]))


def span(table: Floats) -> Floats:
    """Return an orthonormal basis of columns (n, c)."""
    lengths = np.sqrt((table**2).sum(0))
    scaled = np.where(lengths > 1e-9, table / np.maximum(lengths, 1e-9), 0.0)
    left, values, _ = np.linalg.svd(scaled, full_matrices=False)
    return np.asarray(left[:, values > 1e-6])


class _Left(NamedTuple):
    """What is left of an output in some rows, and in the draws, when M is done."""

    rows: Integers
    group: Integers
    session: Integers
    basis: Floats  # of what M takes beside the groups
    residual: Floats  # (m,)
    drawn: Floats  # (D, m)

    @classmethod
    def of(cls, y: Floats, there: Flags, session: Integers, group: Integers, known: Floats, keys: Floats) -> _Left:
        rows = np.flatnonzero(there)
        group = np.unique(group[rows], return_inverse=True)[1].reshape(-1)
        repeated = np.bincount(group)[group] > 1
        rows, group = rows[repeated], group[repeated]
        basis = span(_centred(known[rows], group))
        residual = _centred(y[rows, None], group)[:, 0]
        residual = residual - basis @ (basis.T @ residual)
        far = _FAR * _MAD * float(np.median(np.abs(residual))) if len(rows) else 0.0
        residual = np.clip(residual, -far, far) if far else residual
        order = np.argsort(group, kind="stable")
        places = np.empty((len(keys), len(rows)), dtype=np.int64)
        places[:, order] = np.argsort(keys[:, rows] + group, axis=1)
        drawn = residual[places]
        return cls(rows, group, session[rows], basis, residual, drawn - (drawn @ basis) @ basis.T)

    def column(self, table: Floats) -> Floats:
        """Do to columns (n, a) what was done to the output."""
        centred = _centred(table[self.rows], self.group)
        return np.asarray(centred - self.basis @ (self.basis.T @ centred))

    def test(self, of: NoteColumn) -> list[_Test]:
        """Test what is left along a column; nothing if too little of the column is left."""
        table, column = of.table, self.column(of.table)
        along = span(column)
        a = along.shape[1]
        b = len(self.rows) - len(np.unique(self.group)) - self.basis.shape[1] - a
        whole = float((_centred(table[self.rows], self.session) ** 2).sum())
        if not a or b < _FEWEST or (column**2).sum() <= max(_FREE * whole, _NONE):
            return []
        residuals = np.vstack([self.residual, self.drawn])
        taken = ((residuals @ along) ** 2).sum(1)
        rest = np.maximum((residuals**2).sum(1) - taken, _TINY)
        p = fdtrc(a, b, taken / a / (rest / b))
        return [_Test(of, float(p[0]), p[1:])]


def _of_output(
    runs: Runs, k: int, columns: list[NoteColumn], taken: list[NoteColumn], keys: Floats
) -> list[_Test]:
    """Test an output along every column, beside those that are taken."""
    group, known = _repeats(runs, taken)
    left: dict[bytes, _Left] = {}
    tests = []
    for column in columns:
        there = ~runs.gaps[:, k] & np.isfinite(column.table).all(1)
        key = there.tobytes()
        if key not in left:
            left[key] = _Left.of(runs.y[:, k], there, runs.session, group, known, keys)
        tests += left[key].test(column)
    return tests


def _between(
    runs: Runs, k: int, column: NoteColumn, taken: list[NoteColumn], z: float, p: float, instead: tuple[str, ...]
) -> Difference:
    """Measure how an output differs with a note, beside the notes in `taken`."""
    there, none = ~runs.gaps[:, k] & np.isfinite(column.table).all(1), np.empty((0, len(runs)))
    left = _Left.of(runs.y[:, k], there, runs.session, *_repeats(runs, taken), none)
    y = left.column(runs.y[:, [k]])[:, 0]
    sizes = np.linalg.lstsq(left.column(column.table), y, rcond=None)[0]
    largest = int(np.argmax(np.abs(sizes)))
    size, where = float(sizes[largest]), column.names[largest]
    if column.of_reading:
        where = f"more with {where} from its smallest to its largest value"
    elif column.note == ORDER:
        where = "from the first to the last run"
    elif not column.against and len(sizes) > 1:
        size, where = float(np.hypot(*sizes)), f"over {column.names[0].removeprefix('cos ')}"
    elif not column.against:
        where = f"from the least to the largest {column.note}"
    against = "" if column.of_reading else column.against
    times = " × reading" * column.of_reading
    columns = zip(column.names, np.nan_to_num(column.table).T, strict=True)
    numbers = {f"{runs.outputs[k]}, {name}{times}": values for name, values in columns}
    return Difference(
        runs.outputs[k], column.note, where, size, z, p, against, column.of_reading, numbers, instead
    )


def _breaks(runs: Runs, left: Floats, keys: Floats, rng: np.random.Generator) -> list[_Test]:
    """Test what is left of an identity (n,): along each setting, and in the mean of the sessions."""
    there = np.isfinite(left)
    of_runs = _Left.of(left, there, np.zeros_like(runs.session), runs.session, np.zeros((len(left), 1)), keys)
    tests = []
    for name, (values, _) in runs.settings.items():
        if np.ptp(values) > 0 and abs(_broken(runs, left, name)[1]) > _TOLERANCE:
            x = (values - values.mean()) / values.std()
            tests += of_runs.test(NoteColumn(name, (), np.column_stack([x, x**2])))
    means = np.array([left[there & (runs.session == s)].mean() for s in np.unique(runs.session[there])])
    if len(means) > 2:
        beyond = max(abs(float(means.mean())) - _TOLERANCE, 0.0)
        f = beyond**2 * len(means) / max(float(means.var(ddof=1)), _TINY)
        p = float(fdtrc(1, len(means) - 1, f))
        tests.append(_Test(NoteColumn("", (), left), p, rng.random(len(keys))))
    return tests


def _broken(runs: Runs, left: Floats, along: str) -> tuple[str, float]:
    """Say where what is left of an identity is large, and its mean there; see `Difference`.

    Along a setting it is beyond the value at which a step or a bend fits best.
    """
    there = np.isfinite(left)
    d = left[there]
    if not along:
        return "in all runs", float(d.mean())
    values, unit = runs.settings[along]
    x, ends = values[there], np.unique(values[there])[:-1]
    beyond = x[:, None] > ends
    bends = np.maximum(x[:, None] - ends, 0), np.maximum(np.unique(x)[1:] - x[:, None], 0)
    shapes = _centred(np.hstack([beyond.astype(float), *bends]), runs.session[there])
    gain = (shapes.T @ d) ** 2 / np.maximum((shapes**2).sum(0), _TINY)
    at = int(np.argmax(gain)) % len(ends)
    above, below = float(d[beyond[:, at]].mean()), float(d[~beyond[:, at]].mean())
    side, size = ("above", above) if abs(above) >= abs(below) else ("at most", below)
    return f"where {along} is {side} {ends[at]:.3g}{unit}", size
