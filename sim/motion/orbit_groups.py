"""Solve for the orbits of robots whose effects are local, in groups with a robot in each lane (`sim.lanes`).

A robot's numbers depend neither on its group nor on how wide groups are. So each processor has the width that is
fast on it.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from sim.arrays import Floats
from sim.compiling import processor_has
from sim.lanes import GROUP, HALF_GROUP
from sim.solve.assembly import Nonlocal
from sim.solve.orbit_groups import Found, orbits_of_robots
from sim.solve.refinement import MANY_PHASES, MESHES, MOST_PHASES, SOLVED, Orbit

_NONE = Nonlocal(*[0.0] * len(Nonlocal._fields))


@cache
def group_width() -> tuple[int, ...]:
    """Return the width of groups on this processor, as a tuple: eight lanes with AVX-512, else four."""
    return GROUP if processor_has("avx512f") else HALF_GROUP


def orbits_in_groups(rows: Floats, tails: int, least: int) -> list[Orbit]:
    """Solve for the orbits of B robots with N tails and local effects.

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K).
        tails: N.
        least: number of phases to begin with.

    Returns:
        The orbits, as `sim.solve.refinement.refined_orbit` returns them.
    """
    count = len(rows)
    if tails > MOST_PHASES or not count:
        return [_unsolved(MANY_PHASES, tails) for _ in rows]
    numbers = np.ascontiguousarray(rows[:, : -len(_NONE)].T)
    most = 2 * MOST_PHASES + 2 * max(tails, least)  # more phases than any orbit has
    x = tuple(np.empty((count, 3 * edges * most)) for edges in MESHES)
    u = tuple(np.empty((count, 4 * (most // tails + 1))) for _ in MESHES)
    ended, phases = np.full(count, MANY_PHASES), np.full(count, tails)
    found = Found(ended, phases, np.full((6, count), np.nan), x, u)  # type: ignore[arg-type]
    order = np.argsort(np.abs(numbers[0]), kind="stable")
    orbits_of_robots(numbers, _NONE, tails, least, order, found, group_width())
    return [_orbit_of(found, i, tails) for i in range(count)]


def _orbit_of(found: Found, robot: int, tails: int) -> Orbit:
    """Return the orbit of one robot."""
    ended, phases = int(found.ended[robot]), int(found.phases[robot])
    if ended != SOLVED:
        return _unsolved(ended, tails)
    instants = phases // tails
    meshes = zip(MESHES, found.x, strict=True)
    a, b, c = (part[robot, : 3 * n * phases].reshape(n, phases, 3) for n, part in meshes)
    d, e, f = (part[robot, : 4 * instants].reshape(instants, 4) for part in found.u)
    return Orbit(ended, float(found.result[0, robot]), found.result[1:, robot].copy(), (a, b, c), (d, e, f))


def _unsolved(ended: int, tails: int) -> Orbit:
    x, u = np.zeros((MESHES[0], tails, 3)), np.zeros((1, 4))
    return Orbit(ended, np.nan, np.full(5, np.nan), (x, x, x), (u, u, u))
