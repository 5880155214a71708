"""The speed up to which friction of the contact line grows with speed.

    v_s = v_0 (1 + (e^ε − 1) s)

A contact line that moves slower than v_s drags like a fluid. A faster one rubs with a constant force. v_0 is as
slow as the numbers need. For one material and fluid v_s is the same number of metres a second for all robots. That
is proportional to l³/r0⁴ in the robot's own units. So s is (l/r0)⁴/(l/R), divided by its value for the control
example. It shows only where there is such friction (`contact_line`).
"""

from __future__ import annotations

import numpy as np

from common.arrays import Floats
from sim.model.effect import Effect
from sim.model.groups import Groups
from sim.model.presets import CONTROL


def _number(size: Floats, groups: Groups) -> Floats:
    scale = (groups.l_over_r0 / CONTROL.l_over_r0) ** 4 / (groups.l_over_R / CONTROL.l_over_R)
    return (np.exp(size) - 1) * scale


EFFECT = Effect(
    name="contact_line_speed",
    title="speed of the contact line's creep",
    equation="v_s = v_0 (1 + (e^ε − 1) s)",
    source="creep of contact lines: Blake and Haynes, J. Colloid Interface Sci. 30, 421 (1969)",
    unit="ln of 10⁻³ l EI/(μ0 l⁴)",
    bounds=(0.0, 7.0),
    typical=4.0,
    dissipative=True,
    similar=False,
    reach="nonlocal",
    beside="contact_line",
    grid=(0.0, 4.0, 6.0),
    number=_number,
)
