"""What robots do after flips of their motors, by transients (`sim.solve.transient`).

Robots whose effects are local are followed in groups with a robot in each lane (`sim.lanes`), the others one by
one. A robot's course does not depend on its group. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.lanes import ALONE
from sim.motion.grouping import NONE, by_kind, group_width
from sim.solve.assembly import are_local, unpacked
from sim.solve.transient import lag_at, transient
from sim.solve.transient_groups import Jump, follow

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
    local = [i for i, flip in made.items() if are_local(flip.row[None])[0]]
    local.sort(key=lambda i: -abs(made[i].row[0]))  # fast motors take more steps: the last lanes end together
    for robots in by_kind(local, lambda i: (made[i].x.shape, len(made[i].u))):
        jump = Jump(*(np.array(part) for part in zip(*(made[i] for i in robots), strict=True)))
        found = follow(jump, NONE, marks, times, tolerance, ALONE if len(robots) == 1 else group_width())
        for at, i in enumerate(robots):
            if found.solved[at]:
                courses[i] = Course(found.lag[at], found.shapes[at], found.end[at])
    for i in sorted(made.keys() - set(local)):
        courses[i] = follow_alone(made[i], times, tolerance, marks)
    return courses


def follow_alone(flip: Flip, times: Floats, tolerance: float, marks: Floats = NO_MARKS) -> Course | None:
    """Follow one robot, with plain numbers, whatever its effects; see `follow_flips`."""
    body, x = unpacked(flip.row[None])[0], flip.x.copy()
    early = marks[marks <= flip.until]
    course = transient(body, x, flip.u.copy(), flip.twist, flip.until, early, tolerance)
    if not course.solved:
        return None
    shapes = np.full((len(marks), *x.shape), np.nan)
    shapes[: len(early)] = course.shapes
    lag = lag_at(course, times)
    lag[times > flip.until] = np.nan
    return Course(lag, shapes, x)
