"""Tails that are curved without load, away from the axis.

    κ⁰ = (ε/l, 0):  each tail alone, without load, is an arc that bends outward (ε > 0) or inward (ε < 0)

Unlike `natural_curvature` it leaves left and right turns mirror images of each other. Left out: tails that
differ from each other.
"""

from __future__ import annotations

from sim.model.effect import Effect

EFFECT = Effect(
    name="natural_splay",
    title="natural curvature of the tails, away from the axis",
    equation="κ⁰ = ε/l in the plane of the axis",
    source="discrete elastic rods: Bergou et al. (2008), ½ EI |κ − κ⁰|²",
    unit="1/l",
    bounds=(-1.0, 1.0),
    typical=0.1,
    plausible=(-0.5, 0.5),
    reach="nonlocal",
)
