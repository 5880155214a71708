"""What repeated traces say without a model: one of them is not like its repeats.

The readings of m repeats are y_j(t) = f(t) + n_j(t), with a free curve f that they share, and β φ(t) more in one
trace. Four faults have a shape φ:

- drift, φ = t: the trace parts from its repeats in time;
- a clock that runs fast by the share β, φ = −t f′: what the trace reads at t happened at t/(1 + β);
- a step, φ = 1 from some reading on: something was moved;
- saturation: the trace ends with equal readings; its repeats, which go on, would not by chance (binomial tail).

Each trace may have its own start: a level, and where f varies more than repeats differ, a share of f and of f′,
for another amplitude or moment. So neither drift nor clock is told from the start along a straight f. The noise is
white and Ornstein-Uhlenbeck noise, alike in all traces, R = w I + (1 − w) exp(−|Δt|/τ).

Differences of repeats have a restricted likelihood ℓ (w, τ; φ), with β and the variance profiled, and an F-test of
β at each w and τ. The p-value is the largest over all w and τ whose ℓ is at most `_PLAUSIBLE` below the greatest
(after Berger and Boos 1994), times the number of tests; each kind of fault has the same share of the level. A
trace with a fault is left out, and the others are tested again. The shapes are those of the mean of the repeats,
which is independent of their differences.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse.csgraph import connected_components
from scipy.special import bdtrc, fdtrc, ndtri

from calibration.linear.memory import Memory
from calibration.table.between_repeats import SHARE_OF_LEVEL, Difference, span
from calibration.table.runs import Runs
from common.arrays import Flags, Floats, Integers
from common.units import split

_WHITE = (1.0, 0.7, 0.4, 0.2, 0.1, 0.03, 0.01, 0.001)  # w
_MEMORY = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 200.0)  # τ, in steps
_PLAUSIBLE = 2.0  # of ℓ
_KINDS = 4  # of faults
_FEWEST, _MOST = 8, 100  # readings of a trace that are compared; more are averaged in blocks
_LENGTH = 0.5  # least share of the longest repeat
_EDGE, _AT_ENDS = 3, 10  # fewest readings on each side of a step, and least share of them, its inverse
_CLEAR = 2.0  # standard deviation of f over that of a difference from which f is known
_ALIKE = 5.0  # logarithm of the ratio of p-values of faults that cannot be told apart
_FLAT, _GOES_ON = 6, 4  # fewest equal readings at an end, and fewest values of each repeat meanwhile
_TINY = 1e-300


class _Group(NamedTuple):
    """Repeats in an output, at the times that they share."""

    output: int
    traces: Integers  # (m,)
    time: Floats  # (T,)
    y: Floats  # (m, T) less their mean
    own: Floats  # (T, q) what a trace may have of its own
    shapes: Floats  # (T, S): drift, clock, steps


def differences_of_traces(runs: Runs, *, level: float) -> tuple[Difference, ...]:
    """Find traces that are not like their repeats, at the level of a claim of the model.

    Args:
        runs: as they were read, before anything makes their noise white.

    Returns:
        At most one for each trace; its `kind` is "saturation", "drift", "clock" or "step". The `size` is on the
        scale of y: by how much the repeats go on, the trace has parted from them at its end, or it steps. That of
        a clock is β.
    """
    level *= SHARE_OF_LEVEL
    outputs, good, found = range(len(runs.outputs)), np.ones(len(runs.trace_names), dtype=bool), []
    for j, flat in [each for k in outputs for each in _flat_ends(runs, k, good, level)]:
        if good[j]:
            found.append(flat)
            good[j] = False
    while tests := [test for k in outputs for test in _tests(_groups(runs, k, good))]:
        group, logarithm, F, p = min(tests, key=lambda test: float(test[1].min()))
        j, s = (int(place) for place in np.unravel_index(np.argmin(logarithm), logarithm.shape))
        if (least := float(p[j, s] * good.sum() * len(outputs))) > level:
            break
        alike = np.flatnonzero(logarithm[j] < logarithm[j, s] + _ALIKE)
        found.append(_difference(runs, group, j, s, float(F[j, s]), least, alike))
        good[group.traces[j]] = False
    return tuple(found)


def _flat_ends(runs: Runs, k: int, good: Flags, level: float) -> list[tuple[int, Difference]]:
    """Find traces that end with equal readings while their repeats go on; each with its number."""
    flat = []
    for traces, _, rows in _comparable(runs, k, good):
        for j, y in zip(traces.tolist(), table := runs.y[rows, k], strict=True):
            equal = y == y[-1]  # at an end of the scale noise may leave it for a reading
            at_end = y[-1] in (runs.y[:, k].min(), runs.y[:, k].max()) or equal.all()
            first = int(np.argmax(equal) if at_end else len(y) - np.argmin(equal[::-1]))
            others = table[traces != j, first:]
            if equal[first:].sum() < _FLAT or min(len(np.unique(each)) for each in others) < _GOES_ON:
                continue
            ties, pairs = int((np.diff(y[first:]) == 0).sum()), len(y) - first - 1
            tie = ((np.diff(others) == 0).sum() + 1) / (pairs * len(others) + 2)
            one = float(bdtrc(ties - 1, pairs, tie))
            if (p := one * _KINDS * len(good) * len(runs.outputs)) <= level:
                size, z = float((others[:, -1] - others[:, 0]).mean()), float(-ndtri(max(one, _TINY) / 2))
                where = f"from {_at(runs, runs.time[rows[0, first]])} on"  # type: ignore[index]
                of = runs.outputs[k], runs.trace_names[j], where, size, z, p
                flat.append((j, Difference(*of, kind="saturation")))
    return flat


def repeated_traces(runs: Runs, there: Flags | None = None) -> list[Integers]:
    """List the rows (m, T) of the readings that each set of repeated traces shares, in the order of time.

    A trace with less than half as many readings as the longest one is left out.

    Args:
        there: (n,) readings that count; default: all.
    """
    assert runs.trace is not None
    assert runs.time is not None
    rows = np.arange(len(runs)) if there is None else np.flatnonzero(there)
    row = np.full((len(runs.trace_names), int(runs.condition.max()) + 1), -1)
    row[runs.trace[rows[::-1]], runs.condition[rows[::-1]]] = rows[::-1]  # the first of several readings at a time
    has = (row >= 0).astype(float)
    label, repeated = connected_components(has @ has.T)[1], []
    for each in np.unique(label):
        traces = np.flatnonzero((label == each) & has.any(1))
        traces = traces[has[traces].sum(1) >= _LENGTH * has[traces].sum(1).max(initial=0.0)]
        shared = row[np.ix_(traces, np.flatnonzero(has[traces].all(0)))]
        if len(traces) > 1 and shared.size:
            repeated.append(shared[:, np.argsort(runs.time[shared].mean(0), kind="stable")])
    return repeated


def _comparable(runs: Runs, k: int, good: Flags) -> list[tuple[Integers, Floats, Integers]]:
    """List repeats among good traces: their numbers (m,), and the times (T,) and rows (m, T) that they share."""
    assert runs.trace is not None
    assert runs.time is not None
    comparable = []
    for rows in repeated_traces(runs, good[runs.trace] & ~runs.gaps[:, k]):
        time, first = np.unique(runs.time[rows].mean(0), return_index=True)
        if len(time) >= _FEWEST:
            comparable.append((runs.trace[rows[:, 0]], time, rows[:, first]))
    return comparable


def _groups(runs: Runs, k: int, good: Flags) -> list[_Group]:
    """Prepare repeats to be compared."""
    groups = []
    for traces, time, rows in _comparable(runs, k, good):
        blocks = np.array_split(np.arange(len(time)), min(len(time), _MOST))
        tables = (runs.y[rows, k], runs.time[rows] - time, time)  # type: ignore[index]
        y, off, t = (np.stack([table[..., b].mean(-1) for b in blocks], -1) for table in tables)
        slope = CubicSpline(t, y.mean(0)).derivative()(t)  # a difference quotient is too low along a wave
        y = y - slope * off  # to the times that they share
        curve, y = y.mean(0), y - y.mean(0)
        clear = curve.std() > _CLEAR * y.std(1).max()
        own = np.column_stack([np.ones_like(t), *((curve - curve.mean(), slope) if clear else ())])
        drift, clock = (t - t[0]) / (t[-1] - t[0]), -slope * (t - t[0]) * clear
        edge = max(_EDGE, len(t) // _AT_ENDS)
        shapes = np.column_stack([drift, clock, t[:, None] >= t[edge : len(t) - edge + 1]])
        groups.append(_Group(k, traces, t, y, span(own), shapes))
    return groups


def _tests(groups: list[_Group]) -> list[tuple[_Group, Floats, Floats, Floats]]:
    """Test every trace for every shape: with ln p, which sets an order where p is 0, with F and p, (m, S) each."""
    freedom = sum((len(g.traces) - 1) * (len(g.time) - g.own.shape[1]) for g in groups) - 1
    square, penalty, gains, tested = np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), [], []
    for g in groups:
        m, q, memories = len(g.traces), g.own.shape[1], _memories(g.time)
        columns = np.column_stack([g.own, g.shapes, g.y.T])
        white = np.stack([memory.whiten(columns) for memory in memories])  # (K, T, …)
        basis, triangle = np.linalg.qr(white[..., :q])
        left = white[..., q:] - basis @ (basis.mT @ white[..., q:])
        shapes, y = left[..., :-m], left[..., -m:]
        length = np.maximum((shapes**2).sum(1, keepdims=True) * (m - 1) / m, _TINY)
        logarithms = np.log(np.abs(np.diagonal(triangle, axis1=1, axis2=2))).sum(1)
        logarithms += [memory.log_determinant / 2 for memory in memories]
        square = square + (y**2).sum((1, 2), keepdims=True)
        penalty = penalty + 2 * (m - 1) * np.reshape(logarithms, (-1, 1, 1))
        gains.append(((y.mT @ shapes) ** 2 / length, np.log(length)))
    for g, (gain, length) in zip(groups, gains, strict=True):
        rest = np.maximum(square - gain, _TINY)
        likelihood = -0.5 * (freedom * np.log(rest) + penalty + length)
        F = np.where(likelihood > likelihood.max(0) - _PLAUSIBLE, gain / rest * freedom, np.inf).min(0)
        count = _KINDS * np.repeat([1, 1, F.shape[1] - 2], [1, 1, F.shape[1] - 2])
        logarithm = np.log(count) - 0.5 * freedom * np.log1p(F / freedom)
        tested.append((g, logarithm, F, count * fdtrc(1, freedom, F)))
    return tested


def _memories(time: Floats) -> list[Memory]:
    """List R at the times (T,), for every w and τ."""
    one, step = np.zeros(len(time), dtype=np.int64), float(np.median(np.diff(time)))
    pairs = [(w, tau) for w in _WHITE for tau in (_MEMORY if w < 1 else _MEMORY[:1])]
    return [Memory(one, time, 1 - w, step * tau) for w, tau in pairs]


def _difference(runs: Runs, group: _Group, j: int, s: int, F: float, p: float, alike: Integers) -> Difference:
    """Say what a trace differs by, with the shapes that fit it as well; of two repeats it may be the other one."""
    m, shape, kinds = len(group.traces), group.shapes[:, s], ("drift", "clock", "step")
    fitted = np.linalg.lstsq(np.column_stack([group.own, shape]), group.y[j], rcond=None)[0]
    where = ("from its beginning to its end", "all the time", f"at {_at(runs, group.time[np.argmax(shape)])}")
    name, against = runs.trace_names[group.traces[j]], runs.trace_names[group.traces[1 - j]] if m == 2 else ""
    of = runs.outputs[group.output], name, where[min(s, 2)], float(fitted[-1]) * m / (m - 1), float(np.sqrt(F)), p
    others = {kinds[min(i, 2)] for i in alike.tolist()} - {kinds[min(s, 2)]}
    return Difference(*of, against, kind=kinds[min(s, 2)], instead=tuple(sorted(others)))


def _at(runs: Runs, time: float) -> str:
    """Write a time: "300 s", or "t = 300" where its column has no unit."""
    quantity, unit = split(runs.time_name)
    return f"{time:.4g} {unit.text}" if unit else f"{quantity} = {time:.4g}"
