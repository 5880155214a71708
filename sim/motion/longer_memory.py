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
from sim.model.body import Body
from sim.model.groups import Groups
from sim.model.response import BEFORE, DWELLS, FORGOTTEN
from sim.motion.response import orbit_with_phases
from sim.motion.run import REVERSED
from sim.solve.assembly import bodies, reversed_bodies
from sim.solve.transient import lag_at, transient

_EDGES = 6
_TOLERANCE = 4e-4  # of a time step, in l
_UNTIL = float(BEFORE[-1])  # from here on the difference is constant
_BEFORE = BEFORE[::2].copy()  # dwells before that are simulated


@np.errstate(all="ignore")  # robots that overflow give NaN
def longer_memory(groups: Groups) -> Floats:
    """Simulate what two equal dwells before change, (B, K, D, 3) after dwells BEFORE; NaN where it cannot be."""
    pairs = zip(bodies(groups), reversed_bodies(groups), strict=True)
    found = np.array([_of_one(body, reverse, groups.N) for body, reverse in pairs])
    knots, places = np.log(np.append(_BEFORE, FORGOTTEN)), np.log(BEFORE)
    known = np.concatenate([found, np.zeros_like(found[:, :1])], 1)
    k = np.clip(np.searchsorted(knots, places, side="right") - 1, 0, len(knots) - 2)
    share = ((places - knots[k]) / (knots[k + 1] - knots[k]))[:, None, None]
    return np.asarray((1 - share) * known[:, k] + share * known[:, k + 1])


def _of_one(body: Body, reverse: Body, tails: int) -> Floats:
    """Simulate the difference at the dwells before that are simulated, seen as for a positive motor."""
    unknown = np.full((len(_BEFORE), len(DWELLS), 3), np.nan)
    forth = orbit_with_phases(body, tails, _EDGES)
    if forth is None:
        return unknown
    back = orbit_with_phases(reverse, tails, _EDGES, instants=forth[1].shape[0])
    if back is None:
        return unknown
    none, dwells = np.empty(0), np.minimum(DWELLS, _UNTIL)
    once = transient(reverse, forth[0].copy(), forth[1] * REVERSED, back[2], _UNTIL, _BEFORE, _TOLERANCE)
    first = transient(body, back[0].copy(), back[1] * REVERSED, forth[2], _UNTIL, _BEFORE, _TOLERANCE)
    if not (once.solved and first.solved):
        return unknown
    for k, dwell in enumerate(_BEFORE):
        mark = np.array([dwell])
        u = back[1].copy()
        twice = transient(reverse, first.shapes[k].copy(), u, back[2], float(dwell), mark, _TOLERANCE)
        if not twice.solved:
            return unknown
        curves = []
        for shape in (twice.shapes[0], once.shapes[k]):
            flip = transient(body, shape.copy(), forth[1].copy(), forth[2], _UNTIL, none, _TOLERANCE)
            if not flip.solved:
                return unknown
            curves.append(lag_at(flip, dwells).mean(1))
        unknown[k] = curves[0] - curves[1]
    return unknown * (planar.MIRROR if body.omega < 0 else np.ones(3))
