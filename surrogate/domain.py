"""The robots that the look-up table is for: ranges of their inputs, and the joint support of the training data.

The support is a smooth measure:

    q(x) = φ(x)ᵀ M⁻¹ φ(x)/F,   M = mean of φ φᵀ over the rows,   φ: the F monomials up to degree 3 (of seven
    inputs) or 2 (of more)

1/q is the Christoffel function of the rows. q is about 1 inside their support and grows with a high power
outside of it, in every direction, also where each input alone looks harmless. Its limit is its largest value
over almost all rows. Along one input alone q grows slowly at first. So each input must be within the range of the
rows as well. Source: Lasserre and Pauwels, Adv. Comput. Math. 45, 1439 (2019).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from common.arrays import Floats, Integers
from sim.jit import compiled_fast
from sim.model.groups import GROUP_COLUMNS, OPTIONAL_COLUMNS
from surrogate.network import BLOCK, product

ROBOT = (*GROUP_COLUMNS, *OPTIONAL_COLUMNS)  # columns of a robot without effects
DOMAIN = {
    "C_t": (0.5, 8.0), "C_r": (0.5, 6.0), "C_yr": (0.2, 12.0), "l_over_R": (2.0, 12.0), "L_over_R": (1.5, 8.0),
    "l_over_r0": (12.0, 80.0), "omega_bar": (0.5, 150.0), "a_over_R": (0.5, 1.2),
}  # fmt: skip
MOST_TAILS = 8
WIDE = {
    "C_t": (0.3, 12.0), "C_r": (0.3, 9.0), "C_yr": (0.1, 18.0), "l_over_R": (1.85, 13.0), "L_over_R": (1.2, 10.0),
    "l_over_r0": (11.0, 88.0), "omega_bar": (0.42, 165.0), "a_over_R": (0.46, 1.3),
}  # fmt: skip
COEFFICIENTS = ("C_t", "C_r", "C_yr")  # of the head; the table needs no learning for them
# Where `surrogate.inverse` looks: for coefficients as far as there are learned robots.
BOUNDS = {name: (WIDE if name in COEFFICIENTS else DOMAIN)[name] for name in DOMAIN}
MAX_YAW_SHARE = 0.6  # |ω_yr/ω_t| from which a robot may have several motions
INSIDE, NOT_LEARNED, NO_MOTION, NOVEL, FAST_YAW, NO_RESPONSE = range(6)
_REASONS = (
    "",
    "none with as many tails were learned",
    "its tails or its motor were not learned, or no motion was found",
    "its tails, or with one or two of them its head, are unlike all learned ones",
    "it yaws nearly as fast as its tails turn, and may have several motions",
    "its head has no side force as it spins, and no flip of such a robot was learned",
)
_AGAINST = "a couple turns it against its tails, and such robots were learned with one tail only"
_DEGREE, _DEGREE_OF_MANY, _MANY = 3, 2, 8  # of the monomials; of so many inputs and more
_KEPT = 0.998  # share of the rows that are inside
_SLACK = 1.5
_REGULAR = 1e-9
_END = 1.02  # of half an input's range


class SupportNumbers(NamedTuple):
    """A support for the compiled loops; monomials are padded to an even number."""

    shift: Floats  # (F,)
    scale: Floats  # (F,)
    inverse: Floats  # (P, P): L⁻¹ over the root of F times the limit, for M = L Lᵀ
    products: Integers  # (2, P), see `products_of`


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
        return novelty_of(self.numbers, np.ascontiguousarray(inputs, dtype=float))

    @cached_property
    def numbers(self) -> SupportNumbers:
        """The support for the compiled loops."""
        products, count = products_of(len(self.shift)), len(self.factor)
        odd = count % 2
        inverse = np.pad(np.linalg.inv(self.factor) / np.sqrt(count * self.limit), (0, odd))
        products = np.ascontiguousarray(np.pad(products, [(0, 0), (0, odd)]))
        return SupportNumbers(self.shift, self.scale, np.ascontiguousarray(inverse), products)


def monomial_count(inputs: int) -> int:
    """Return the number of monomials of some inputs, P."""
    return products_of(inputs).shape[1]


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


@compiled_fast
def put_novelty(support: SupportNumbers, inputs: Floats, novelty: Floats) -> None:
    """Write `Support.novelty` at inputs (M, F) of a block to novelty (M,)."""
    count, size = inputs.shape
    terms = len(support.inverse)
    features, solved = np.empty((count, terms)), np.empty((count, terms))
    x = (inputs - support.shift) / support.scale
    for k in range(count):
        features[k, 0] = 1.0
        for p in range(1, terms):
            features[k, p] = features[k, support.products[0, p]] * x[k, support.products[1, p]]
    product(support.inverse, np.zeros(terms), features, solved, True)
    for k in range(count):
        total, away = 0.0, 0.0
        for p in range(terms):
            total += solved[k, p] * solved[k, p]
        for i in range(size):
            away = max(away, abs(x[k, i]))
        novelty[k] = max(total, away) if away > _END else total


@compiled_fast
def novelty_of(support: SupportNumbers, inputs: Floats) -> Floats:
    """Return `Support.novelty` at inputs (M, F), (M,)."""
    novelty = np.empty(len(inputs))
    for begin in range(0, len(inputs), BLOCK):
        end = begin + BLOCK
        put_novelty(support, inputs[begin:end], novelty[begin:end])
    return novelty


def reason_of(outside: int, tails: float, yaw_rate: float) -> str:
    """Say why a robot with N tails is outside; empty if it is not. The yaw rate is that for a positive motor."""
    return _AGAINST if outside == NOVEL and tails > 1 and yaw_rate < 0 else _REASONS[outside]
