"""Bending moments that follow a change of curvature late (Kelvin-Voigt).

    M = EI (κ + ε t_control κ̇)

Soft rubber under glycerol creeps. In steady swimming curvature hardly changes along the disc's turn, so the effect
shows where tails turn over: after a flip of the motor, and at high speed. ε is in the time scale of the
control robot (2.207 s), which for one material and fluid is a fixed time: t_control μ0 l⁴/EI ∝ (l/r0)⁴.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from torch import Tensor

from sim.effects.base import Effect

if TYPE_CHECKING:
    from sim.coefficients import Coefficients
    from sim.robot import Groups

CONTROL = 34.375  # l/r0 of the paper's control example


@dataclass(frozen=True)
class RateDependentModulus(Effect):
    def coefficients(self, size: Tensor, groups: Groups, base: Coefficients) -> Coefficients:
        return base.plus(bending_viscosity=size * (CONTROL / groups.l_over_r0) ** 4)


EFFECT = RateDependentModulus(
    name="rate_dependent_modulus",
    title="modulus that depends on the rate of bending",
    equation="M = EI (κ + ε t κ̇)",
    source="Kelvin-Voigt; discrete viscous threads: Bergou et al. (2010)",
    unit="time scale of the control robot",
    null=0.0,
    bounds=(0.0, 0.5),
    typical=0.05,
    symmetry="even",
    dissipative=True,
)
