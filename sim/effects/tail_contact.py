"""Tails that cannot pass through each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sim.model.effect import Effect

if TYPE_CHECKING:
    from torch import Tensor

    from sim.model.groups import Groups


@dataclass(frozen=True)
class TailContact(Effect):
    def number(self, size: Tensor, groups: Groups) -> Tensor:
        return 500 * size


EFFECT = TailContact(
    name="tail_contact",
    title="contact between tails",
    equation="f = ε F ln(1 + exp((2 r0 − d)/(0.008 r0)))",
    source="Tong, Choi, Joo and Jawed, Extreme Mech. Lett. 58, 101924 (2023)",
    unit="1",
    null=0.0,
    bounds=(0.0, 10.0),
    typical=0.5,
    symmetry="even",
    dissipative=False,
    reach="nonlocal",
)
