"""A motor that slows down under load.

    ω_t − ω_h = ω − ε T/(μ0 l³),   T = 8π C_r μ0 R³ |ω_h| the torque that the motor carries

The paper's motor holds its commanded speed. A direct-current motor on a fixed voltage loses speed in proportion to
torque; then |ω_h| + |ω_t| falls short of the commanded |ω|. In the balance this is a gain: ω_t = ω + gain ω_h with
gain = 1 + ε 8π C_r (R/l)³. Left out: slip of a drive, which is a part of the speed and not of the torque.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from torch import Tensor

from sim.effects.base import Effect

if TYPE_CHECKING:
    from sim.coefficients import Coefficients
    from sim.robot import Groups


@dataclass(frozen=True)
class MotorDroop(Effect):
    def coefficients(self, size: Tensor, groups: Groups, base: Coefficients) -> Coefficients:
        torque = 8 * math.pi * groups.C_r / groups.l_over_R**3  # per ω_h
        return replace(base, gain=base.gain + size * torque)


EFFECT = MotorDroop(
    name="motor_droop",
    title="droop of the motor under load",
    equation="ω_t − ω_h = ω − ε T/(μ0 l³)",
    source="torque-speed line of a direct-current motor on fixed voltage",
    unit="1/(μ0 l³)",
    null=0.0,
    bounds=(0.0, 20.0),
    typical=0.5,
    symmetry="even",
    dissipative=True,
)
