"""Which robots go into a group together, and their numbers with a robot in each lane (`sim.lanes`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache

import numpy as np

from sim.arrays import Floats
from sim.compiling import processor_has
from sim.lanes import ALONE, GROUP, HALF_GROUP
from sim.solve.assembly import Nonlocal

NONE = Nonlocal(*[0.0] * len(Nonlocal._fields))  # non-local effects of robots in groups
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


def grouped(robots: Iterable[int], kind: Callable[[int], object]) -> Iterator[tuple[list[int], tuple[int, ...]]]:
    """Yield groups of robots of one kind, and their widths; a robot that is left over alone has one lane."""
    wide = group_width()
    for alike in by_kind(robots, kind):
        for first in range(0, len(alike), len(wide)):
            group = alike[first : first + len(wide)]
            yield group, ALONE if len(group) == 1 else wide


def in_lanes(arrays: Sequence[Floats], width: tuple[int, ...]) -> Floats:
    """Stack the arrays of a group's robots along a last axis of W lanes; the last robot fills empty ones."""
    missing = len(width) - len(arrays)
    return np.stack([*arrays, *[arrays[-1]] * missing], -1)


def numbers_in_lanes(rows: Floats, width: tuple[int, ...]) -> Floats:
    """Stack the numbers (B, K) of a group's robots as `in_lanes` does, without those of non-local effects."""
    return in_lanes(list(rows[:, : -len(NONE)]), width)
