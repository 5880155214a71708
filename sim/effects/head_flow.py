"""Tails swim in the flow of the head, and the head in the flow of the tails.

    v → v − ε (Stokeslets of the head's drag, rotlet of its spin) at the tails, and of the tails at the head

The head is represented by segments of its axis. Each has an equal part of the head's drag, spread over R. ε = 1 is
the full flow. The effect is large for short tails.
"""

from __future__ import annotations

from sim.model.effect import Effect

EFFECT = Effect(
    name="head_flow",
    title="flow between head and tails",
    equation="v → v − ε Σ (G f + rotlet)",
    source="Stokeslet sums: Pozrikidis (1992); regularised: Cortez, Fauci, Medovikov (2005)",
    bounds=(0.0, 1.1),
    typical=1.0,
    plausible=(0.5, 1.1),
    reach="nonlocal",
)
