"""Fluid warmer or colder than when its viscosity was taken.

    μ = μ0 exp(−β (T − T0)),   ε = β (T − T0)

Glycerol loses 8.6 % of its viscosity a kelvin. Everything that drags scales with μ. Needs a thermometer: with one
viscosity for all runs it is only another unit of time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from sim.effects.base import Effect

if TYPE_CHECKING:
    from sim.coefficients import Coefficients
    from sim.robot import Groups


@dataclass(frozen=True)
class ViscosityDrift(Effect):
    def coefficients(self, size: Tensor, groups: Groups, base: Coefficients) -> Coefficients:
        return base.scaled(torch.exp(-size))


EFFECT = ViscosityDrift(
    name="viscosity_drift",
    title="viscosity drifting with temperature",
    equation="μ = μ0 exp(−ε), ε = β (T − T0)",
    source="Cheng, Ind. Eng. Chem. Res. 47, 3285 (2008): β ≈ 0.086 /K for glycerol at 20 °C",
    unit="1",
    null=0.0,
    bounds=(-2.0, 2.0),
    typical=0.086,
    symmetry="even",
    dissipative=True,
    covariate="temperature_K",
)
