"""The networks of the look-up table as compiled loops, one robot at a time.

`Packed` holds the numbers of a `surrogate.networks.ensemble.Ensemble` in one array. An operation on an array takes
about a microsecond, however short the array is. These loops take about two microseconds for a whole network.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.arrays import Floats, Integers
from sim.compiling import compiled
from surrogate.networks.blocks import BLOCK, block_room, evaluate_rows

_MAGIC = 6755399441055744.0  # 1.5 · 2^52: a small integer added to it stands in its lowest bits
_LOG2_E = 1.4426950408889634
_LN2 = 0.6931471805599453
_LARGEST = 20.0  # |x| from which tanh is 1 in double precision


class Packed(NamedTuple):
    """An ensemble for the loops."""

    numbers: Floats  # shift (F,), scale (F,), mean (O,), spread (O,); for each member weights, biases, linear map
    sizes: Integers  # (6,): where the numbers begin, F, O, width, depth, members

    def evaluate(self, x: Floats) -> Floats:
        """Return the mean of the members, (M, O), at inputs x (M, F)."""
        x = np.ascontiguousarray(x, dtype=float)
        y = np.empty((len(x), self.sizes[2]))
        rows = int(self.sizes[1] + self.sizes[2]) + block_room(self.sizes)
        room = np.empty(rows * BLOCK)
        evaluate_rows(self.numbers, self.sizes, len(self.numbers), len(x), x, y, room, rows)
        return y


def room_of(sizes: Integers) -> int:
    """Return how many numbers `evaluate` works in."""
    return int(sizes[1] + sizes[2] + 3 * sizes[3])


@compiled
def evaluate(numbers: Floats, sizes: Integers, x: Floats, y: Floats, room: Floats) -> None:
    """Write the mean of the members at inputs x (F,) to y (O,).

    Args:
        numbers, sizes: see `Packed`.
        room: to work in, see `room_of`.
    """
    at, inputs, outputs, width = sizes[0], sizes[1], sizes[2], sizes[3]
    first, total = room[:inputs], room[inputs : inputs + outputs]
    hidden = room[inputs + outputs : inputs + outputs + width]
    next_hidden = room[inputs + outputs + width : inputs + outputs + 2 * width]
    power = room[inputs + outputs + 2 * width : inputs + outputs + 3 * width]
    for i in range(inputs):
        first[i] = (x[i] - numbers[at + i]) / numbers[at + inputs + i]
    mean = at + 2 * inputs
    at = mean + 2 * outputs
    for j in range(outputs):
        total[j] = 0.0
    for _ in range(sizes[5]):
        at = _layer(numbers, at, first, hidden)
        _tanh(hidden, power)
        for _ in range(sizes[4] - 1):
            at = _layer(numbers, at, hidden, next_hidden)
            _tanh(next_hidden, power)
            hidden, next_hidden = next_hidden, hidden
        at = _layer(numbers, at, hidden, y)
        for i in range(inputs):
            for j in range(outputs):
                y[j] += first[i] * numbers[at + i * outputs + j]
        at += inputs * outputs
        for j in range(outputs):
            total[j] += y[j]
    for j in range(outputs):
        y[j] = total[j] / sizes[5] * numbers[mean + outputs + j] + numbers[mean + j]


@compiled
def _layer(numbers: Floats, at: int, x: Floats, y: Floats) -> int:
    """Write y = Wᵀ x + b with the numbers from place `at` on; return the place behind them."""
    n, m = len(x), len(y)
    for j in range(m):
        y[j] = numbers[at + n * m + j]
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
def _tanh(x: Floats, power: Floats) -> None:
    """Take tanh in place, exact to rounding: 1 − 2/(e^2x + 1), with e^r as its Taylor series for |r| < ln(2)/2.

    `power` is room of the same size.
    """
    n = len(x)
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
