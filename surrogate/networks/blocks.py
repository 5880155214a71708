"""The networks of the look-up table as compiled loops, a block of robots at a time.

The numbers of a block are rows of BLOCK numbers, one for each robot. So each step of a network is a product of a
matrix and a block, and the innermost loops run over robots: the compiler makes vector instructions of them. A
robot takes about a quarter of the time that it takes alone (`surrogate.networks.compiled`), in single precision
half of that. No robot's numbers depend on the others of its block.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.arrays import Floats, Integers
from sim.compiling import compiled
from sim.object_code import COUNT, FLOATS, INTEGERS, array_at, kept

BLOCK = 32  # robots
_MAGIC = 6755399441055744.0  # 1.5 · 2^52: a small integer added to it stands in its lowest bits
_MAGIC_SINGLE = 12582912.0  # 1.5 · 2^23
_LOG2_E = 1.4426950408889634
_LN2 = 0.6931471805599453
_LARGEST, _LARGEST_SINGLE = 20.0, 9.5  # |x| from which tanh is 1 within rounding


def block_room(sizes: Integers) -> int:
    """Return how many rows of BLOCK numbers `evaluate_block` works in."""
    return int(sizes[1] + sizes[2] + 2 * sizes[3])


def in_single_precision(numbers: Floats) -> Floats:
    """Return the memory of numbers (K,) in single precision, as an array of half as many doubles."""
    singles = np.zeros(len(numbers) + len(numbers) % 2, dtype=np.float32)
    singles[: len(numbers)] = numbers
    return singles.view(np.float64)


@kept(FLOATS, INTEGERS, COUNT, COUNT, FLOATS, FLOATS, FLOATS, COUNT)
def evaluate_rows(numbers: Any, sizes: Any, many: int, count: int, x: Any, y: Any, room: Any, space: int) -> None:
    """Write the mean of the members at inputs x (M, F) to y (M, O).

    Args:
        numbers, sizes: see `surrogate.networks.compiled.Packed`; so many numbers.
        room: to work in, so many rows of BLOCK: F + O + `block_room`.
    """
    shape, network = array_at(sizes, 6), array_at(numbers, many)
    inputs, outputs = array_at(x, (count, shape[1])), array_at(y, (count, shape[2]))
    work = array_at(room, (space, BLOCK))
    block, answer, rest = work[: shape[1]], work[shape[1] : shape[1] + shape[2]], work[shape[1] + shape[2] :]
    for begin in range(0, count, BLOCK):
        for b in range(BLOCK):
            row = min(begin + b, count - 1)
            for i in range(shape[1]):
                block[i, b] = inputs[row, i]
        evaluate_block(network, shape, block, answer, rest)
        for b in range(min(BLOCK, count - begin)):
            for i in range(shape[2]):
                outputs[begin + b, i] = answer[i, b]


@compiled
def evaluate_block(numbers: Floats, sizes: Integers, x: Floats, y: Floats, room: Floats) -> None:
    """Write the mean of the members at inputs x (F, BLOCK) to y (O, BLOCK).

    Args:
        numbers, sizes: see `surrogate.networks.compiled.Packed`.
        room: to work in, (R, BLOCK), see `block_room`.
    """
    at, inputs, outputs, width = sizes[0], sizes[1], sizes[2], sizes[3]
    mean = at + 2 * inputs
    first, answer = room[:inputs], room[inputs : inputs + outputs]
    hidden = room[inputs + outputs : inputs + outputs + width]
    next_hidden = room[inputs + outputs + width : inputs + outputs + 2 * width]
    for i in range(inputs):
        shift, scale, row, scaled = numbers[at + i], numbers[at + inputs + i], x[i], first[i]
        for b in range(BLOCK):
            scaled[b] = (row[b] - shift) / scale
    at = mean + 2 * outputs
    for member in range(sizes[5]):
        at = layer(numbers, at, inputs, width, first, hidden)
        for i in range(width):
            tanh_row(hidden[i])
        for _ in range(sizes[4] - 1):
            at = layer(numbers, at, width, width, hidden, next_hidden)
            for i in range(width):
                tanh_row(next_hidden[i])
            hidden, next_hidden = next_hidden, hidden
        at = _last_layers(numbers, at, inputs, width, outputs, first, hidden, answer)
        for j in range(outputs):
            total, row = y[j], answer[j]
            if member == 0:
                for b in range(BLOCK):
                    total[b] = 0.0
            for b in range(BLOCK):
                total[b] += row[b]
    for j in range(outputs):
        factor, shift, row = numbers[mean + outputs + j] / sizes[5], numbers[mean + j], y[j]
        for b in range(BLOCK):
            row[b] = row[b] * factor + shift


@compiled
def evaluate_roughly(numbers: Floats, singles: Any, sizes: Integers, x: Floats, y: Floats, room: Floats) -> None:
    """Write the answer of a network of one member at x (F, BLOCK) to y (O, BLOCK), in single precision.

    Args:
        numbers, sizes: see `surrogate.networks.compiled.Packed`.
        singles: the same numbers in single precision.
        room: to work in, (R, BLOCK) of doubles, see `block_room`.
    """
    at, inputs, outputs, width = sizes[0], sizes[1], sizes[2], sizes[3]
    mean = at + 2 * inputs
    work = room.view(np.float32)
    first, answer = work[:inputs], work[inputs : inputs + outputs]
    hidden = work[inputs + outputs : inputs + outputs + width]
    next_hidden = work[inputs + outputs + width : inputs + outputs + 2 * width]
    for i in range(inputs):
        shift, scale, row, scaled = numbers[at + i], numbers[at + inputs + i], x[i], first[i]
        for b in range(BLOCK):
            scaled[b] = (row[b] - shift) / scale
    at = mean + 2 * outputs
    at = layer(singles, at, inputs, width, first, hidden)
    for i in range(width):
        _tanh_roughly(hidden[i])
    for _ in range(sizes[4] - 1):
        at = layer(singles, at, width, width, hidden, next_hidden)
        for i in range(width):
            _tanh_roughly(next_hidden[i])
        hidden, next_hidden = next_hidden, hidden
    _last_layers(singles, at, inputs, width, outputs, first, hidden, answer)
    for j in range(outputs):
        factor, shift, row, total = numbers[mean + outputs + j], numbers[mean + j], answer[j], y[j]
        for b in range(BLOCK):
            total[b] = row[b] * factor + shift


@compiled
def _last_layers(
    numbers: Any, at: int, inputs: int, width: int, outputs: int, first: Any, hidden: Any, y: Any
) -> int:
    """Write the last layer's answer and that of the linear map from the inputs; return the place behind them."""
    at = layer(numbers, at, width, outputs, hidden, y)
    for j in range(outputs):
        total = y[j]
        for i in range(inputs):
            weight, row = numbers[at + i * outputs + j], first[i]
            for b in range(BLOCK):
                total[b] += row[b] * weight
    return at + inputs * outputs


@compiled
def layer(numbers: Any, at: int, inputs: int, outputs: int, x: Any, y: Any) -> int:
    """Write y = Wᵀ x + b of a block with the numbers from place `at` on; return the place behind them.

    Four rows of x and four of y are taken together, so that most numbers stay in registers.
    """
    together = inputs - inputs % 4
    biases = at + inputs * outputs
    for j in range(0, outputs - outputs % 4, 4):
        y0, y1, y2, y3 = y[j], y[j + 1], y[j + 2], y[j + 3]
        bias = numbers[biases + j : biases + j + 4]
        p, q, r, s = bias[0], bias[1], bias[2], bias[3]
        for b in range(BLOCK):
            y0[b], y1[b], y2[b], y3[b] = p, q, r, s
        for i in range(0, together, 4):
            x0, x1, x2, x3 = x[i], x[i + 1], x[i + 2], x[i + 3]
            place = at + i * outputs + j
            row = numbers[place : place + 4]
            a0, a1, a2, a3 = row[0], row[1], row[2], row[3]
            row = numbers[place + outputs : place + outputs + 4]
            b0, b1, b2, b3 = row[0], row[1], row[2], row[3]
            row = numbers[place + 2 * outputs : place + 2 * outputs + 4]
            c0, c1, c2, c3 = row[0], row[1], row[2], row[3]
            row = numbers[place + 3 * outputs : place + 3 * outputs + 4]
            d0, d1, d2, d3 = row[0], row[1], row[2], row[3]
            for b in range(BLOCK):
                p, q, r, s = x0[b], x1[b], x2[b], x3[b]
                y0[b] += p * a0 + q * b0 + r * c0 + s * d0
                y1[b] += p * a1 + q * b1 + r * c1 + s * d1
                y2[b] += p * a2 + q * b2 + r * c2 + s * d2
                y3[b] += p * a3 + q * b3 + r * c3 + s * d3
        for i in range(together, inputs):
            x0 = x[i]
            row = numbers[at + i * outputs + j : at + i * outputs + j + 4]
            a0, a1, a2, a3 = row[0], row[1], row[2], row[3]
            for b in range(BLOCK):
                p = x0[b]
                y0[b] += p * a0
                y1[b] += p * a1
                y2[b] += p * a2
                y3[b] += p * a3
    for j in range(outputs - outputs % 4, outputs):
        y0, p = y[j], numbers[biases + j]
        for b in range(BLOCK):
            y0[b] = p
        for i in range(inputs):
            x0, a0 = x[i], numbers[at + i * outputs + j]
            for b in range(BLOCK):
                y0[b] += x0[b] * a0
    return biases + outputs


@compiled
def tanh_row(x: Floats) -> None:
    """Take tanh in place, exact to rounding: 1 − 2/(e^2x + 1), with e^r as its Taylor series for |r| < ln(2)/2."""
    for b in range(BLOCK):
        doubled = 2 * min(max(x[b], -_LARGEST), _LARGEST)
        power = np.floor(doubled * _LOG2_E + 0.5)
        r = doubled - power * _LN2
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
        s = s * r + 1.0
        two_to_power = np.int64((np.float64(power + _MAGIC).view(np.int64) + 1023) << 52).view(np.float64)
        x[b] = 1 - 2 / (s * two_to_power + 1)


@compiled
def _tanh_roughly(x: Any) -> None:
    """Take tanh in place, in single precision."""
    single = np.float32
    one, two = single(1.0), single(2.0)
    for b in range(BLOCK):
        doubled = two * min(max(x[b], single(-_LARGEST_SINGLE)), single(_LARGEST_SINGLE))
        power = np.floor(doubled * single(_LOG2_E) + single(0.5))
        r = doubled - power * single(_LN2)
        s = single(1 / 720.0)
        s = s * r + single(1 / 120.0)
        s = s * r + single(1 / 24.0)
        s = s * r + single(1 / 6.0)
        s = s * r + single(0.5)
        s = s * r + one
        s = s * r + one
        bits = single(power + single(_MAGIC_SINGLE)).view(np.int32)
        two_to_power = np.int32((bits + np.int32(127)) << np.int32(23)).view(np.float32)
        x[b] = one - two / (s * two_to_power + one)
