"""Yaw couple of tails that turn under the free surface.

    M_y = ε μ0 N a² l ω_t

The turning tails act like a drum of radius a under the surface. Like the head, such a drum is pushed sideways. The
force acts behind J, so it yaws the robot. The formula is an estimate: a moment proportional to the spin, the
number and the length of the tails. It may change ω_yr by 10 to 70 %, with either sign. Left out: the side force
itself.
"""

from __future__ import annotations

from common.arrays import Floats
from sim.model.body import Body
from sim.model.effect import Effect
from sim.model.groups import Groups


def _adds(size: Floats, groups: Groups, body: Body) -> Body:
    offset = groups.a_over_R / groups.l_over_R
    return body.with_resistance({(2, 4): -size * groups.N * offset**2})


EFFECT = Effect(
    name="surface_couple",
    title="yaw couple of the tails under the surface",
    equation="M_y = ε μ0 N a² l ω_t",
    source="estimate; image system of a rotlet under a stress-free plane",
    unit="μ0 a² l",
    bounds=(-3.0, 3.0),
    typical=0.1,
    plausible=(-1.5, 1.5),
    adds=_adds,
)
