"""Tails that are curved by nature, across the plane of the axis.

    κ⁰ = (0, ε/l):  each tail alone, unloaded, is an arc that leans along the circle of the clamps, against +φ

Casting and storage bend soft tails. All tails curved in one sense are a screw: turning one way they wind up, the
other way they unwind, so left and right turns are no longer mirror images. An arc of angle ε has its tip ε l/2
aside. Left out: tails that differ from each other.
"""

from __future__ import annotations

from sim.model.effect import Effect

EFFECT = Effect(
    name="natural_curvature",
    title="natural curvature of the tails, along the circle of the clamps",
    equation="κ⁰ = ε/l across the plane of the axis",
    source="discrete elastic rods: Bergou et al. (2008), ½ EI |κ − κ⁰|²",
    unit="1/l",
    null=0.0,
    bounds=(-1.0, 1.0),
    typical=0.1,
    symmetry="odd",
    dissipative=False,
    reach="nonlocal",
)
