"""Drag on the disc that carries the tails.

    M_z = −ε 8π μ0 R³ ω_t

In the paper the torques of tails and head are equal. But the disc turns in the fluid, too. A thin disc of radius R
that turns about its axis, far from everything, has ε = 32/3/(8π) = 0.42. The effect is like that of the drag on
the tails' own spin, but it does not depend on the length of the tails. Left out: the gap between disc and head.
"""

from __future__ import annotations

import math

from common.arrays import Floats
from sim.model.body import Body
from sim.model.effect import Effect
from sim.model.groups import Groups


def _adds(size: Floats, groups: Groups, body: Body) -> Body:
    return body.with_resistance({(3, 4): size * 8 * math.pi / groups.l_over_R**3})


EFFECT = Effect(
    name="disc_drag",
    title="drag on the disc",
    equation="M_z = −ε 8π μ0 R³ ω_t",
    source="Happel and Brenner (1973), disc rotating about its axis: torque 32/3 μ R³ ω",
    unit="8π μ0 R³",
    bounds=(0.0, 10.0),
    typical=0.4,
    plausible=(0.0, 4.0),
    dissipative=True,
    adds=_adds,
)
