"""The domain of the table: the joint support of its training data, as a smooth measure.

    q(x) = φ(x)ᵀ M⁻¹ φ(x)/F,   M = mean of φ φᵀ over the rows,   φ: the F monomials up to degree 3 (of seven
    inputs) or 2 (of more)

1/q is the Christoffel function of the rows. q is about 1 inside their support and grows with a high power
outside of it, in every direction, also where each input alone looks harmless. Its limit is its largest value
over almost all rows. Along one input alone q grows slowly at first. So each input must be within the range of the
rows as well. Source: Lasserre and Pauwels, Adv. Comput. Math. 45, 1439 (2019).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from sim.arrays import Floats, Integers
from sim.compiling import compiled
from sim.object_code import COUNT, FLOATS, INTEGERS, array_at, kept
from surrogate.networks.blocks import BLOCK

_DEGREE, _DEGREE_OF_MANY, _MANY = 3, 2, 8  # of the monomials; of so many inputs and more
_KEPT = 0.998  # share of the rows that are inside
_SLACK = 1.5
_END = 1.02  # of half an input's range
_REGULAR = 1e-9


@dataclass(frozen=True)
class Support:
    """Where a table has learned."""

    shift: Floats  # (F,)
    scale: Floats  # (F,)
    factor: Floats  # (P, P): the Cholesky factor of M
    limit: float

    @staticmethod
    def learned(inputs: Floats) -> Support:
        """Learn the support of rows (M, F)."""
        low, high = inputs.min(0), inputs.max(0)
        shift, scale = (low + high) / 2, np.maximum((high - low) / 2, 1e-6)
        features = _monomials((inputs - shift) / scale)
        moments = features.T @ features / len(inputs)
        moments = moments + _REGULAR * np.eye(len(moments))
        plain = Support(shift, scale, np.asarray(np.linalg.cholesky(moments), dtype=float), 1.0)
        limit = _SLACK * float(np.quantile(plain.novelty(inputs), _KEPT))
        return Support(shift, scale, plain.factor, limit)

    def novelty(self, inputs: Floats) -> Floats:
        """Return the novelty, (M,), at inputs (M, F): at most 1 inside.

        It is q over its limit. Outside the range of an input, by more than a hundredth of its width, it is the
        distance from the middle of the range over half its width, if that is larger.
        """
        inputs = np.ascontiguousarray(inputs, dtype=float)
        products, numbers, novelty = products_of(len(self.shift)), self.numbers, np.empty(len(inputs))
        rows = support_room(len(self.shift)) + len(self.shift) + 1
        room = np.empty(rows * BLOCK)
        novelty_rows(len(inputs), len(self.shift), products.shape[1], products, numbers, inputs, novelty, room)
        return novelty

    @property
    def numbers(self) -> Floats:
        """Shift, scale, limit and the factor column by column in one array, for the compiled loops."""
        return np.concatenate([self.shift, self.scale, [self.limit], self.factor.T.ravel()])


def monomial_count(inputs: int) -> int:
    """Return the number of monomials of some inputs, P."""
    return products_of(inputs).shape[1]


def support_room(inputs: int) -> int:
    """Return how many numbers `novelty_at` works in."""
    return inputs + monomial_count(inputs)


@cache
def products_of(inputs: int) -> Integers:
    """List the monomials of some inputs, the constant first: parents and last inputs, (2, P).

    Monomial p is monomial parents[p] times the input last[p].
    """
    parents, last = [0], [0]
    index: dict[tuple[int, ...], int] = {(): 0}
    for degree in range(1, 1 + (_DEGREE_OF_MANY if inputs >= _MANY else _DEGREE)):
        for names in combinations_with_replacement(range(inputs), degree):
            index[names] = len(parents)
            parents.append(index[names[:-1]])
            last.append(names[-1])
    return np.array([parents, last])


def _monomials(x: Floats) -> Floats:
    """Return all monomials of x (M, F), (M, P)."""
    columns = [np.ones(len(x))]
    for parent, factor in products_of(x.shape[1]).T[1:].tolist():
        columns.append(columns[parent] * x[:, factor])
    return np.column_stack(columns)


@kept(COUNT, COUNT, COUNT, INTEGERS, FLOATS, FLOATS, FLOATS, FLOATS)
def novelty_rows(
    count: int, size: int, terms: int, products: Any, numbers: Any, inputs: Any, novelty: Any, room: Any
) -> None:
    """Write `Support.novelty` of inputs (M, F) to novelty (M,)."""
    support, pairs = array_at(numbers, 2 * size + 1 + terms * terms), array_at(products, 2 * terms)
    x, q = array_at(inputs, (count, size)), array_at(novelty, count)
    work = array_at(room, (2 * size + terms + 1, BLOCK))
    for begin in range(0, count, BLOCK):
        for b in range(BLOCK):
            for i in range(size):
                work[i, b] = x[min(begin + b, count - 1), i]
        novelty_block(support, pairs, work[:size], work[size], work[size + 1 :])
        for b in range(min(BLOCK, count - begin)):
            q[begin + b] = work[size, b]


@compiled
def novelty_block(support: Floats, products: Integers, inputs: Floats, novelty: Floats, room: Floats) -> None:
    """Write `Support.novelty` at inputs (F, BLOCK) to novelty (BLOCK,); see `novelty_at`, with rooms of BLOCK."""
    size, count = len(inputs), len(products) // 2
    x, features = room[:size], room[size : size + count]
    for i in range(size):
        shift, scale, plain, scaled = support[i], support[size + i], inputs[i], x[i]
        for b in range(BLOCK):
            scaled[b] = (plain[b] - shift) / scale
    for b in range(BLOCK):
        features[0, b] = 1.0
        novelty[b] = 0.0
    for p in range(1, count):
        product, parent, factor = features[p], features[products[p]], x[products[count + p]]
        for b in range(BLOCK):
            product[b] = parent[b] * factor[b]
    factors = 2 * size + 1
    for i in range(count):
        row, together = features[i], i - i % 4
        for j in range(0, together, 4):
            x0, x1, x2, x3 = features[j], features[j + 1], features[j + 2], features[j + 3]
            place = factors + j * count + i
            p, q = support[place], support[place + count]
            r, s = support[place + 2 * count], support[place + 3 * count]
            for b in range(BLOCK):
                row[b] -= p * x0[b] + q * x1[b] + r * x2[b] + s * x3[b]
        for j in range(together, i):
            x0, p = features[j], support[factors + j * count + i]
            for b in range(BLOCK):
                row[b] -= p * x0[b]
        diagonal = support[factors + i * count + i]
        for b in range(BLOCK):
            row[b] /= diagonal
            novelty[b] += row[b] * row[b]
    for b in range(BLOCK):
        novelty[b] = novelty[b] / count / support[2 * size]
    for i in range(size):
        scaled = x[i]
        for b in range(BLOCK):
            away = abs(scaled[b])
            novelty[b] = max(novelty[b], away) if away > _END else novelty[b]


@compiled
def novelty_at(support: Floats, products: Integers, inputs: Floats, room: Floats) -> float:
    """Return `Support.novelty` at inputs (F,).

    Args:
        support: `Support.numbers`.
        products: see `products_of`, one after the other, (2 P,).
        room: to work in, see `support_room`.
    """
    size, count = len(inputs), len(products) // 2
    x, features = room[:size], room[size : size + count]
    for i in range(size):
        x[i] = (inputs[i] - support[i]) / support[size + i]
    features[0] = 1.0
    for p in range(1, count):
        features[p] = features[products[p]] * x[products[count + p]]
    novelty = 0.0
    for j in range(count):
        column = support[2 * size + 1 + j * count : 2 * size + 1 + (j + 1) * count]
        solved = features[j] / column[j]
        for i in range(j + 1, count):
            features[i] -= column[i] * solved
        novelty += solved**2
    novelty = novelty / count / support[2 * size]
    for i in range(size):
        away = abs(x[i])
        if away > _END:
            novelty = max(novelty, away)
    return novelty
