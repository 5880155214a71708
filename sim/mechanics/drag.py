"""Resistive force theory: the fluid's drag on tails at low Reynolds number, and what changes it along them.

Per node, with Voronoi length l_k, unit tangent t, and velocity v through the fluid,

    q = −l_k [ζ⊥ v + (ζ∥ − ζ⊥) (t·v) t],   ζ∥ = 2π μ0/(ln(l/r0) − ½),   ζ⊥ = 4π μ0/(ln(l/r0) + ½).

In thinning and stratified fluids, and by laws of local drag, it differs from segment to segment, q → f q,

    f = (1 + (λ |v|/r0)²)^(−ε/2) × (λ_c |v|/r0)^p × e^(g (2 s/l − 1)) × e^(γ y).

s is the distance of the node from the clamp, y its height over the axis; γ is of
`sim.effects.stratified_viscosity`, ε of `sim.effects.shear_thinning`; p and g are those of `sim.model.laws`. λ is
e^time in units of the time that makes λ γ̇ = 1 at the clamps of the paper's control example; λ_c is λ for time =
0. It is the same number of seconds for robots of one material and fluid, so in units of μ0 l⁴/EI it is
proportional to r0⁴.

The contact line of the surface resists the motion v of the head's centre in the plane by friction,

    F = −F_0 v/√(v² + v_s²).

Above the speed v_s the force hardly depends on speed: the edge of the wetted surface sticks to the head and creeps
along it. v_s is CREEP, or more with the effect `contact_line_speed`.

Units: length l, time μ0 l⁴/EI, force EI/l² (so μ0 = 1). Validity: slender tails (l/r0 ≳ 10), no inertia. Drag on
the head: `sim.model.body.head_resistance`. Left out here: interactions between tails, head and surface. Source:
Du, Miller, Jawed (arXiv 2103.05712), hydrodynamic model; Gray and Hancock (1955); Carreau (1972) for thinning;
Joanny and de Gennes (1984) for the contact line.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from common.arrays import Floats
from sim.jit import borrowing, formula
from sim.linear.vectors import Matrix, Vector, dot, minus, outer, plus, plus_identity, times
from sim.mechanics.geometry import Geometry, node_tangent
from sim.model.body import Body

_SPEED, _LENGTH, _SLENDERNESS = 10.0, 6.875, 34.375  # ω̄, l/R, l/r0 of the control example
_RATE = _SPEED / _LENGTH * _SLENDERNESS  # ω̄ a/r0, a = R
_STILL = 1e-12  # square of λ_c |v|/r0; a slower node has the drag of this speed
UNIT_OF_TIME = _SLENDERNESS**4 / _RATE  # λ_1 (l/r0)⁴
CREEP = 1e-3  # l EI/(μ0 l⁴)


@formula
def tail_coefficients(l_over_r0: Any) -> tuple[Any, Any]:
    """Compute the drag coefficients per length (ζ∥, ζ⊥) in units of μ0."""
    log_slenderness = np.log(l_over_r0)
    return 2 * math.pi / (log_slenderness - 0.5), 4 * math.pi / (log_slenderness + 0.5)


@formula
def node_drag(tangent: Vector, velocity: Vector, perp: Any, excess: Any) -> Vector:
    """Compute q = −[perp v + excess (t·v) t], with perp = l_k ζ⊥ and excess = l_k (ζ∥ − ζ⊥)."""
    return times(-1, plus(times(perp, velocity), times(excess * dot(tangent, velocity), tangent)))


@formula
def node_resistance(tangent: Vector, perp: Any, excess: Any) -> Matrix:
    """Compute −∂q/∂v = perp I + excess t⊗t."""
    return plus_identity(outer(times(excess, tangent), tangent), perp)


@formula
def drag_by_tangents(tangent: Vector, spread: Any, velocity: Vector, excess: Any) -> Matrix:
    """Compute −∂q/∂S for a node tangent t = S/|S| (S: sum of the adjacent edge tangents, |S| = spread).

    excess/|S| [t⊗v + (t·v) I] (I − t⊗t).
    """
    along = dot(tangent, velocity)
    scale = excess / spread
    tilt = outer(times(scale, tangent), minus(velocity, times(2 * along, tangent)))
    return plus_identity(tilt, scale * along)


@borrowing
def thins(body: Body) -> bool:
    """Tell whether the drag differs from segment to segment."""
    terms = body.nonlocal_terms
    local = terms.tail_drag_by_speed != 0 or terms.tail_drag_along != 0
    return bool(terms.shear_thinning != 0 or local or terms.stratified_viscosity != 0)


@borrowing
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


@borrowing
def add_contact_line(body: Body, u: Floats, wrench: Floats) -> None:
    """Add the friction to the `wrench` (4,) on the robot about J, for velocities u (4,)."""
    lever = body.head_length / 2
    sway, surge = u[0] + u[2] * lever, u[1]
    creep = CREEP * (1 + body.nonlocal_terms.contact_line_speed)
    share = body.nonlocal_terms.contact_line / np.sqrt(sway * sway + surge * surge + creep * creep)
    wrench[0] -= share * sway
    wrench[1] -= share * surge
    wrench[2] -= share * sway * lever
