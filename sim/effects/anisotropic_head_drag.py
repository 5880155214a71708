"""Head drag that differs along and across the axis.

    F_z = −6π μ0 R C_t v_z,    F_x = −6π μ0 R C_t (1 + ε) v_x

The paper gives the head one translation coefficient. A bare cylinder of L/R = 3.75 has about a tenth more
drag across its axis than along it (Tirado and Garcia de la Torre 1979); θ moves by 2 to 4 degrees.
The force acts at the head's centre, so the moment about J changes with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from sim.effects.base import Effect

if TYPE_CHECKING:
    from sim.robot import Groups


@dataclass(frozen=True)
class AnisotropicHeadDrag(Effect):
    def head_resistance(self, size: Tensor, groups: Groups, resistance: Tensor) -> Tensor:
        R = 1 / groups.l_over_R
        lever = groups.L_over_R * R / 2
        across = size * 6 * math.pi * groups.C_t * R
        extra = torch.zeros_like(resistance)
        extra[0, 0] = across
        extra[0, 2] = extra[2, 0] = across * lever
        extra[2, 2] = across * lever**2
        return resistance + extra


EFFECT = AnisotropicHeadDrag(
    name="anisotropic_head_drag",
    title="anisotropic head drag",
    equation="F_x = −6π μ0 R C_t (1 + ε) v_x, F_z = −6π μ0 R C_t v_z",
    source="Tirado and Garcia de la Torre, J. Chem. Phys. 71, 2581 (1979)",
    unit="1",
    null=0.0,
    bounds=(-0.5, 2.0),
    typical=0.3,
    symmetry="even",
    dissipative=True,
)
