"""Drag that acts ahead of the head's centre, or behind it.

    F = −6π μ0 R C_t v at the point ε L ahead of the head's centre

A head that lies deeper at one end, or carries a cable or a marker, drags more there. Left out: the side force,
which stays at the centre.
"""

from __future__ import annotations

import math

from common.arrays import Floats
from sim.model.body import Body
from sim.model.effect import Effect
from sim.model.groups import Groups


def _adds(size: Floats, groups: Groups, body: Body) -> Body:
    L, drag = groups.L_over_R / groups.l_over_R, 6 * math.pi * groups.C_t / groups.l_over_R
    coupled = drag * size * L  # the lever about J changes from L/2 to L/2 + ε L
    return body.with_resistance({(0, 2): coupled, (2, 0): coupled, (2, 2): coupled * L * (1 + size)})


EFFECT = Effect(
    name="head_drag_centre",
    title="drag off the head's centre",
    equation="F = −6π μ0 R C_t v at ε L ahead of the head's centre",
    source="centre of resistance: Happel and Brenner (1965)",
    unit="L, forward",
    bounds=(-0.5, 0.5),
    typical=0.05,
    plausible=(-0.3, 0.3),
    dissipative=True,
    adds=_adds,
)
