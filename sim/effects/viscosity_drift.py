"""Fluid that is warmer or colder than when its viscosity was measured.

    μ = μ0 exp(−β (T − T0)),   ε = β (T − T0)

Glycerol loses 8.6 % of its viscosity for each kelvin. All drag is proportional to μ. The flow that a force makes
is proportional to 1/μ. The effect can be found only where runs differ in temperature or in time. If all runs have
the same viscosity, only the unit of time changes.
"""

from __future__ import annotations

import numpy as np

from common.arrays import Floats
from sim.model.effect import Driver, Effect, Factors
from sim.model.groups import Groups


def _scales(size: Floats, groups: Groups) -> Factors:
    return Factors(viscosity=np.exp(-size))


EFFECT = Effect(
    name="viscosity_drift",
    title="drift of the viscosity",
    equation="μ = μ0 exp(−ε), ε = β (T − T0)",
    source="Cheng, Ind. Eng. Chem. Res. 47, 3285 (2008): β ≈ 0.086 /K for glycerol at 20 °C",
    bounds=(-2.0, 2.0),
    typical=0.086,
    dissipative=True,
    drivers=(
        Driver(
            "viscosity_with_time",
            "viscosity drifting with time",
            "elapsed_h",
            "1/h",
            (-0.3, 0.3),
            0.02,
            (-0.15, 0.15),
        ),
        Driver(
            "viscosity_with_temperature",
            "viscosity falling with temperature",
            "temperature_K",
            "1/K",
            (-0.3, 0.3),
            0.086,
            (0.03, 0.15),
        ),
    ),
    scales=_scales,
)
