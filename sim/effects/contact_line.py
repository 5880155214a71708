"""Friction of the contact line on the head, which does not depend on speed.

    F = −ε F_0 s v/√(v² + v_s²)

The edge of the wetted surface sticks to the head and creeps along it. For one material, fluid and head the force
F_0 s is the same number of newtons for all robots. In units of EI/l² a constant force is proportional to l²/r0⁴.
So s is (l/r0)⁴ (R/l)², divided by its value for the control example. F_0 = 0.1 EI/l² there, about the thrust of
that robot. Left out: the moment against yaw about the head's centre.
"""

from __future__ import annotations

from common.arrays import Floats
from sim.model.effect import Effect
from sim.model.groups import Groups
from sim.model.presets import CONTROL


def _number(size: Floats, groups: Groups) -> Floats:
    scale = (groups.l_over_r0 / CONTROL.l_over_r0) ** 4 / (groups.l_over_R / CONTROL.l_over_R) ** 2
    return 0.1 * size * scale


EFFECT = Effect(
    name="contact_line",
    title="friction of the contact line",
    equation="F = −ε F_0 s v/√(v² + v_s²)",
    source="pinned contact lines: Joanny and de Gennes (1984)",
    unit="0.1 EI/l² of the control example",
    bounds=(0.0, 1.0),
    typical=0.05,
    dissipative=True,
    similar=False,  # its creep speed is a speed of its own, see `contact_line_speed`
    reach="nonlocal",
    number=_number,
)
