"""How robots share groups with a robot in each lane (`sim.lanes`): arrays (B, …) of B robots, (G, …, W) in lanes.

A group is W robots, one in each lane. Empty lanes repeat the last robot, and nothing is asked of them. In compiled
loops the numbers of a group are one `Body`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from common.arrays import Flags, Floats
from sim.jit import borrowing, compiled
from sim.lanes import lane, lanes, less, tuple_like, width
from sim.linear.lane_arrays import take_lane
from sim.model.body import PLACES, SHAPES, SINGLE, Body
from sim.solve.assembly import Nonlocal

NAMES = Nonlocal(*[0.0] * len(Nonlocal._fields))  # of the non-local effects, for compiled loops
_SINGLE, _LOAD = (0.0,) * SINGLE, (0.0,) * SHAPES.tail_load[0]  # of which only the lengths matter
AT_ONCE = 128  # robots; their orbits take 40 MB, their flips 50 MB


def slices(count: int) -> list[slice]:
    """Split robots into one run or more of at most AT_ONCE, so that memory does not grow with their number."""
    return [slice(first, first + AT_ONCE) for first in range(0, max(count, 1), AT_ONCE)]


def by_kind(robots: Iterable[int], kind: Callable[[int], object]) -> list[list[int]]:
    """Sort robots by kind: those of one kind have arrays of the same shapes."""
    kinds: dict[object, list[int]] = {}
    for i in robots:
        kinds.setdefault(kind(i), []).append(i)
    return list(kinds.values())


def in_groups(array: Floats) -> Floats:
    """Lay out an array (B, …) of B ≥ 1 robots as (G, …, W)."""
    count, lanes_each = len(array), width()
    groups = -(-count // lanes_each)
    places = np.minimum(np.arange(groups * lanes_each), count - 1)
    return np.ascontiguousarray(np.moveaxis(array[places].reshape(groups, lanes_each, *array.shape[1:]), 1, -1))


def from_groups(array: Floats, count: int) -> Floats:
    """Lay out an array (G, …, W) as (B, …), for B robots."""
    robots = np.moveaxis(array, -1, 1)
    return np.ascontiguousarray(robots.reshape(-1, *robots.shape[2:])[:count])


class InLanes(NamedTuple):
    """Robots in groups, for compiled loops."""

    numbers: Floats  # in the order of `Body`, (G, K, W)
    wanted: Floats  # 1 in the lanes of robots that are wanted, else 0, (G, W)
    names: Any  # numbers of the non-local effects of any robot; only their names matter


def robots_in_lanes(rows: Floats, wanted: Flags | None = None) -> InLanes:
    """Lay out robots with numbers (B, K) in groups; flags (B,) tell which are wanted, all by default."""
    flags = in_groups(np.ones(len(rows)) if wanted is None else wanted.astype(float))
    flags.reshape(-1)[len(rows) :] = 0.0
    return InLanes(in_groups(rows), flags, NAMES)


@compiled
def group_of(robots: InLanes, g: int) -> tuple[Body, Any]:
    """Return the robots of group g as one, and 1 in the lanes of those that are wanted."""
    numbers, wanted = lanes(robots.numbers), lanes(robots.wanted)
    return body_of_numbers(numbers[g], robots.names), wanted[g]


@compiled
def body_of_numbers(numbers: Floats, names: Any) -> Body:
    """Return the robot, or the robots of a group as one.

    Args:
        numbers: in the order of `Body`, (K,).
        names: numbers of the non-local effects of any robot; only their names matter.
    """
    resistance = numbers[PLACES.resistance].reshape(SHAPES.resistance)
    tail_load = tuple_like(_LOAD, numbers[PLACES.tail_load])
    terms = tuple_like(names, numbers[PLACES.nonlocal_terms])
    return Body(*tuple_like(_SINGLE, numbers), resistance, tail_load, terms)  # type: ignore[call-arg]


@compiled
def body_of_lane(body: Body, i: int) -> Body:
    """Return the robot in lane i, with plain numbers."""
    terms = body.nonlocal_terms
    numbers = np.empty(PLACES.nonlocal_terms.start + len(terms))
    for j, value in enumerate(body[:SINGLE]):
        numbers[j] = lane(value, i)
    take_lane(numbers[PLACES.resistance], body.resistance, i)
    for j, value in enumerate(body.tail_load):
        numbers[PLACES.tail_load][j] = lane(value, i)
    for j, value in enumerate(terms):
        numbers[PLACES.nonlocal_terms][j] = lane(value, i)
    return body_of_numbers(numbers, terms)


@borrowing
def reaches_further(body: Body) -> Any:
    """Tell where an effect reaches further than one node, as 1 or 0."""
    total = 0.0 * body.omega
    for value in body.nonlocal_terms:
        total += abs(value)
    return less(0.0, total)
