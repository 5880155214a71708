"""Head drag that differs along and across the axis.

    F_x = −6π μ0 R C_t v_x,    F_z = −6π μ0 R C_t (1 + ε) v_z

The paper gives the head one coefficient for translation. A bare cylinder of L/R = 3.75 has about a tenth less drag
along its axis than across it (Tirado and Garcia de la Torre 1979): ε ≈ −0.1. This changes θ by 2 to 4 degrees.
C_t stays the drag across the axis, which changes yaw rate and radius. So ε changes only the slip angle.
"""

from __future__ import annotations

import math

from common.arrays import Floats
from sim.model.body import Body
from sim.model.effect import Effect
from sim.model.groups import Groups


def _adds(size: Floats, groups: Groups, body: Body) -> Body:
    return body.with_resistance({(1, 1): size * 6 * math.pi * groups.C_t / groups.l_over_R})


EFFECT = Effect(
    name="anisotropic_head_drag",
    title="anisotropic head drag",
    equation="F_x = −6π μ0 R C_t v_x, F_z = −6π μ0 R C_t (1 + ε) v_z",
    source="Tirado and Garcia de la Torre, J. Chem. Phys. 71, 2581 (1979)",
    bounds=(-0.8, 2.0),
    typical=-0.2,
    plausible=(-0.5, 0.5),
    dissipative=True,
    adds=_adds,
)
