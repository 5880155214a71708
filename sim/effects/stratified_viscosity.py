"""Viscosity that falls with depth (ε > 0) or rises, at the tails.

    ζ∥, ζ⊥ × e^(ε y/R),   y: height over the axis

Glycerol takes up water, cools at the surface, and settles in layers. Tails that drag more on top than below push
the robot sideways. Left out: layers at the head, which change its coefficients only, and those in the flow that
forces make.
"""

from __future__ import annotations

from common.arrays import Floats
from sim.model.effect import Effect
from sim.model.groups import Groups


def _number(size: Floats, groups: Groups) -> Floats:
    return size * groups.l_over_R


EFFECT = Effect(
    name="stratified_viscosity",
    title="viscosity that differs with depth at the tails",
    equation="ζ∥, ζ⊥ × e^(ε y/R)",
    source="resistive force theory with the viscosity at the node",
    unit="1/R",
    bounds=(-0.5, 0.5),
    typical=0.1,
    plausible=(-0.3, 0.3),
    reach="nonlocal",
    number=_number,
)
