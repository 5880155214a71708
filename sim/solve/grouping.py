"""How robots share groups with a robot in each lane (`sim.lanes`): arrays (B, …) of B robots, (G, …, W) in lanes.

A group is W robots, one in each lane; a robot alone is a group of its own. Empty lanes repeat the last robot, and
nothing is asked of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache

import numpy as np

from sim.arrays import Flags, Floats
from sim.compiling import processor_has
from sim.lanes import GROUP, HALF_GROUP
from sim.solve.assembly import Nonlocal

NAMES = Nonlocal(*[0.0] * len(Nonlocal._fields))  # of the non-local effects, for compiled loops
AT_ONCE = 128  # robots; their orbits take 40 MB, their flips 50 MB


def slices(count: int) -> list[slice]:
    """Split robots into one run or more of at most AT_ONCE, so that memory does not grow with their number."""
    return [slice(first, first + AT_ONCE) for first in range(0, max(count, 1), AT_ONCE)]


@cache
def group_width() -> tuple[int, ...]:
    """Return the width of groups on this processor, as a tuple: eight lanes with AVX-512, else four."""
    return GROUP if processor_has("avx512f") else HALF_GROUP


def by_kind(robots: Iterable[int], kind: Callable[[int], object]) -> list[list[int]]:
    """Sort robots by kind: those of one kind have arrays of the same shapes."""
    kinds: dict[object, list[int]] = {}
    for i in robots:
        kinds.setdefault(kind(i), []).append(i)
    return list(kinds.values())


def in_groups(array: Floats) -> Floats:
    """Lay out an array (B, …) of B ≥ 1 robots as (G, …, W)."""
    width, count = len(group_width()), len(array)
    groups = -(-count // width)
    places = np.minimum(np.arange(groups * width), count - 1)
    lanes = array[places].reshape(groups, width, *array.shape[1:])
    return np.ascontiguousarray(np.moveaxis(lanes, 1, -1))


def from_groups(array: Floats, count: int) -> Floats:
    """Lay out an array (G, …, W) as (B, …), for B robots."""
    lanes = np.moveaxis(array, -1, 1)
    return np.ascontiguousarray(lanes.reshape(lanes.shape[0] * lanes.shape[1], *lanes.shape[2:])[:count])


def wanted_lanes(wanted: Flags) -> Floats:
    """Tell in which lanes there is a robot that is wanted, from flags (B,), as (G, W) of 1 and 0."""
    groups = in_groups(wanted.astype(float))
    groups.reshape(-1)[len(wanted) :] = 0.0
    return groups
