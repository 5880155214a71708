"""What the balance of a robot is made of beside its geometry; effects change nothing else.

The base model fills in drag and a motor that holds its speed; the rest is zero in it. `BEYOND` names those parts
that reach further than one node of a straight, untwisted, elastic tail: material frames (`sim.frames`), flow from
one place to another (`sim.flow`) and friction at the contact line (`sim.instant`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import torch
from torch import Tensor

BEYOND = (
    "curvature_out", "curvature_across", "natural_twist", "spin_drag", "bending_viscosity",
    "tail_flow", "head_flow", "surface_flow", "contact_line",
)  # fmt: skip


@dataclass(frozen=True)
class Coefficients:
    """All that drag, motor, loads and material put into the balance of B robots (dimensionless)."""

    zeta_parallel: Tensor  # ζ∥ of the tails, (B,)
    zeta_perp: Tensor  # ζ⊥, (B,)
    resistance: Tensor  # R of head and disc about J, (4, 5, B), see `sim.drag`
    gain: Tensor  # of the motor: ω_t = ω + gain ω_h, (B,); 1 where it holds its speed
    tail_load: Tensor  # force per length on the tails, body frame (x, y up, z forward) [EI/l³], (3, B)
    curvature_out: Tensor  # natural curvature of the tails in the plane of the axis, away from it [1/l], (B,)
    curvature_across: Tensor  # the same across that plane, towards −φ
    natural_twist: Tensor  # per length [1/l], (B,)
    spin_drag: Tensor  # torque per length against the spin of a tail about its own tangent [μ0 l²], (B,)
    bending_viscosity: Tensor  # time in which bending moments follow a change of curvature [μ0 l⁴/EI], (B,)
    tail_flow: Tensor  # share of the flow that each tail feels from the others, (B,)
    head_flow: Tensor  # share of the flow between head and tails, (B,)
    surface_flow: Tensor  # share of the flow that a free surface above sends back, (B,)
    contact_line: Tensor  # friction on the head that does not depend on speed [EI/l²], (B,)

    @staticmethod
    def plain(zeta_parallel: Tensor, zeta_perp: Tensor, resistance: Tensor) -> Coefficients:
        """Drag alone, a motor that holds its speed, and nothing else."""
        none = torch.zeros_like(zeta_perp)
        return Coefficients(
            zeta_parallel,
            zeta_perp,
            resistance,
            torch.ones_like(none),
            torch.stack([none] * 3),
            *[none] * len(BEYOND),
        )

    def scaled(self, factor: Tensor) -> Coefficients:
        """With all drag `factor` times as large, (B,)."""
        return replace(
            self,
            zeta_parallel=self.zeta_parallel * factor,
            zeta_perp=self.zeta_perp * factor,
            resistance=self.resistance * factor,
            spin_drag=self.spin_drag * factor,
        )

    def with_resistance(self, entries: Mapping[tuple[int, int], Tensor]) -> Coefficients:
        """With `entries` (row, column) added to the resistance of head and disc, each (B,)."""
        extra = torch.zeros_like(self.resistance)
        for place, value in entries.items():
            extra[place] = value
        return replace(self, resistance=self.resistance + extra)

    def plus(self, **parts: Tensor) -> Coefficients:
        """With `parts` (B,) added to the fields of their names."""
        return replace(self, **{name: getattr(self, name) + value for name, value in parts.items()})

    def beyond(self) -> Tensor:
        """The parts of BEYOND, (9, B)."""
        return torch.stack([getattr(self, name) for name in BEYOND])
