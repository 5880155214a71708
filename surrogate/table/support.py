"""The domain of the table: the joint support of its training data, as a smooth measure.

    q(x) = φ(x)ᵀ M⁻¹ φ(x)/F,   M = mean of φ φᵀ over the rows,   φ: the F monomials up to degree 3

1/q is the Christoffel function of the rows. q is about 1 inside their support and grows with a high power
outside of it, in every direction, also where each input alone looks harmless. Its limit is its largest value
over almost all rows. Source: Lasserre and Pauwels, Adv. Comput. Math. 45, 1439 (2019).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement

import numpy as np

from sim.arrays import Floats, Integers
from sim.compiling import compiled

DEGREE = 3
_KEPT = 0.998  # share of the rows that are inside
_SLACK = 1.5
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
        """Return q over its limit, (M,), at inputs (M, F): at most 1 inside."""
        parents, last = _products(len(self.shift))
        return _novelty_rows(self.shift, self.scale, self.factor, parents, last, inputs) / self.limit


def monomial_count(inputs: int) -> int:
    """Return the number of monomials up to DEGREE of some inputs, P."""
    return len(_products(inputs)[0])


@cache
def _products(inputs: int) -> tuple[Integers, Integers]:
    """List the monomials up to DEGREE of some inputs, the constant first: `parents` and `last`, both (P,).

    Monomial p is monomial parents[p] times the input last[p].
    """
    parents, last = [0], [0]
    index: dict[tuple[int, ...], int] = {(): 0}
    for degree in range(1, DEGREE + 1):
        for names in combinations_with_replacement(range(inputs), degree):
            index[names] = len(parents)
            parents.append(index[names[:-1]])
            last.append(names[-1])
    return np.array(parents), np.array(last)


def _monomials(x: Floats) -> Floats:
    """Return all monomials up to DEGREE of x (M, F), (M, P)."""
    columns = [np.ones(len(x))]
    for parent, factor in list(zip(*_products(x.shape[1]), strict=True))[1:]:
        columns.append(columns[parent] * x[:, factor])
    return np.column_stack(columns)


@compiled
def _novelty_rows(
    shift: Floats, scale: Floats, factor: Floats, parents: Integers, last: Integers, inputs: Floats
) -> Floats:
    """Return q of the module's head, (M,), at inputs (M, F)."""
    novelty, count = np.zeros(len(inputs)), len(parents)
    features, solved = np.ones(count), np.empty(count)
    for row in range(len(inputs)):
        x = (inputs[row] - shift) / scale
        for p in range(1, count):
            features[p] = features[parents[p]] * x[last[p]]
        for i in range(count):
            remainder = features[i]
            for j in range(i):
                remainder -= factor[i, j] * solved[j]
            solved[i] = remainder / factor[i, i]
            novelty[row] += solved[i] ** 2
        novelty[row] /= count
    return novelty
