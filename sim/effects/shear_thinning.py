"""Tails in a shear-thinning fluid.

    ζ∥, ζ⊥ × (1 + ε s²)^(−1/4),   s = |ω| a/r0 over its value for the paper's control example

Carreau's law with exponent n = 1/2. The rate of shear at a tail is its speed |ω| a over its radius r0. √ε is the
relaxation time of the fluid times the rate of shear of the control example. The size is ε and not √ε, because for
small ε the motion changes in proportion to ε. Pure glycerol does not thin, so a verdict should not name this
effect there. Left out: thinning at the head, which turns more slowly, and the change of the rate along a bent
tail.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sim.model.effect import Effect, Factors
from sim.model.presets import CONTROL

if TYPE_CHECKING:
    from torch import Tensor

    from sim.model.groups import Groups

_CONTROL_RATE = CONTROL.omega_bar / CONTROL.l_over_r0**4 * CONTROL.l_over_r0 / CONTROL.l_over_R


@dataclass(frozen=True)
class ShearThinning(Effect):
    def scales(self, size: Tensor, groups: Groups) -> Factors:
        offset = groups.a_over_R / groups.l_over_R * groups.l_over_r0  # a/r0
        rate = groups.omega_bar.abs() / groups.l_over_r0**4 * offset / _CONTROL_RATE
        return Factors(tail_drag=(1 + size * rate**2) ** -0.25)


EFFECT = ShearThinning(
    name="shear_thinning",
    title="shear thinning",
    equation="ζ∥, ζ⊥ × (1 + ε s²)^(−1/4)",
    source="Carreau (1972), n = 1/2",
    unit="1",
    null=0.0,
    bounds=(0.0, 100.0),
    typical=0.5,
    plausible=(0.0, 20.0),
    symmetry="even",
    dissipative=True,
    similar=False,  # the relaxation time is a time of its own
)
