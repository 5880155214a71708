"""What robots do after flips of their motors, by transients (`sim.solve.transient`), and the orbits around a flip.

A robot's course does not depend on the others. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.solve.assembly import are_local
from sim.solve.grouping import NAMES, by_kind, group_width
from sim.solve.refinement import OnMesh, coarse_orbits, orbits_on_mesh
from sim.solve.transient import Jump, follow

_LEAST_INSTANTS = {1: 3, 2: 3}  # by N; with more tails the phase at the flip hardly matters
NO_MARKS = np.empty(0)


class Flip(NamedTuple):
    """A robot at a flip of its motor."""

    row: Floats  # numbers of the robot after it, see `sim.solve.assembly.numbers`
    x: Floats  # shape, (n, M, 3)
    u: Floats  # guessed velocities, (P, 4)
    twist: Floats  # (3,): steady v_z, h_x, ω_yr after it
    until: float  # time to follow


class Course(NamedTuple):
    """What a robot does after a flip."""

    lag: Floats  # (T, Q, 3), see `sim.solve.lag`; NaN after its end
    shapes: Floats  # at the marks, (K, n, M, 3)
    end: Floats  # shape at the end, (n, M, 3)


def follow_flips(
    flips: Sequence[Flip | None], times: Floats, tolerance: float, marks: Floats = NO_MARKS
) -> list[Course | None]:
    """Follow robots after flips of their motors; None where there is no flip, or no solution.

    Args:
        flips: of robots with any number of tails, phases and edges.
        times: at which the lag is wanted, (T,), increasing.
        tolerance: on the shape in one time step, in l.
        marks: times at which shapes are kept, (K,), increasing.
    """
    courses: list[Course | None] = [None] * len(flips)
    made = {i: flip for i, flip in enumerate(flips) if flip is not None}
    order = sorted(made, key=lambda i: -abs(made[i].row[0]))  # fast motors take more steps: the last end together
    for robots in by_kind(
        order, lambda i: (made[i].x.shape, len(made[i].u), bool(are_local(made[i].row[None])[0]))
    ):
        jump = Jump(*(np.array(part) for part in zip(*(made[i] for i in robots), strict=True)))
        found = follow(jump, NAMES, marks, times, tolerance, group_width())
        for at, i in enumerate(robots):
            if found.solved[at]:
                courses[i] = Course(found.lag[at], found.shapes[at], found.end[at])
    return courses


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
    coarse = coarse_orbits(rows, tails)
    enough = [_enough(len(orbit.u), tails) for orbit in coarse]
    counts = [enough] * len(meshes) if instants is None else instants
    return [orbits_on_mesh(rows, tails, *one) for one in zip(meshes, [coarse] * len(meshes), counts, strict=True)]


def _enough(instants: int, tails: int) -> int:
    """Choose a number of instants, at least as many as an orbit has; odd where the phase at the flip matters."""
    return max(instants, _LEAST_INSTANTS[tails]) | 1 if tails in _LEAST_INSTANTS else instants
