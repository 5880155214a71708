"""Orbits of many robots: mean motion, whether it was found, the gap between the tails, and derivatives.

Robots whose effects are local are solved for in groups (`sim.motion.orbit_groups`), the others one by one.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats, Integers
from sim.model.body import Body
from sim.motion.orbit_groups import orbits_in_groups
from sim.motion.stability import growth_of_orbit
from sim.solve.assembly import are_local, unpacked
from sim.solve.derivative import orbit_slopes
from sim.solve.orbit import mean_motion, residual_on_orbit, smallest_gap
from sim.solve.refinement import FEW, SOLVED, Orbit, extrapolate, refined_orbit

_NEAR = 1.1  # gap from which tails cannot touch, given the error of the gap
WIDTH = 1e-5  # finite-difference step in a robot's numbers; the balance depends almost linearly on them


class Perturbed(Enum):
    """Which robots get the growth of small perturbations."""

    NONE = "none"
    TOUCHING = "those with contact whose tails touch"
    ALL = "all"


class Orbits(NamedTuple):
    """Steady motions of B robots; means of (ω_t, ω_h, ω_yr, v_x, v_z) of the head's centre."""

    means: Floats  # (B, 5), NaN where not solved
    slopes: Floats  # (B, K, 5): derivatives of the means along K directions
    error: Floats  # (B,) estimated relative error
    ended: Integers  # (B,) SOLVED or why not, see `sim.solve.refinement`
    gap: Floats  # (B,) smallest distance between tails over 2 r0
    growth: Floats  # (B,) of small perturbations in a motor revolution, see `sim.motion.stability`; NaN: unknown


def solve_orbits(
    rows: Floats,
    tails: int,
    directions: Floats | None = None,
    *,
    phases: int = FEW,
    perturbed: Perturbed = Perturbed.NONE,
) -> Orbits:
    """Solve for the orbits of robots with N tails.

    Args:
        rows: (B, K'), the robots' numbers (`sim.solve.assembly.numbers`).
        tails: N.
        directions: (B, K, K'), directions of the derivatives (none by default).
        phases: number of phases to begin with.
        perturbed: robots that get a growth.
    """
    count = 0 if directions is None else directions.shape[1]
    slopes = np.full((len(rows), count, 5), np.nan)
    local = np.flatnonzero(are_local(rows))
    grouped = dict(zip(local.tolist(), orbits_in_groups(rows[local], tails, phases), strict=True))
    orbits: list[Orbit] = []
    gap, grows = np.full(len(rows), np.nan), np.full(len(rows), np.nan)
    for i, body in enumerate(unpacked(rows)):
        orbit = grouped[i] if i in grouped else refined_orbit(body, tails, phases)
        orbits.append(orbit)
        if orbit.ended == SOLVED:
            gap[i] = smallest_gap(body, orbit.x[2], tails)
            touching = body.nonlocal_terms.tail_contact != 0 and gap[i] < _NEAR
            if perturbed is Perturbed.ALL or (perturbed is Perturbed.TOUCHING and touching):
                grows[i] = growth_of_orbit(body, tails, orbit)
            if directions is not None and count:
                slopes[i] = _slopes(body, rows[i], directions[i], orbit)
    return Orbits(
        np.array([orbit.means for orbit in orbits]),
        slopes,
        np.array([orbit.error for orbit in orbits]),
        np.array([orbit.ended for orbit in orbits]),
        gap,
        grows,
    )


def _slopes(body: Body, row: Floats, directions: Floats, orbit: Orbit) -> Floats:
    """Compute the derivatives of the extrapolated means along `directions` (K, K'), (K, 5)."""
    moved = list(zip(unpacked(row - WIDTH * directions), unpacked(row + WIDTH * directions), strict=True))
    slopes = np.empty((3, len(directions), 5))
    for i, (x, u) in enumerate(zip(orbit.x, orbit.u, strict=True)):
        ends = [[residual_on_orbit(robot, x, u) for robot in pair] for pair in moved]
        r, t = (np.array([above[c] - below[c] for below, above in ends]) / (2 * WIDTH) for c in (0, 1))
        changes = orbit_slopes(body, r, t, x, u)
        for k, (below, above) in enumerate(moved):
            rise = mean_motion(above, u + WIDTH * changes[k]) - mean_motion(below, u - WIDTH * changes[k])
            slopes[i, k] = rise / (2 * WIDTH)
    return extrapolate(slopes.reshape(3, -1)).reshape(-1, 5)
