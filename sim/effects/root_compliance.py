"""Clamps that give: every root turns about the clamp as on a spring.

    α = ε s (l/EI) M,   s = (r0/R)⁴ (R/l) over its value for the paper's control example

M is the bending moment at the root. The same clamps and material give the same α/M for tails of every length: in
units of l/EI it is proportional to r0⁴/l. Left out: clamps that twist, and that the half cell at the clamp drags
in its new direction: v_z is up to 0.4 % off. Natural curvature and the rate of bending at the root act as with
a rigid clamp.
"""

from __future__ import annotations

from common.arrays import Floats
from sim.model.effect import Effect
from sim.model.groups import Groups
from sim.model.presets import CONTROL


def _number(size: Floats, groups: Groups) -> Floats:
    thicker = groups.l_over_R / groups.l_over_r0 * (CONTROL.l_over_r0 / CONTROL.l_over_R)
    return size * thicker**4 * (CONTROL.l_over_R / groups.l_over_R)


EFFECT = Effect(
    name="root_compliance",
    title="clamps of the tails that give",
    equation="α = ε s (l/EI) M at the root",
    source="beam on a rotational spring",
    unit="l/EI of the control example",
    bounds=(0.0, 1.0),
    typical=0.1,
    plausible=(0.0, 0.4),
    reach="nonlocal",
    number=_number,
)
