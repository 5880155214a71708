"""A robot that turns better to one side.

    M_y = ε μ0 R L² |ω_t|/2

If the head is not level or a tail is bent, there is a yaw moment that does not reverse with the motor. Then the
turn rates to the left and to the right differ. The moment is that of a side force ε μ0 R L |ω_t| at the head's
centre about J; the force itself is left out. Fit this effect before less common ones.
"""

from __future__ import annotations

from common.arrays import Floats
from sim.linear.complex_step import sign
from sim.model.body import Body
from sim.model.effect import Effect
from sim.model.groups import Groups


def _adds(size: Floats, groups: Groups, body: Body) -> Body:
    R, L = 1 / groups.l_over_R, groups.L_over_R / groups.l_over_R
    return body.with_resistance({(2, 4): -size * sign(groups.omega_bar) * R * L**2 / 2})


EFFECT = Effect(
    name="left_right_bias",
    title="left-right bias",
    equation="M_y = ε μ0 R L² |ω_t|/2",
    source="symmetry: what a mirror-symmetric robot cannot have",
    unit="μ0 R L²/2",
    bounds=(-2.0, 2.0),
    typical=0.05,
    plausible=(-0.5, 0.5),
    symmetry="odd",
    adds=_adds,
)
