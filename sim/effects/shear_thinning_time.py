"""The relaxation time of a shear-thinning fluid.

    λ = e^ε λ_1,   λ_1 γ̇ = 1 at the clamps of the paper's control example

It shows only where the fluid thins (`shear_thinning`). A table of runs tells it from the exponent only if its
rates of shear reach from below 1/λ to above it.
"""

from __future__ import annotations

from sim.model.effect import Effect

EFFECT = Effect(
    name="shear_thinning_time",
    title="relaxation time of the thinning fluid",
    equation="λ = e^ε λ_1",
    source="Carreau (1972)",
    unit="ln of the control example's 1/γ̇",
    bounds=(-2.5, 2.5),
    typical=0.7,
    dissipative=True,
    similar=False,
    reach="nonlocal",
    beside="shear_thinning",
    grid=(-1.5, 0.0, 1.5),
)
