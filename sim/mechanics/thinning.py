"""Drag that a shear-thinning fluid takes from a tail, segment by segment.

    q → f q,   f = (1 + (λ |v|/r0)²)^(−ε/2)

v is the velocity of the node through the fluid. λ is e^time in units of the time that makes λ γ̇ = 1 at the clamps
of the paper's control example. It is the same number of seconds for robots of one material and fluid, so in units
of μ0 l⁴/EI it is proportional to r0⁴. Source: Carreau (1972). Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

import numpy as np

from sim.compiling import compiled
from sim.linear.vectors import Vector, dot, times
from sim.mechanics.drag import node_drag
from sim.mechanics.geometry import Geometry, node_tangent
from sim.model.body import Body

_SPEED, _LENGTH, _SLENDERNESS = 10.0, 6.875, 34.375  # ω̄, l/R, l/r0 of the control example
_RATE = _SPEED / _LENGTH * _SLENDERNESS  # ω̄ a/r0, a = R
UNIT_OF_TIME = _SLENDERNESS**4 / _RATE  # λ_1 (l/r0)⁴


@compiled
def thins(body: Body) -> bool:
    """Tell whether the fluid thins."""
    return bool(body.nonlocal_terms.shear_thinning != 0)


@compiled
def thinned(geometry: Geometry, body: Body, k: int, m: int, velocity: Vector) -> Vector:
    """Compute what thinning changes in the drag on node k of tail m (0: the half cell at the clamp).

    Args:
        velocity: of the node through the fluid.
    """
    n = geometry.length.shape[0]
    voronoi = 0.5 / n if k == 0 or k == n else 1.0 / n
    perp, excess = voronoi * body.zeta_perp, voronoi * (body.zeta_parallel - body.zeta_perp)
    time = UNIT_OF_TIME * body.tail_radius**4 * np.exp(body.nonlocal_terms.shear_thinning_time)
    square = dot(velocity, velocity) * (time / body.tail_radius) ** 2
    lost = (1 + square) ** (-0.5 * body.nonlocal_terms.shear_thinning) - 1
    return times(lost, node_drag(node_tangent(geometry, k, m)[0], velocity, perp, excess))
