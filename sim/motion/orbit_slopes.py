"""Derivatives of the mean motions of many robots in their numbers, by the implicit function theorem.

The orbit z(p) satisfies F(z, p) = 0, so dz/dp = −(∂F/∂z)⁻¹ ∂F/∂p. The matrix is that of Newton's method. A
parameter costs one more right-hand side, by central differences. Differences of orbits would cost two more
solutions. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.arrays import Floats
from sim.solve.assembly import are_local, batch
from sim.solve.grouping import by_kind, group_width
from sim.solve.orbit import mean_motion, residuals_on_orbits, solve_at_orbits
from sim.solve.refinement import MESHES, Orbit, extrapolate

WIDTH = 1e-5  # finite-difference step in a robot's numbers; the balance depends almost linearly on them


def slopes_of_orbits(rows: Floats, directions: Floats, orbits: Sequence[Orbit]) -> Floats:
    """Compute the derivatives of the extrapolated means (`sim.solve.orbit.mean_motion`), (B, K, 5).

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K').
        directions: in the numbers, (B, K, K').
        orbits: of the robots, all solved.
    """
    slopes = np.empty((len(MESHES), len(rows), directions.shape[1], 5))
    local, width = are_local(rows), len(group_width())
    for alike in by_kind(range(len(rows)), lambda i: (orbits[i].x[0].shape, bool(local[i]))):
        for first in range(0, len(alike), width):
            robots = alike[first : first + width]
            for mesh in range(len(MESHES)):
                x, u = (np.stack([(orbits[i].x, orbits[i].u)[c][mesh] for i in robots]) for c in (0, 1))
                slopes[mesh, robots] = _slopes(rows[robots], directions[robots], x, u)
    return extrapolate(slopes)


def _slopes(rows: Floats, directions: Floats, x: Floats, u: Floats) -> Floats:
    """Compute the derivatives of the means on one mesh, (B, K, 5), at x (B, n, M, 3) and u (B, P, 4)."""
    count = directions.shape[1]
    ends = [(rows[:, None] + way * WIDTH * directions).reshape(-1, rows.shape[1]) for way in (-1, 1)]
    shapes, velocities = np.repeat(x, count, 0), np.repeat(u, count, 0)
    below, above = (residuals_on_orbits(end, shapes, velocities) for end in ends)
    r, t = ((low - high) / (2 * WIDTH) for low, high in zip(below[:2], above[:2], strict=True))
    _, du = solve_at_orbits(rows, x, u, r.reshape(-1, count, *x.shape[1:]), t.reshape(-1, count, *u.shape[1:]))
    changes = WIDTH * du.reshape(velocities.shape)
    fall, rise = (
        mean_motion(batch(end), velocities + way * changes) for way, end in zip((-1, 1), ends, strict=True)
    )
    return ((rise - fall) / (2 * WIDTH)).reshape(-1, count, 5)
