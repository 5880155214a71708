"""Tails that are curved without load, along the circle of the clamps.

    κ⁰ = (0, ε/l):  each tail alone, without load, is an arc that leans along the circle of the clamps, against +φ

Casting and storage bend soft tails. If all tails are curved in the same sense, they form a screw. Turning one way
winds it up, turning the other way unwinds it. So left and right turns are no longer mirror images. The tip of an
arc of angle ε is displaced by ε l/2. Left out: tails that differ from each other.
"""

from __future__ import annotations

from sim.model.effect import Effect

EFFECT = Effect(
    name="natural_curvature",
    title="natural curvature of the tails, along the circle of the clamps",
    equation="κ⁰ = ε/l across the plane of the axis",
    source="discrete elastic rods: Bergou et al. (2008), ½ EI |κ − κ⁰|²",
    unit="1/l",
    bounds=(-1.0, 1.0),
    typical=0.1,
    plausible=(-0.5, 0.5),
    symmetry="odd",
    reach="nonlocal",
)
