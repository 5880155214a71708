"""The networks of the look-up table as compiled loops, one robot at a time.

`Packed` holds the numbers of a `surrogate.networks.ensemble.Ensemble` in one array. An operation on an array takes
about a microsecond, however short the array is. These loops take about two microseconds for a whole network.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled

_MAGIC = 6755399441055744.0  # 1.5 · 2^52: a small integer added to it stands in its lowest bits
_LOG2_E = 1.4426950408889634
_LN2 = 0.6931471805599453
_LARGEST = 20.0  # |x| from which tanh is 1 in double precision


class Packed(NamedTuple):
    """An ensemble for the loops."""

    shift: Floats  # (F,)
    scale: Floats  # (F,)
    mean: Floats  # (O,)
    spread: Floats  # (O,)
    numbers: Floats  # of each member: weights and biases layer by layer, then the linear map
    width: int
    depth: int
    members: int


@compiled
def evaluate_rows(network: Packed, x: Floats) -> Floats:
    """Return the mean of the members, (M, O), at inputs x (M, F)."""
    y = np.empty((len(x), len(network.mean)))
    for row in range(len(x)):
        evaluate(network, x[row], y[row])
    return y


@compiled
def evaluate(network: Packed, x: Floats, y: Floats) -> None:
    """Write the mean of the members at inputs x (F,) to y (O,)."""
    inputs, outputs, width = len(x), len(y), network.width
    first, total = (x - network.shift) / network.scale, np.zeros(outputs)
    hidden, next_hidden = np.empty(width), np.empty(width)
    at = 0
    for _ in range(network.members):
        at = _layer(network.numbers, at, first, hidden)
        _tanh(hidden)
        for _ in range(network.depth - 1):
            at = _layer(network.numbers, at, hidden, next_hidden)
            _tanh(next_hidden)
            hidden, next_hidden = next_hidden, hidden
        at = _layer(network.numbers, at, hidden, y)
        for i in range(inputs):
            for j in range(outputs):
                y[j] += first[i] * network.numbers[at + i * outputs + j]
        at += inputs * outputs
        total += y
    for j in range(outputs):
        y[j] = total[j] / network.members * network.spread[j] + network.mean[j]


@compiled
def _layer(numbers: Floats, at: int, x: Floats, y: Floats) -> int:
    """Write y = Wᵀ x + b with the numbers from place `at` on; return the place behind them."""
    n, m = len(x), len(y)
    y[:] = numbers[at + n * m : at + n * m + m]
    whole = n - n % 4
    for i in range(0, whole, 4):
        a, b = numbers[at + i * m : at + (i + 1) * m], numbers[at + (i + 1) * m : at + (i + 2) * m]
        c, d = numbers[at + (i + 2) * m : at + (i + 3) * m], numbers[at + (i + 3) * m : at + (i + 4) * m]
        for j in range(m):
            y[j] += x[i] * a[j] + x[i + 1] * b[j] + x[i + 2] * c[j] + x[i + 3] * d[j]
    for i in range(whole, n):
        row = numbers[at + i * m : at + (i + 1) * m]
        for j in range(m):
            y[j] += x[i] * row[j]
    return at + n * m + m


@compiled
def _tanh(x: Floats) -> None:
    """Take tanh in place, exact to rounding: 1 − 2/(e^2x + 1), with e^r as its Taylor series for |r| < ln(2)/2."""
    n = len(x)
    power = np.empty(n)
    shifted = power.view(np.int64)
    for j in range(n):
        x[j] = 2 * min(max(x[j], -_LARGEST), _LARGEST)
        power[j] = np.floor(x[j] * _LOG2_E + 0.5)
    for j in range(n):
        r = x[j] - power[j] * _LN2
        s = 1 / 479001600.0
        s = s * r + 1 / 39916800.0
        s = s * r + 1 / 3628800.0
        s = s * r + 1 / 362880.0
        s = s * r + 1 / 40320.0
        s = s * r + 1 / 5040.0
        s = s * r + 1 / 720.0
        s = s * r + 1 / 120.0
        s = s * r + 1 / 24.0
        s = s * r + 1 / 6.0
        s = s * r + 0.5
        s = s * r + 1.0
        x[j] = s * r + 1.0
        power[j] += _MAGIC
    for j in range(n):
        shifted[j] = (shifted[j] + 1023) << 52
    for j in range(n):
        x[j] = 1 - 2 / (x[j] * power[j] + 1)
