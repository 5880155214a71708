"""Tails in a shear-thinning fluid.

    ζ∥, ζ⊥ × (1 + ε s²)^(−1/4),   s = |ω| a/r0 over its value for the paper's control example

Carreau's law with exponent n = 1/2; the rate of shear at a tail is its speed |ω| a over its radius r0. √ε is the
fluid's relaxation time times the rate of the control example. (In ε and not in its root, so that a little of it
shows at first order.) Pure glycerol does not thin: a good false
candidate. Left out: thinning at the head, which turns more slowly; the rate's change along a bent tail.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from torch import Tensor

from sim.effects.base import Effect

if TYPE_CHECKING:
    from sim.coefficients import Coefficients
    from sim.robot import Groups

CONTROL_RATE = 10.0 / 34.375**4 * 34.375 / 6.875  # |ω̄| (r0/l)⁴ a/r0 of the paper's control example


@dataclass(frozen=True)
class ShearThinning(Effect):
    def coefficients(self, size: Tensor, groups: Groups, base: Coefficients) -> Coefficients:
        offset = groups.a_over_R / groups.l_over_R * groups.l_over_r0  # a/r0
        rate = groups.omega_bar.abs() / groups.l_over_r0**4 * offset / CONTROL_RATE
        factor = (1 + size * rate**2) ** -0.25
        return replace(base, zeta_parallel=base.zeta_parallel * factor, zeta_perp=base.zeta_perp * factor)


EFFECT = ShearThinning(
    name="shear_thinning",
    title="shear thinning",
    equation="ζ∥, ζ⊥ × (1 + ε s²)^(−1/4)",
    source="Carreau (1972), n = 1/2",
    unit="1",
    null=0.0,
    bounds=(0.0, 100.0),
    typical=0.5,
    symmetry="even",
    dissipative=True,
)
