"""The surface above sends the flow of tails and head back.

    v_k → v_k − ε Σ_j G(x_k − y*_j) f*_j,   y* = (x, 2H − y, z),   f* = (f_x, −f_y, f_z),   H = 1.25 max(R, a)

Image system of a flat surface without shear. Each tail meets its own image, and with `tail_interaction` or
`head_flow` the images of the others as well. A tail passes more easily along the surface above than below the
axis: a side force behind the head, which yaws. The real interface bends over head and tails, so H is an estimate
and ε not exactly 1.
"""

from __future__ import annotations

from sim.model.effect import Effect

EFFECT = Effect(
    name="free_surface",
    title="images of the tails in the free surface",
    equation="v_k → v_k − ε Σ G(x_k − y*_j) f*_j",
    source="image system of a stress-free plane: Blake (1971); Pozrikidis (1992)",
    unit="1",
    null=0.0,
    bounds=(0.0, 1.1),
    typical=1.0,
    symmetry="even",
    dissipative=False,
    reach="nonlocal",
)
