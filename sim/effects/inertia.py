"""Drag that grows with speed: the first effect of inertia at small Reynolds number.

    ζ∥, ζ⊥, R_head × (1 + ε s),   s = |ω| / ω_control

At low Reynolds number drag is proportional to velocity. Oseen's correction adds a part that is proportional to the
Reynolds number, and so to |ω|. The motor speed in rad/s is ω̄ (r0/l)⁴ π E/(4 μ0). So with one material and fluid,
s is |ω̄| (r0/l)⁴ divided by its value for the paper's control example. Left out: centripetal loads and added mass,
which are no change of drag.
"""

from __future__ import annotations

from common.arrays import Floats
from sim.linear.complex_step import magnitude
from sim.model.effect import Effect, Factors
from sim.model.groups import Groups
from sim.model.presets import CONTROL

_CONTROL_SPEED = CONTROL.omega_bar / CONTROL.l_over_r0**4


def _scales(size: Floats, groups: Groups) -> Factors:
    speed = magnitude(groups.omega_bar) / groups.l_over_r0**4 / _CONTROL_SPEED
    return Factors(drag=1 + size * speed)


EFFECT = Effect(
    name="inertia",
    title="drag growing with speed (inertia)",
    equation="ζ∥, ζ⊥, R_head × (1 + ε |ω|/ω_control)",
    source="Oseen (1910): drag × (1 + 3/16 Re) for a sphere",
    bounds=(0.0, 2.0),
    typical=0.05,
    plausible=(0.0, 0.3),
    dissipative=True,
    similar=False,  # the control example's speed is a speed of its own
    scales=_scales,
)
