"""Each tail swims in the flow of the others.

    v_k → v_k − ε Σ_j G(x_k − y_j) f_j   (nodes j of the other tails; G: Stokeslet)

Tails that move together carry each other along. The drag of N rigid tails along the axis is 0.78, 0.61, 0.49 and
0.40 times that of N single ones, for N = 2 to 5. ε = 1 is the full sum. The flow is solved together with the
balance (`sim.mechanics.flow`). The flow of the step before would not do: for N ≥ 4 its errors would grow.
"""

from __future__ import annotations

from sim.model.effect import Effect

EFFECT = Effect(
    name="tail_interaction",
    title="flow between the tails",
    equation="v_k → v_k − ε Σ G(x_k − y_j) f_j",
    source="Stokeslet sums: Pozrikidis (1992); regularised: Cortez, Fauci, Medovikov (2005)",
    bounds=(0.0, 1.1),
    typical=1.0,
    plausible=(0.5, 1.1),
    reach="nonlocal",
)
