"""Growth of small perturbations of many steady motions.

Robots whose effects are local share groups with a robot in each lane (`sim.lanes`) on the mesh of 8 edges; the
others are computed one by one, and so is what `sim.motion.stability` computes again. The growth of a robot does
not depend on its group. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from sim.arrays import Floats, Integers
from sim.model.body import Body
from sim.motion.grouping import NONE, grouped, in_lanes, numbers_in_lanes
from sim.motion.stability import (
    few_vectors,
    first_perturbation,
    growth_of_orbit,
    growth_on_more_phases,
    is_doubtful,
    largest_growths,
)
from sim.solve.assembly import are_local, unpacked
from sim.solve.floquet_groups import arnoldi_of_group
from sim.solve.refinement import Orbit


def growths(rows: Floats, tails: int, orbits: Sequence[Orbit]) -> Floats:
    """Compute the growth (B,) of robots with N tails; NaN where it cannot be computed.

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K).
        tails: N.
        orbits: of the robots, all solved.
    """
    by_robot, local = np.full(len(rows), np.nan), are_local(rows)
    in_groups = np.flatnonzero(local)
    local_orbits = [orbits[i] for i in in_groups.tolist()]
    by_robot[in_groups] = _on_second_mesh(rows[in_groups], tails, local_orbits)
    means = np.array([orbit.means for orbit in local_orbits]).reshape(-1, 5)
    doubtful = in_groups[is_doubtful(means, by_robot[in_groups])]
    _one_by_one(growth_on_more_phases, doubtful, rows, tails, orbits, by_robot)
    _one_by_one(growth_of_orbit, np.flatnonzero(~local), rows, tails, orbits, by_robot)
    return by_robot


def _one_by_one(
    compute: Callable[[Body, int, Orbit], float], robots: Integers, rows: Floats, tails: int,
    orbits: Sequence[Orbit], by_robot: Floats,
) -> None:  # fmt: skip
    """Fill in what `compute` gives for some robots."""
    if len(robots):  # packing takes its time for no robot, too
        for i, body in zip(robots.tolist(), unpacked(rows[robots]), strict=True):
            by_robot[i] = compute(body, tails, orbits[i])


def _on_second_mesh(rows: Floats, tails: int, orbits: Sequence[Orbit]) -> Floats:
    """Compute the growth (B,) on the second mesh, of robots with local effects."""
    count, spins = few_vectors(tails), np.empty((2, len(rows)))
    projected = np.empty((len(rows), count + 1, count))
    shapes, velocities = [orbit.x[1] for orbit in orbits], [orbit.u[1] for orbit in orbits]
    senses = np.sign(rows[:, 0]).tolist()
    for robots, width in grouped(range(len(rows)), lambda i: (shapes[i].shape, senses[i])):
        x, u = (in_lanes([part[i] for i in robots], width) for part in (shapes, velocities))
        first = first_perturbation(tails, *x.shape[:2])
        numbers = numbers_in_lanes(rows[robots], width)
        in_group, spins_in_group = arnoldi_of_group(numbers, NONE, x, u, senses[robots[0]], first, count, width)
        projected[robots] = np.moveaxis(in_group, -1, 0)[: len(robots)]
        spins[:, robots] = spins_in_group[:, : len(robots)]
    return largest_growths(projected, *spins)
