"""Numbers of several robots at once: each number of a formula is a vector with one lane for each robot.

A compiled loop works on arrays of vectors with W lanes, a group of W robots; a robot alone is in the first lane of
a group. Vectors are added, multiplied and compared like numbers; so a formula for one robot is one for a group as
well. A lane never sees another lane. So the result of a robot depends neither on its neighbours in a group nor on
W: operations are those of IEEE 754, in the order of the source, and products are only fused where the source says
so (`fma`). Such loops are compiled by `sim.jit.compiled`.

A condition on lanes is a vector of 1 (true) and 0 (false), by which `choose` picks.

The functions of this file are for compiled loops. `sim.lane_code` gives their machine code; what stands here is
what they do to plain numbers.
"""

from __future__ import annotations

import os
from functools import cache
from typing import Any

import numpy as np


@cache
def width() -> int:
    """Return W: eight where registers hold eight numbers (AVX-512), else four."""
    from llvmlite.binding import get_host_cpu_features

    given = os.environ.get("NUMBA_CPU_FEATURES")
    wide = get_host_cpu_features().get("avx512f", False) if given is None else "+avx512f" in given.split(",")
    return 8 if wide else 4


def lanes(array: Any) -> Any:
    """View an array of numbers (…, W) as an array (…) of vectors."""
    raise TypeError("lanes are for compiled loops alone")


def zeros(like: Any, shape: Any) -> Any:
    """Allocate zeros of the kind of number that the array `like` holds."""
    return np.zeros(shape, like.dtype)


def empty(like: Any, shape: Any) -> Any:
    """Allocate an array of the kind of number that the array `like` holds."""
    return np.empty(shape, like.dtype)


def lane_count(value: Any) -> int:
    """Return W of a vector; 1 for a number."""
    return 1


def lane(value: Any, i: int) -> Any:
    """Return lane i of a vector."""
    return value


def with_lane(value: Any, i: int, number: Any) -> Any:
    """Return the vector with another number in lane i."""
    return number


def tuple_like(like: Any, values: Any) -> Any:
    """Return the first entries of an array as a tuple of as many as `like`, with its names if it has some."""
    raise TypeError("tuples of entries are for compiled loops alone")


def fma(a: Any, b: Any, c: Any) -> Any:
    """Compute a b + c, rounded once in compiled loops."""
    return a * b + c


def less(a: Any, b: Any) -> Any:
    """Compute a < b, as 1 or 0."""
    return 1.0 if a < b else 0.0


def choose(condition: Any, a: Any, b: Any) -> Any:
    """Return a where the condition is not 0, b elsewhere; NaN in what is not chosen does not matter."""
    return a if condition != 0 else b


def larger(a: Any, b: Any) -> Any:
    """Return the larger number; NaN if either is NaN."""
    return a if a > b or a != a else b


def smaller(a: Any, b: Any) -> Any:
    """Return the smaller number; b if either is NaN."""
    return a if a < b else b


def somewhere(condition: Any) -> bool:
    """Tell whether a condition is true in any lane."""
    return bool(condition != 0)
