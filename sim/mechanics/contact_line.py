"""Friction of the contact line on the head.

    F = −F_0 v/√(v² + v_s²)

on the head's centre, against its motion v in the plane. Above the speed v_s the force hardly depends on speed: the
edge of the wetted surface sticks to the head and creeps along it. v_s is CREEP, or more with the effect
`contact_line_speed`. Source: Joanny and de Gennes (1984). Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.jit import compiled
from sim.model.body import Body

CREEP = 1e-3  # l EI/(μ0 l⁴)


@compiled
def add_contact_line(body: Body, u: Floats, wrench: Floats) -> None:
    """Add the friction to the `wrench` (4,) on the robot about J, for velocities u (4,)."""
    lever = body.head_length / 2
    sway, surge = u[0] + u[2] * lever, u[1]
    creep = CREEP * (1 + body.nonlocal_terms.contact_line_speed)
    share = body.nonlocal_terms.contact_line / np.sqrt(sway * sway + surge * surge + creep * creep)
    wrench[0] -= share * sway
    wrench[1] -= share * surge
    wrench[2] -= share * sway * lever
