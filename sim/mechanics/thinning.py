"""Drag of a tail that differs from segment to segment: thinning and stratified fluids, and laws of local drag.

    q → f q,   f = (1 + (λ |v|/r0)²)^(−ε/2) × (λ_c |v|/r0)^p × e^(g (2 s/l − 1)) × e^(γ y)

v is the velocity of the node through the fluid, s its distance from the clamp, y its height over the axis; γ is of
`sim.effects.stratified_viscosity`. ε is the size of
`sim.effects.shear_thinning`; p and g are those of `sim.model.laws`. λ is e^time in units of the time that
makes λ γ̇ = 1 at the clamps of the paper's control example; λ_c is λ for time = 0. It is the same number of seconds
for robots of one material and fluid, so in units of μ0 l⁴/EI it is proportional to r0⁴. Source: Carreau (1972).
Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

import numpy as np

from sim.jit import compiled
from sim.linear.vectors import Vector, dot, times
from sim.mechanics.drag import node_drag
from sim.mechanics.geometry import Geometry, node_tangent
from sim.model.body import Body

_SPEED, _LENGTH, _SLENDERNESS = 10.0, 6.875, 34.375  # ω̄, l/R, l/r0 of the control example
_RATE = _SPEED / _LENGTH * _SLENDERNESS  # ω̄ a/r0, a = R
_STILL = 1e-12  # square of λ_c |v|/r0; a slower node has the drag of this speed
UNIT_OF_TIME = _SLENDERNESS**4 / _RATE  # λ_1 (l/r0)⁴


@compiled
def thins(body: Body) -> bool:
    """Tell whether the drag differs from segment to segment."""
    terms = body.nonlocal_terms
    local = terms.tail_drag_by_speed != 0 or terms.tail_drag_along != 0
    return bool(terms.shear_thinning != 0 or local or terms.stratified_viscosity != 0)


@compiled
def thinned(geometry: Geometry, body: Body, k: int, m: int, velocity: Vector, height: float) -> Vector:
    """Compute what this changes in the drag on node k of tail m (0: the half cell at the clamp).

    Args:
        velocity: of the node through the fluid.
        height: y of the node.
    """
    n = geometry.length.shape[0]
    voronoi = 0.5 / n if k == 0 or k == n else 1.0 / n
    perp, excess = voronoi * body.zeta_perp, voronoi * (body.zeta_parallel - body.zeta_perp)
    terms = body.nonlocal_terms
    square = dot(velocity, velocity) * (UNIT_OF_TIME * body.tail_radius**3) ** 2  # of λ_c |v|/r0
    factor = (1 + square * np.exp(2 * terms.shear_thinning_time)) ** (-0.5 * terms.shear_thinning)
    along = terms.tail_drag_along * (2 * k / n - 1) + terms.stratified_viscosity * height
    factor = factor * np.exp(0.5 * terms.tail_drag_by_speed * np.log(square + _STILL) + along)
    return times(factor - 1, node_drag(node_tangent(geometry, k, m)[0], velocity, perp, excess))
