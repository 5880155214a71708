"""Orbits of many robots: mean motion, whether it was found, the gap between the tails, and derivatives.

A batch of robots is solved for together (`sim.solve.refinement`).
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats, Integers
from sim.motion.orbit_slopes import slopes_of_orbits
from sim.motion.stability import growths
from sim.solve.assembly import CONTACT
from sim.solve.grouping import by_kind, slices
from sim.solve.orbit import smallest_gaps
from sim.solve.refinement import PHASES, SOLVED, refined_orbits

_NEAR = 1.1  # gap from which tails cannot touch, given the error of the gap


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
    status: Integers  # (B,) SOLVED or why not, see `sim.solve.refinement`
    gap: Floats  # (B,) smallest distance between tails over 2 r0
    growth: Floats  # (B,) of small perturbations in a motor revolution, see `sim.motion.stability`; NaN: unknown


def solve_orbits(
    rows: Floats,
    tails: int,
    directions: Floats | None = None,
    *,
    phases: int = PHASES,
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
    parts = [
        _solve_at_once(rows[part], tails, None if directions is None else directions[part], phases, perturbed)
        for part in slices(len(rows))
    ]
    return Orbits(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _solve_at_once(
    rows: Floats, tails: int, directions: Floats | None, phases: int, perturbed: Perturbed
) -> Orbits:
    """Solve for the orbits of as many robots as there is room for; see `solve_orbits`."""
    count = 0 if directions is None else directions.shape[1]
    slopes = np.full((len(rows), count, 5), np.nan)
    gap, grows = np.full(len(rows), np.nan), np.full(len(rows), np.nan)
    orbits = refined_orbits(rows, tails, phases)
    solved = [i for i, orbit in enumerate(orbits) if orbit.status == SOLVED]
    for robots in by_kind(solved, lambda i: orbits[i].x[2].shape):
        gap[robots] = smallest_gaps(rows[robots], np.stack([orbits[i].x[2] for i in robots]), tails)
    if perturbed is not Perturbed.NONE:
        touching = (rows[:, CONTACT] != 0) & (gap < _NEAR)
        wanted = [i for i in solved if perturbed is Perturbed.ALL or touching[i]]
        grows[wanted] = growths(rows[wanted], tails, [orbits[i] for i in wanted])
    if directions is not None and count:
        slopes[solved] = slopes_of_orbits(rows[solved], directions[solved], [orbits[i] for i in solved])
    return Orbits(
        np.array([orbit.means for orbit in orbits]).reshape(-1, 5),
        slopes,
        np.array([orbit.error for orbit in orbits]),
        np.array([orbit.status for orbit in orbits], dtype=int),
        gap,
        grows,
    )
