"""Drag on the tails' spin about their own tangents.

    torque per length = −ε 4π μ0 r0² (Ω·t) t

A tail that is clamped to the disc turns about its own tangent once in each turn of the disc. Resistive force
theory leaves out the drag on this spin. It twists the tails and brakes the disc. For a single filament the moment
about the axis grows by a third.
"""

from __future__ import annotations

import math

from common.arrays import Floats
from sim.model.effect import Effect
from sim.model.groups import Groups


def _number(size: Floats, groups: Groups) -> Floats:
    return size * 4 * math.pi / groups.l_over_r0**2


EFFECT = Effect(
    name="tail_spin_drag",
    title="drag on the tails' own spin",
    equation="torque per length = −ε 4π μ0 r0² (Ω·t) t",
    source="long cylinder turning about its axis, e.g. Lamb (1932), art. 333",
    unit="4π μ0 r0²",
    bounds=(0.0, 3.0),
    typical=1.0,
    plausible=(0.5, 1.5),
    dissipative=True,
    reach="nonlocal",
    is_drag=True,
    number=_number,
)
