"""A session in which one output is in another unit, or has the other sign, than in the rest of the table.

The runs y of a session are compared with x, the mean of the other sessions' means under the same conditions; where
few runs have such, both are compared with the prediction of the model as given. Of two sessions that one is named
which is farther from this prediction. The factor of a session is

    exp of the median of y − x       of a ratio, whose y is a logarithm,
    the median of y/x, weighted |x|  of a difference, such as an angle, which may cross zero,

and the latter is the regression through zero that leaves the least sum of |y − f x|. A factor between two units is
a slip where

- the runs of the session agree on it: its standard error is at most half of `_NEAR`;
- it is that between the units, to three standard deviations of a session, which scatters as a single run does
  (`calibration.linear.gls`), but not beyond `_NEAR`;
- no other output of the session has the same factor or its inverse, as a robot that moves ten times as fast would.

A factor of all runs against the model as given is no slip of a session: then the unit of the column is wrong, or
that of what the model returns.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from calibration.table.declared import Output
from calibration.table.runs import Runs
from common.arrays import Flags, Floats
from common.errors import InputError
from common.units import SLIPS, find_unit, guess_slip

_NEAR = math.log(1.08)  # distance of a factor from that between two units, as logarithms
_LIKEWISE = math.log(1.5)  # distance within which two outputs have the same factor
_FEWEST = 3  # runs of a session that are compared
_LEAST = 0.01  # standard deviation of a session
_MOST = 100.0  # logarithm that is looked at
_WITHOUT_UNIT = {100.0: ("number", "per cent"), 180 / math.pi: ("angle", "degrees")}  # factor -> kind, in words
_NEAR_START = 1.3  # factor between another unit and what is found
_FAR = 100.0  # factor between what was measured and the model with its start values


class Factor(NamedTuple):
    """By what an output of a session must be divided to agree with the others."""

    negative: bool
    logarithm: float
    scatter: float  # standard deviation of a run, relative
    error: float  # standard error of the logarithm

    @property
    def size(self) -> tuple[bool, float]:
        """How far it is from 1."""
        return self.negative, abs(self.logarithm)

    def less(self, other: Factor) -> Factor:
        """Divide by the factor of the others."""
        error, scatter = math.hypot(self.error, other.error), max(self.scatter, other.scatter)
        return Factor(self.negative != other.negative, self.logarithm - other.logarithm, scatter, error)

    def same(self, other: Factor) -> bool:
        """Tell whether another output has this factor, or its inverse."""
        return self.negative == other.negative and abs(self.size[1] - other.size[1]) < _LIKEWISE

    def slip(self) -> tuple[str, str] | None:
        """Return two units that this may be the factor between, larger numbers first; empty for a sign alone."""
        near = min(_NEAR, 3 * math.hypot(max(self.scatter, _LEAST), self.error))
        slips = SLIPS | ({1.0: ("", "")} if self.negative else {})
        return guess_slip(math.exp(min(self.size[1], _MOST)), slips, math.exp(near))


def refuse_unit_slips(runs: Runs, given: Floats) -> None:
    """Refuse runs of which a session has an output in another unit; `given` (n, k) is the model as given."""
    sessions = range(len(runs.session_names))
    factors = [[_compared(runs, given, i, s) for s in sessions] for i in range(len(runs.outputs))]
    for i, name in enumerate(runs.outputs):
        if runs.unit_checked.get(name):
            continue
        known = {s: f for s, f in enumerate(factors[i]) if f and f.error <= _NEAR / 2}
        if not known:
            continue
        blame = {s: _by_model(runs, given, i, runs.session == s) for s in known} if len(sessions) == 2 else known
        session = max(known, key=lambda s: (blame[s] or known[s]).size)
        found = known[session]
        others = (of[session] for of in factors if of is not factors[i])
        if (slip := found.slip()) is None or any(other and found.same(other) for other in others):
            continue
        there, elsewhere = slip if found.logarithm > 0 else slip[::-1]
        units = f", as if it were in {there} there and in {elsewhere} in those; convert it" * bool(there)
        sign = "; check its sign" if found.negative else ""
        override = "; if it is right, declare its Output with unit_checked=True" * (name in runs.unit_checked)
        factor = math.exp(found.logarithm) * (-1 if found.negative else 1)
        raise InputError(
            f"{name} of session {runs.session_names[session]} is {factor:.3g} times that of the other sessions"
            f"{units}{sign}{override}"
        )


def refuse_other_units(runs: Runs, given: Floats, outputs: Mapping[str, Output], starts: str) -> None:
    """Refuse outputs that are in another unit, or far from what a model gives with its `starts`, (n, k)."""
    for place, (name, output) in enumerate(outputs.items()):
        found, ratio = _by_model(runs, given, place, np.ones(len(runs), dtype=bool)), output.kind == "ratio"
        if not found or found.negative or not (ratio or found.error <= _NEAR / 2):
            continue
        factor, unit = float(np.exp(found.logarithm)), find_unit(output.unit)
        kinds = (unit.kind, "angle" if unit.suffix == "1" else "") if unit else ()
        slips = {of: words for of, (kind, words) in _WITHOUT_UNIT.items() if kind in kinds}
        if words := guess_slip(factor, slips, _NEAR_START):
            raise InputError(
                f"{name} is {factor:.3g} times what the model gives: the table seems to have {words}; convert "
                "the column or what the function returns, or give other start values"
            )
        if ratio and not 1 / _FAR < factor < _FAR:
            raise InputError(
                f"{name} is {factor:.3g} times what the model gives with its start values ({starts}): check the "
                f"units of both, and give start values that come within a factor of {_FAR:g}"
            )


def _compared(runs: Runs, given: Floats, output: int, session: int) -> Factor | None:
    """Compare an output of a session with the others; None if too few runs can be compared."""
    y, measured, here = runs.y[:, output], ~runs.gaps[:, output], runs.session == session
    others, logarithmic = measured & ~here, runs.outputs[output] not in runs.output_scales
    means = pd.Series(y[others]).groupby([runs.condition[others], runs.session[others]]).mean()
    x = means.groupby(level=0).mean().reindex(runs.condition).to_numpy()
    shared = here & measured & np.isfinite(x)
    if shared.sum() >= _FEWEST:
        return _factor(y[shared], x[shared], logarithmic=logarithmic)
    both = _by_model(runs, given, output, here), _by_model(runs, given, output, ~here)
    return both[0].less(both[1]) if both[0] and both[1] else None


def _by_model(runs: Runs, given: Floats, output: int, rows: Flags) -> Factor | None:
    rows = rows & ~runs.gaps[:, output]
    logarithmic = runs.outputs[output] not in runs.output_scales
    return _factor(runs.y[rows, output], given[rows, output], logarithmic=logarithmic)


def _factor(y: Floats, x: Floats, *, logarithmic: bool) -> Factor | None:
    """Return the factor that y (n,) has against x; None if there are too few values."""
    used = np.isfinite(x) if logarithmic else x != 0
    y, x = y[used], x[used]
    if len(y) < _FEWEST:
        return None
    ratios, weights = (y - x, np.ones(len(y))) if logarithmic else (y / x, np.abs(x))
    order = np.argsort(ratios)
    along = np.cumsum(weights[order])
    middle = float(ratios[order][np.searchsorted(along, along[-1] / 2)])
    deviation = 1.4826 * float(np.median(np.abs(ratios - middle) * weights))
    if logarithmic:
        return Factor(False, middle, deviation, 1.2533 * deviation / math.sqrt(len(y)))
    if middle == 0:
        return None
    scatter = deviation / abs(middle) / math.sqrt(float(np.mean(x**2)))
    return Factor(middle < 0, math.log(abs(middle)), scatter, 1.2533 * scatter / math.sqrt(len(y)))
