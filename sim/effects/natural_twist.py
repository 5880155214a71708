"""Tails that are twisted by nature.

    τ⁰ = ε/l:  the free end is turned about the tangent by ε against the clamp

A straight tail of round section hides its twist; one with natural curvature becomes a helix, handed like the
twist. Left out: tails that differ from each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from torch import Tensor

from sim.effects.base import Effect

if TYPE_CHECKING:
    from sim.coefficients import Coefficients
    from sim.robot import Groups


@dataclass(frozen=True)
class NaturalTwist(Effect):
    def coefficients(self, size: Tensor, groups: Groups, base: Coefficients) -> Coefficients:
        return base.plus(natural_twist=size)


EFFECT = NaturalTwist(
    name="natural_twist",
    title="natural twist of the tails",
    equation="τ⁰ = ε/l",
    source="discrete elastic rods: Bergou et al. (2008), ½ GJ (τ − τ⁰)²",
    unit="1/l",
    null=0.0,
    bounds=(-6.0, 6.0),
    typical=1.0,
    symmetry="odd",
    dissipative=False,
    beside="natural_splay",
)
