"""Growth of small perturbations of many steady motions.

Robots whose effects are local share groups with a robot in each lane (`sim.lanes`) on the mesh of 8 edges; the
others are computed one by one, and so is what `sim.motion.stability` computes again. The growth of a robot does
not depend on its group. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.arrays import Floats
from sim.motion.grouping import NONE, grouped, in_lanes, numbers_in_lanes
from sim.motion.stability import (
    FEW_VECTORS,
    first_perturbation,
    growth_of_orbit,
    in_motor_revolutions,
    vector_count,
)
from sim.solve.assembly import are_local, unpacked
from sim.solve.floquet_groups import arnoldi_of_group
from sim.solve.orbit import mean_motion
from sim.solve.refinement import Orbit


def growths(rows: Floats, tails: int, orbits: Sequence[Orbit]) -> Floats:
    """Compute the growth (B,) of robots with N tails; NaN where it cannot be computed.

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K).
        tails: N.
        orbits: of the robots, all solved.
    """
    local = np.flatnonzero(are_local(rows)).tolist()
    first = dict(zip(local, _on_second_mesh(rows[local], tails, [orbits[i] for i in local]).tolist(), strict=True))
    bodies = unpacked(rows)
    return np.array([growth_of_orbit(bodies[i], tails, orbit, first.get(i)) for i, orbit in enumerate(orbits)])


def _on_second_mesh(rows: Floats, tails: int, orbits: Sequence[Orbit]) -> Floats:
    """Compute the growth (B,) on the second mesh, of robots with local effects."""
    by_robot = np.full(len(rows), np.nan)
    shapes, velocities = [orbit.x[1] for orbit in orbits], [orbit.u[1] for orbit in orbits]
    senses, bodies = np.sign(rows[:, 0]), unpacked(rows)
    for robots, width in grouped(range(len(rows)), lambda i: (shapes[i].shape, senses[i])):
        numbers = numbers_in_lanes(rows[robots], width)
        x, u = (in_lanes([part[i] for i in robots], width) for part in (shapes, velocities))
        n, columns, _ = shapes[robots[0]].shape
        count = vector_count(tails, 3 * n * columns, FEW_VECTORS)
        first = first_perturbation(tails, n, columns)
        projected = arnoldi_of_group(numbers, NONE, x, u, senses[robots[0]], first, count, width)
        known = [lane for lane in range(len(robots)) if np.isfinite(projected[-1, -1, lane])]
        values = np.linalg.eigvals(np.moveaxis(projected[:count, :, known], -1, 0))
        for lane, largest in zip(known, (1 / values).real.max(1).tolist(), strict=True):
            i = robots[lane]
            shift = abs(mean_motion(bodies[i], velocities[i])[0])
            by_robot[i] = in_motor_revolutions(shift + largest, bodies[i], velocities[i])
    return by_robot
