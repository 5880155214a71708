"""The free surface changes the flow that tails and head make.

    v_k → v_k − ε Σ_j G(x_k − y*_j) f*_j,   y* = (x, 2H − y, z),   f* = (f_x, −f_y, f_z),   H = 1.25 max(R, a)

The flow is that of mirror images above a flat surface without shear. Each tail is in the flow of its own image;
with `tail_interaction` or `head_flow` it is in the flow of the other images, too. A tail meets less resistance
while it passes above the axis, near the surface, than below it. So there is a side force behind the head, which
yaws the robot. The real surface bends over head and tails. So H is an estimate, and ε is not exactly 1.
"""

from __future__ import annotations

from sim.model.effect import Effect

EFFECT = Effect(
    name="free_surface",
    title="images of the tails in the free surface",
    equation="v_k → v_k − ε Σ G(x_k − y*_j) f*_j",
    source="image system of a stress-free plane: Blake (1971); Pozrikidis (1992)",
    bounds=(0.0, 1.1),
    typical=1.0,
    plausible=(0.3, 1.1),
    reach="nonlocal",
)
