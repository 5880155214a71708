"""Tails that are heavier (or lighter) than the fluid and sag.

    b = −8 ε EI/l³ s e_y,   s = (l/r0)² (l/R) over its value for the paper's control example

A load q per length moves the tip of a cantilever by q l⁴/(8 EI). For the control example this is ε l. The load is
q = Δρ g π r0², so the deflection over l is proportional to l³/r0². With one material, fluid and head, s gives the
load of other tails. The load stays vertical while the tails turn, so they do not keep a fixed shape on the disc.
For vinyl polysiloxane in glycerol, the deflection is 5 to 14 % of l. Left out: the moment that tips the robot's
axis, which the surface balances.
"""

from __future__ import annotations

import numpy as np

from common.arrays import Floats
from sim.model.body import Body
from sim.model.effect import Effect
from sim.model.groups import Groups
from sim.model.presets import CONTROL


def _adds(size: Floats, groups: Groups, body: Body) -> Body:
    heavier = (groups.l_over_r0 / CONTROL.l_over_r0) ** 2 * groups.l_over_R / CONTROL.l_over_R
    none = 0.0 * size
    return body.plus(tail_load=np.stack([none, -8 * size * heavier, none]))


EFFECT = Effect(
    name="tail_sag",
    title="sag of the tails",
    equation="b = −8 ε (EI/l³) s e_y",
    source="cantilever under its own weight: tip deflection q l⁴/(8 EI)",
    unit="l, at the control example",
    bounds=(-0.4, 0.4),
    typical=0.1,
    plausible=(-0.05, 0.2),
    adds=_adds,
)
