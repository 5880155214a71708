"""Bending moments that depend on the rate of curvature, too (Kelvin-Voigt).

    M = EI (κ + ε t_control κ̇)

Soft rubber in glycerol creeps. In steady swimming the curvature hardly changes while the disc turns. So the effect
is seen where it does change: after a flip of the motor, and at high speed. ε is in units of t_control, the time
scale of the control robot (2.207 s). For one material and fluid, time scales μ0 l⁴/EI are proportional to (l/r0)⁴.
"""

from __future__ import annotations

from common.arrays import Floats
from sim.model.effect import Effect
from sim.model.groups import Groups
from sim.model.presets import CONTROL


def _number(size: Floats, groups: Groups) -> Floats:
    return size * (CONTROL.l_over_r0 / groups.l_over_r0) ** 4


EFFECT = Effect(
    name="rate_dependent_modulus",
    title="modulus that depends on the rate of bending",
    equation="M = EI (κ + ε t κ̇)",
    source="Kelvin-Voigt; discrete viscous threads: Bergou et al. (2010)",
    unit="time scale of the control robot",
    bounds=(0.0, 0.5),
    typical=0.05,
    plausible=(0.0, 0.2),
    dissipative=True,
    similar=False,  # the rubber's time is its own
    reach="nonlocal",
    number=_number,
)
