"""Solve for the orbits of robots whose effects are local, in groups with a robot in each lane (`sim.lanes`).

A robot's numbers depend neither on its group nor on how wide groups are. So each processor has the width that is
fast on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats, Integers
from sim.motion.grouping import NONE, group_width, grouped, in_lanes, numbers_in_lanes
from sim.solve.orbit_groups import Found, on_all_meshes, on_coarsest_mesh, on_mesh
from sim.solve.refinement import FEW, MANY_PHASES, MESHES, MOST_PHASES, SOLVED, Orbit


def orbits_in_groups(rows: Floats, tails: int, least: int) -> list[Orbit]:
    """Solve for the orbits of B robots with N tails and local effects.

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K).
        tails: N.
        least: number of phases to begin with.

    Returns:
        The orbits, as `sim.solve.refinement.refined_orbit` returns them.
    """
    found, numbers, order = _room(rows, tails, least)
    if tails <= MOST_PHASES and len(rows):
        on_coarsest_mesh(numbers, NONE, tails, least, order, found, group_width())
        on_all_meshes(numbers, NONE, tails, order, found, group_width())
    return [_orbit_of(found, i, tails) for i in range(len(rows))]


class OnMesh(NamedTuple):
    """A robot's orbit on one mesh."""

    x: Floats  # (n, M, 3)
    u: Floats  # (P, 4)
    twist: Floats  # (3,): mean v_z, h_x, ω_yr


def coarse_orbits(rows: Floats, tails: int) -> list[tuple[Floats, Floats] | None]:
    """Solve for x (n, M, 3) and u (P, 4) of B robots on the coarsest mesh; None where there is no solution.

    Args:
        rows: the robots' numbers, (B, K), as in `orbits_in_groups`.
        tails: N.
    """
    found, numbers, order = _room(rows, tails, FEW)
    if tails <= MOST_PHASES and len(rows):
        on_coarsest_mesh(numbers, NONE, tails, FEW, order, found, group_width())
    return [_part(found, 0, i, tails) if found.ended[i] == SOLVED else None for i in range(len(rows))]


def orbits_on_mesh(
    rows: Floats, tails: int, edges: int, coarse: Sequence[tuple[Floats, Floats] | None], instants: Sequence[int]
) -> list[OnMesh | None]:
    """Solve for the orbits of B robots on a mesh, with a number of instants for each.

    Args:
        rows: the robots' numbers, (B, K), as in `orbits_in_groups`.
        tails: N.
        edges: of a tail.
        coarse: as `coarse_orbits` returns them.
        instants: of a turn, P.
    """
    orbits: list[OnMesh | None] = [None] * len(rows)
    starts = {i: orbit for i, orbit in enumerate(coarse) if orbit is not None}
    for robots, width in grouped(starts, lambda i: (len(starts[i][1]), instants[i])):
        numbers = numbers_in_lanes(rows[robots], width)
        x, u = (in_lanes(part, width) for part in zip(*(starts[i] for i in robots), strict=True))
        found = on_mesh(numbers, NONE, tails, x, u, edges, instants[robots[0]], width)
        for lane, i in enumerate(robots):
            if found.solved[lane]:
                parts = found.x, found.u, found.means[[4, 3, 2]]
                orbits[i] = OnMesh(*(np.ascontiguousarray(part[..., lane]) for part in parts))
    return orbits


def _room(rows: Floats, tails: int, least: int) -> tuple[Found, Floats, Integers]:
    """Allocate room for the orbits of B robots; return the robots' numbers (K, B), and similar ones in order."""
    count = len(rows)
    numbers = np.ascontiguousarray(rows[:, : -len(NONE)].T)
    most = 2 * MOST_PHASES + 2 * max(tails, least)  # more phases than any orbit has
    x = tuple(np.empty((count, 3 * edges * most)) for edges in MESHES)
    u = tuple(np.empty((count, 4 * (most // tails + 1))) for _ in MESHES)
    ended, phases = np.full(count, MANY_PHASES), np.full(count, tails)
    found = Found(ended, phases, np.full((6, count), np.nan), x, u)  # type: ignore[arg-type]
    return found, numbers, np.argsort(np.abs(numbers[0]), kind="stable")


def _orbit_of(found: Found, robot: int, tails: int) -> Orbit:
    """Return the orbit of one robot."""
    ended = int(found.ended[robot])
    if ended != SOLVED:
        return _unsolved(ended, tails)
    (a, d), (b, e), (c, f) = (_part(found, mesh, robot, tails) for mesh in range(len(MESHES)))
    return Orbit(ended, float(found.result[0, robot]), found.result[1:, robot].copy(), (a, b, c), (d, e, f))


def _part(found: Found, mesh: int, robot: int, tails: int) -> tuple[Floats, Floats]:
    """Return x (n, M, 3) and u (P, 4) of one robot on one of the MESHES."""
    n, phases = MESHES[mesh], int(found.phases[robot])
    x, u = found.x[mesh][robot, : 3 * n * phases], found.u[mesh][robot, : 4 * (phases // tails)]
    return x.reshape(n, phases, 3), u.reshape(-1, 4)


def _unsolved(ended: int, tails: int) -> Orbit:
    x, u = np.zeros((MESHES[0], tails, 3)), np.zeros((1, 4))
    return Orbit(ended, np.nan, np.full(5, np.nan), (x, x, x), (u, u, u))
