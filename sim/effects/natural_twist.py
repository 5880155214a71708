"""Tails that are twisted without load.

    τ⁰ = ε/l:  the free end is turned about the tangent by ε relative to the clamp

Twist alone does not change the shape of a straight tail with a round section. Together with natural curvature it
makes the tail a helix, which has the same handedness. Left out: tails that differ from each other.
"""

from __future__ import annotations

from sim.model.effect import Effect

EFFECT = Effect(
    name="natural_twist",
    title="natural twist of the tails",
    equation="τ⁰ = ε/l",
    source="discrete elastic rods: Bergou et al. (2008), ½ GJ (τ − τ⁰)²",
    unit="1/l",
    bounds=(-6.0, 6.0),
    typical=1.0,
    symmetry="odd",
    reach="nonlocal",
    beside="natural_splay",
)
