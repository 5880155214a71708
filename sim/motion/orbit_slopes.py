"""Derivatives of the mean motions of many robots along directions in their numbers.

Robots whose effects are local, and stay so along the directions, share groups with a robot in each lane
(`sim.lanes`). Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.arrays import Floats
from sim.motion.grouping import NONE, grouped, in_lanes, numbers_in_lanes
from sim.solve.assembly import are_local, unpacked
from sim.solve.derivative import orbit_slopes
from sim.solve.derivative_groups import slopes_of_group
from sim.solve.orbit import mean_motion, residual_on_orbit
from sim.solve.refinement import MESHES, Orbit, extrapolate

WIDTH = 1e-5  # finite-difference step in a robot's numbers; the balance depends almost linearly on them


def slopes_of_orbits(rows: Floats, directions: Floats, orbits: Sequence[Orbit]) -> Floats:
    """Compute the derivatives of the extrapolated means (`sim.solve.orbit.mean_motion`), (B, K, 5).

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K').
        directions: in the numbers, (B, K, K').
        orbits: of the robots, all solved.
    """
    count = directions.shape[1]
    slopes = np.empty((len(rows), len(MESHES), count, 5))
    stay_local = are_local(rows) & ~(directions[:, :, -len(NONE) :] != 0).any((1, 2))
    for robots, width in grouped(np.flatnonzero(stay_local).tolist(), lambda i: orbits[i].x[0].shape):
        numbers = numbers_in_lanes(rows[robots], width)
        along = in_lanes([directions[i, :, : -len(NONE)] for i in robots], width)
        for mesh in range(len(MESHES)):
            x = in_lanes([orbits[i].x[mesh] for i in robots], width)
            u = in_lanes([orbits[i].u[mesh] for i in robots], width)
            found = slopes_of_group(numbers, NONE, along, WIDTH, x, u, width)
            for lane, i in enumerate(robots):
                slopes[i, mesh] = found[..., lane]
    for i in np.flatnonzero(~stay_local).tolist():
        slopes[i] = _alone(rows[i], directions[i], orbits[i])
    limits = [extrapolate(of_robot.reshape(len(MESHES), -1)) for of_robot in slopes]
    return np.array(limits).reshape(len(rows), count, 5)


def _alone(row: Floats, directions: Floats, orbit: Orbit) -> Floats:
    """Compute the derivatives of the means of one robot on all meshes, (3, K, 5)."""
    body = unpacked(row[None])[0]
    moved = list(zip(unpacked(row - WIDTH * directions), unpacked(row + WIDTH * directions), strict=True))
    slopes = np.empty((len(MESHES), len(directions), 5))
    for mesh, (x, u) in enumerate(zip(orbit.x, orbit.u, strict=True)):
        ends = [[residual_on_orbit(robot, x, u) for robot in pair] for pair in moved]
        r, t = (np.array([above[c] - below[c] for below, above in ends]) / (2 * WIDTH) for c in (0, 1))
        changes = orbit_slopes(body, r, t, x, u)
        for k, (below, above) in enumerate(moved):
            rise = mean_motion(above, u + WIDTH * changes[k]) - mean_motion(below, u - WIDTH * changes[k])
            slopes[mesh, k] = rise / (2 * WIDTH)
    return slopes
