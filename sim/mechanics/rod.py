"""Discrete elastic rod, twist condensed out: energy, force and stiffness of straight isotropic tails.

A tail has nodes 0..n and edges e_j = x_{j+1} − x_j of natural length h = 1/n. Its energy is

    E_s = ½ EA Σ (|e_j|/h − 1)² h
    E_b = ½ EI Σ |κ_k|² / l_k,   κ_k = 2 t_{k−1} × t_k / (1 + t_{k−1}·t_k)   (t = e/|e|).

Since |κ_k|² = 4 (1 − c)/(1 + c) depends only on c = t_{k−1}·t_k, the energy is E_b = Σ g(c_k), with
g' = −4 EI/l_k (1 + c)⁻² and g'' = 8 EI/l_k (1 + c)⁻³. Forces and stiffness follow by the chain rule.

Clamp: node 0 and the root *tangent* t_{−1} are fixed. The bending energy between this tangent and edge 0 has the
half Voronoi length l_0 = h/2 (l_k = h elsewhere). This converges at second order. With two fixed nodes the tail
would be too short, and the error would be of first order.

Natural curvature and twist are zero here. Then the twist of an isotropic rod with a free end relaxes to zero,
whatever the shape, and there is no force of twist on the nodes. `sim.mechanics.frames` has the material frames.

Written node by node on component tuples (`sim.linear.vectors`), for compiled loops (`sim.mechanics.geometry`) and
for arrays. Units: EI = 1, l = 1, so EA = 4 (l/r0)².
Source: Bergou et al. (2008, 2010); Jawed, Novelia, O'Reilly, *A Primer on the Kinematics of Discrete
Elastic Rods* (2018); the paper's energies (arXiv 2103.05712, eqs. 1-3).
"""

from __future__ import annotations

from typing import Any

from sim.jit import formula
from sim.linear.vectors import (
    Matrix,
    Vector,
    added,
    cross,
    crossed,
    dot,
    minus,
    outer,
    plus,
    plus_identity,
    projected,
    times,
)


@formula
def bend(
    before: Vector, after: Vector, length_before: Any, length_after: Any, inverse_voronoi: Any
) -> tuple[Any, Any, Any, Vector, Vector]:
    """Bend two edges with tangents `before` and `after`: compute c, g', g'', ∂c/∂e_after, ∂c/∂e_before."""
    c = dot(before, after)
    inverse = 1 / (1 + c)
    first = -4 * inverse_voronoi * inverse * inverse
    by_after = times(1 / length_after, minus(before, times(c, after)))
    by_before = times(1 / length_before, minus(after, times(c, before)))
    return c, first, -2 * first * inverse, by_after, by_before


@formula
def edge_force(
    tangent: Vector, length: Any, n: Any, axial_stiffness: Any,
    first: Any, by_after: Vector, first_next: Any, by_before_next: Vector,
) -> Vector:  # fmt: skip
    """Compute ∂E/∂e_j, the force that edge j carries: stretching, the joint before it and the joint after it."""
    bending = plus(times(first, by_after), times(first_next, by_before_next))
    return plus(times(axial_stiffness * (length * n - 1), tangent), bending)


@formula
def edge_stiffness(
    tangent: Vector, length: Any, n: Any, axial_stiffness: Any,
    c: Any, first: Any, second: Any, by_after: Vector,
    c_next: Any, first_next: Any, second_next: Any, by_before_next: Vector,
) -> Matrix:  # fmt: skip
    """Compute ∂²E/∂e_j²: α I + t⊗(β t + q) + q⊗t + g'' p⊗p + g''_next m⊗m."""
    turning = (first * c + first_next * c_next) / (length * length)
    q = times(-1 / length, plus(times(first, by_after), times(first_next, by_before_next)))
    beta = axial_stiffness / length + turning
    block = added(outer(tangent, plus(times(beta, tangent), q)), outer(q, tangent))
    block = added(block, outer(by_after, times(second, by_after)))
    block = added(block, outer(by_before_next, times(second_next, by_before_next)))
    return plus_identity(block, axial_stiffness * (n - 1 / length) - turning)


@formula
def joint_stiffness(
    before: Vector, after: Vector, length_before: Any, length_after: Any,
    c: Any, first: Any, second: Any, by_after: Vector, by_before: Vector,
) -> Matrix:  # fmt: skip
    """Compute ∂²E/∂e_before ∂e_after of the joint between them: g'' m⊗p + g' P_before P_after/(|e||e|)."""
    scale = first / (length_before * length_after)
    block = outer(by_before, times(second, by_after))
    block = added(block, outer(times(scale, before), minus(times(c, after), before)))
    block = added(block, outer(times(-scale, after), after))
    return plus_identity(block, scale)


@formula
def clamp_moment(root_tangent: Vector, tangent: Vector, first: Any) -> Vector:
    """Compute the moment of the bending spring at the clamp on the disc: −g' t_{−1} × t_0."""
    return times(-first, cross(root_tangent, tangent))


@formula
def clamp_moment_by_edge(
    root_tangent: Vector, tangent: Vector, length: Any, first: Any, second: Any, by_after: Vector
) -> Matrix:
    """Compute the derivative of the clamp's moment in edge 0."""
    zero = 0 * length
    cross_matrix = crossed(root_tangent, ((1 + zero, zero, zero), (zero, 1 + zero, zero), (zero, zero, 1 + zero)))
    turned = projected(cross_matrix, tangent, -first / length)
    return added(outer(times(-second, cross(root_tangent, tangent)), by_after), turned)
