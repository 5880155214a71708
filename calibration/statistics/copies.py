"""Copied rows of a table.

A copied row is no repeat, and makes the noise look smaller than it is. Two measurements under one
condition differ by noise. An output that is recorded in steps d, with standard deviation s between repeats, is
equal in two of them with probability

    p = d / (2 √π s),   at most 1,

the density of their difference at 0, times d. A row whose outputs all equal those of an earlier row of the same
condition is a copy if less than `_CHANCE` such pairs are expected in the whole table: (pairs of repeats) × ∏ p.
Outputs in coarse steps may agree by chance, and their rows are kept. Outputs are taken as independent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from common.arrays import Floats

COPY = "a copy of an earlier row, equal in all inputs and outputs{}"
_CHANCE = 0.01  # equal pairs that are expected by chance
_ROUNDING = 1e-9  # relative difference below which two numbers are one, converted from another unit
_TYPICAL = 0.01  # relative standard deviation that is assumed where no repeats but copies are left


def find_copies(inputs: Floats, outputs: Floats) -> dict[int, int]:
    """Find copied rows: place -> place of the row that it repeats.

    Args:
        inputs: (n, q) what was set.
        outputs: (n, k) what was measured.
    """
    first: dict[tuple[float, ...], int] = {}
    copies = {}
    for place, row in enumerate(np.column_stack([inputs, outputs]).tolist()):
        earlier = first.setdefault(tuple(row), place)
        if earlier != place:
            copies[place] = earlier
    if not copies:
        return {}
    condition = np.unique(inputs, axis=0, return_inverse=True)[1].reshape(-1)
    sizes = np.bincount(condition)
    pairs = float((sizes * (sizes - 1) / 2).sum())
    kept = np.ones(len(inputs), dtype=bool)
    kept[list(copies)] = False
    chance = math.prod(_equal(outputs[kept, i], condition[kept].tolist()) for i in range(outputs.shape[1]))
    return copies if pairs * chance < _CHANCE else {}


def _equal(values: Floats, condition: Sequence[int]) -> float:
    """Estimate the probability that two repeats of an output (n,) are equal."""
    distinct = np.unique(values)
    gaps = np.diff(distinct)
    gaps = gaps[gaps > _ROUNDING * np.abs(distinct[1:])]
    if not len(gaps):
        return 1.0
    groups: dict[int, list[float]] = {}
    for place, value in zip(condition, values.tolist(), strict=True):
        groups.setdefault(place, []).append(value)
    square = sum(((np.array(group) - np.mean(group)) ** 2).sum() for group in groups.values())
    repeats = len(values) - len(groups)
    scatter = math.sqrt(square / repeats) if repeats else _TYPICAL * float(np.median(np.abs(values)))
    return min(1.0, float(gaps.min()) / (2 * math.sqrt(math.pi) * scatter)) if scatter else 1.0
