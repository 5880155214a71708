"""Tails in a shear-thinning fluid.

    ζ∥, ζ⊥ × (1 + (λ γ̇)²)^(−ε/2),   γ̇ = |v|/r0,   ε = 1 − n

Carreau's law with exponent n. The rate of shear γ̇ at a segment of tail is its own speed through the fluid over its
radius, so the part that moves most thins most. λ is the relaxation time of the fluid. It is a number of its own,
`shear_thinning_time`; at its null, λ γ̇ is 1 at the clamps of the paper's control example. Pure glycerol does not
thin, so a verdict should not name this effect there. Left out: thinning at the head, which turns more slowly, and
the rate of shear by the other tails.
"""

from __future__ import annotations

from sim.model.effect import Effect

EFFECT = Effect(
    name="shear_thinning",
    title="shear thinning",
    equation="ζ∥, ζ⊥ × (1 + (λ γ̇)²)^(−ε/2), ε = 1 − n",
    source="Carreau (1972)",
    bounds=(0.0, 0.9),
    typical=0.3,
    plausible=(0.02, 0.8),
    dissipative=True,
    similar=False,  # the relaxation time is a time of its own
    reach="nonlocal",
)
