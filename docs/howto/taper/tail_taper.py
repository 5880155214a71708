"""Tails whose bending stiffness changes from the clamp to the tip.

    EI(s) = EI (1 + ε (1 − 2 s/l))

The mean over the tail is EI for every ε. A tail is drawn from a mould with a draft angle, so it is thicker and
stiffer at the clamp. Left out: the taper of the radius in drag and axial stiffness. Natural curvature, twist and
bending viscosity keep the mean stiffness.
"""

from __future__ import annotations

from sim.model.effect import Effect

EFFECT = Effect(
    name="tail_taper",
    title="taper of the tails' bending stiffness",
    equation="EI(s) = EI (1 + ε (1 − 2 s/l))",
    source="Euler-Bernoulli beam of variable section",
    bounds=(-0.9, 0.9),
    typical=0.2,
    plausible=(0.0, 0.5),
    reach="nonlocal",
)
