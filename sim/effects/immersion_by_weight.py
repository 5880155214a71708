"""Tails whose weight draws the head deeper into the fluid (or whose buoyancy lifts it).

    β = asin 0.7 + ε s,   s = N l r0² over its value for the paper's control example, for one head
    C_yr × cos β/cos β0,   C_t, C_r × (π/2 + β)/(π/2 + β0)

R sin β is the height of the surface over the axis: 0.7 R in the paper's model of the side force. The head drags
where it is wetted. So the spin drag is proportional to the wetted arc π + 2β, and the side force to 2 cos β. C_t
is taken in proportion to the wetted arc, too: an estimate. Left out: the tilt of the axis.
"""

from __future__ import annotations

import math

import numpy as np

from common.arrays import Floats
from sim.model.body import Body, head_resistance
from sim.model.effect import Effect
from sim.model.groups import Groups
from sim.model.presets import CONTROL

_LEVEL = math.asin(0.7)


def _adds(size: Floats, groups: Groups, body: Body) -> Body:
    thicker = groups.l_over_R / groups.l_over_r0 * (CONTROL.l_over_r0 / CONTROL.l_over_R)
    change = size * thicker**2 * (groups.N * groups.l_over_R / (2 * CONTROL.l_over_R))
    wetted, side = change / (math.pi / 2 + _LEVEL), np.cos(_LEVEL + change) / math.cos(_LEVEL) - 1
    R, L = 1 / groups.l_over_R, groups.L_over_R / groups.l_over_R
    entries = head_resistance(groups.C_t * wetted, groups.C_r * wetted, groups.C_yr * side, R, L)
    return body.plus(resistance=np.array(entries))


EFFECT = Effect(
    name="immersion_by_weight",
    title="immersion that depends on the tails' weight",
    equation="β = asin 0.7 + ε s, C_yr ∝ cos β, C_t and C_r ∝ π/2 + β",
    source="Du, Miller, Jawed (arXiv 2103.05712): side force of a head that is wetted up to 0.7 R",
    unit="rad, at the control example",
    bounds=(-0.15, 0.15),
    typical=0.03,
    plausible=(-0.1, 0.1),
    dissipative=True,
    adds=_adds,
)
