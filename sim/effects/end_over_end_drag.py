"""Drag moment on the head when it turns end over end.

    M_y = −ε 8π μ0 R³ ω_yr

In the paper the fluid resists the head's translation and its spin about the axis, but not its yaw about its own
centre. A cylinder of L/R = 3.75 has ε ≈ 5 (Tirado and Garcia de la Torre 1980, rotation about a transverse axis).
This lowers ω_yr by 5 % (N = 4, l = 15 cm) to 35 % (N = 2, l = 5 cm). Left out: how the free surface changes it.
"""

from __future__ import annotations

import math

from common.arrays import Floats
from sim.model.body import Body
from sim.model.effect import Effect
from sim.model.groups import Groups


def _adds(size: Floats, groups: Groups, body: Body) -> Body:
    return body.with_resistance({(2, 2): size * 8 * math.pi / groups.l_over_R**3})


EFFECT = Effect(
    name="end_over_end_drag",
    title="head's end-over-end drag",
    equation="M_y = −ε 8π μ0 R³ ω_yr",
    source="Tirado and Garcia de la Torre, J. Chem. Phys. 73, 1986 (1980)",
    unit="8π μ0 R³",
    bounds=(0.0, 20.0),
    typical=5.0,
    plausible=(0.0, 12.0),
    dissipative=True,
    adds=_adds,
)
