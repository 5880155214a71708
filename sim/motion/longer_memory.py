"""What the response to a flip owes to the last dwell but one, which the curves of `sim.model.response` leave out.

Those say how a robot responds after a dwell S that follows a long one. Here S follows another dwell of S:

    longer(T | S) = lag(T | S, S) − lag(T | S)

It decays with 2 S: at S = 0.3 it is up to 4·10⁻³ of speed and yaw rate, at 0.6 up to 10⁻³, at 1 below 10⁻⁵. It is
meant as an error of those curves, so one coarse mesh is enough. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.mechanics import planar
from sim.model.groups import Groups
from sim.model.response import BEFORE, DWELLS, FORGOTTEN
from sim.motion.flips import Flip, follow_flips, orbits_with_phases
from sim.motion.run import REVERSED
from sim.solve.assembly import numbers, reversed_numbers
from sim.solve.refinement import OnMesh

_EDGES = 6
_NO_TIMES = np.empty(0)
_TOLERANCE = 4e-4  # of a time step, in l
_UNTIL = float(BEFORE[-1])  # from here on the difference is constant
_BEFORE = BEFORE[::2].copy()  # dwells before that are simulated


@np.errstate(all="ignore")  # robots that overflow give NaN
def longer_memory(groups: Groups) -> Floats:
    """Simulate what two equal dwells before change, (B, K, D, 3) after dwells BEFORE; NaN where it cannot be."""
    found = _at_some_dwells(groups)
    knots, places = np.log(np.append(_BEFORE, FORGOTTEN)), np.log(BEFORE)
    known = np.concatenate([found, np.zeros_like(found[:, :1])], 1)
    k = np.clip(np.searchsorted(knots, places, side="right") - 1, 0, len(knots) - 2)
    share = ((places - knots[k]) / (knots[k + 1] - knots[k]))[:, None, None]
    return np.asarray((1 - share) * known[:, k] + share * known[:, k + 1])


def _at_some_dwells(groups: Groups) -> Floats:
    """Simulate the difference after two dwells of _BEFORE, (B, K, D, 3), seen as for a positive motor."""
    rows, reverse_rows, count = numbers(groups), reversed_numbers(groups), len(_BEFORE)
    dwells = np.minimum(DWELLS, _UNTIL)
    forth = orbits_with_phases(rows, groups.N, [_EDGES])[0]
    instants = [len(orbit.u) if orbit else 1 for orbit in forth]
    back = orbits_with_phases(reverse_rows, groups.N, [_EDGES], [instants])[0]
    orbits = [(f, b) if f and b else None for f, b in zip(forth, back, strict=True)]
    there = [_flip(row, *pair) if pair else None for row, pair in zip(rows, orbits, strict=True)]
    and_back = [_flip(row, *pair[::-1]) if pair else None for row, pair in zip(reverse_rows, orbits, strict=True)]
    first = follow_flips(there, _NO_TIMES, _TOLERANCE, _BEFORE)
    once = follow_flips(and_back, _NO_TIMES, _TOLERANCE, _BEFORE)
    second = [
        flip._replace(x=course.shapes[k], u=pair[1].u, until=dwell) if flip and course and pair else None
        for flip, course, pair in zip(and_back, first, orbits, strict=True)
        for k, dwell in enumerate(_BEFORE.tolist())
    ]
    twice = follow_flips(second, _NO_TIMES, _TOLERANCE)
    last: list[Flip | None] = []
    for i, (flip, course, pair) in enumerate(zip(there, once, orbits, strict=True)):
        for k, two in enumerate(twice[i * count : (i + 1) * count]):
            if flip and course and pair and two:
                last += [flip._replace(x=x, u=pair[0].u) for x in (two.end, course.shapes[k])]
            else:
                last += [None, None]
    unknown = np.full((len(dwells), 3), np.nan)
    lags = [course.lag.mean(1) if course else unknown for course in follow_flips(last, dwells, _TOLERANCE)]
    each = np.array(lags).reshape(len(rows), count, 2, len(dwells), 3)
    mirror = np.where(rows[:, :1] < 0, planar.MIRROR, np.ones(3))
    return np.asarray((each[:, :, 0] - each[:, :, 1]) * mirror[:, None, None])


def _flip(row: Floats, after: OnMesh, before: OnMesh) -> Flip:
    """Flip the motor of a robot in the steady motion `before`; its numbers afterwards are `row`."""
    return Flip(row, before.x, before.u * REVERSED, after.twist, _UNTIL)
