"""Orbits on given meshes with as many instants of a turn as the response to a flip needs.

Robots whose effects are local are solved for in groups (`sim.motion.orbit_groups`), the others one by one.
Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.arrays import Floats
from sim.linear.spectral import with_phases
from sim.model.body import Body
from sim.motion.orbit_groups import OnMesh, coarse_orbits, orbits_on_mesh
from sim.solve.assembly import are_local, unpacked
from sim.solve.orbit import mean_motion, solve_orbit
from sim.solve.refinement import CORRECTION, orbit_on_mesh

_LEAST_INSTANTS = {1: 3, 2: 3}  # by N; with more tails the phase at the flip hardly matters


def orbits_with_phases(
    rows: Floats, tails: int, meshes: Sequence[int], instants: Sequence[Sequence[int]] | None = None
) -> list[list[OnMesh | None]]:
    """Solve for the orbits of B robots on some meshes; None where there is no solution.

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K).
        tails: N.
        meshes: edges of a tail.
        instants: of a turn, for every robot on every mesh; by default as many as the orbit and the response need.

    Returns:
        A list of B orbits for every mesh.
    """
    is_local = are_local(rows)
    local, rest = np.flatnonzero(is_local).tolist(), np.flatnonzero(~is_local).tolist()
    others = dict(zip(rest, unpacked(rows[rest]), strict=True))
    coarse = coarse_orbits(rows[local], tails)
    enough = [_enough(len(orbit[1]), tails) if orbit else 1 for orbit in coarse]
    orbits: list[list[OnMesh | None]] = []
    for mesh, edges in enumerate(meshes):
        given = None if instants is None else instants[mesh]
        counts = enough if given is None else [given[i] for i in local]
        grouped = dict(zip(local, orbits_on_mesh(rows[local], tails, edges, coarse, counts), strict=True))
        alone = {i: _alone(body, tails, edges, given[i] if given else None) for i, body in others.items()}
        orbits.append([(grouped | alone)[i] for i in range(len(rows))])
    return orbits


def _enough(instants: int, tails: int) -> int:
    """Choose a number of instants, at least as many as an orbit has; odd where the phase at the flip matters."""
    return max(instants, _LEAST_INSTANTS[tails]) | 1 if tails in _LEAST_INSTANTS else instants


def _alone(body: Body, tails: int, edges: int, instants: int | None) -> OnMesh | None:
    """Solve for the orbit of one robot."""
    solved, x, u = orbit_on_mesh(body, tails, edges)
    if not solved:
        return None
    wanted = _enough(len(u), tails) if instants is None else instants
    if wanted != len(u):
        x, u = with_phases(x, tails * wanted), with_phases(u[None], wanted)[0]
        _, size = solve_orbit(body, x, u, CORRECTION)
        if not size < CORRECTION:
            return None
    return OnMesh(x, u, mean_motion(body, u)[[4, 3, 2]])
