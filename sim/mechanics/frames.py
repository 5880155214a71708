"""Material frames of a tail: natural curvature, natural twist, twist under torque, bending viscosity.

Every edge has a material frame (m1, m2, t). It is the frame of the clamp, carried along the tail without twist
(Bishop frame), and then turned by the angle θ of the edge. In the clamp's frame m1 points away from the axis. With
joint k between edges e and f,

    κ1 = ½ κb·(m2_e + m2_f),   κ2 = −½ κb·(m1_e + m1_f),   κb = 2 t_e × t_f/(1 + t_e·t_f),   τ = θ_f − θ_e
    E = Σ ½ [|κ − κ⁰ l_k|² + β (τ − τ⁰ l_k)²]/l_k,   β = GJ/EI = 2/3 (G = E/3)
    R = Σ ½ η |κ̇|²/l_k                      (Kelvin-Voigt: moments κ + η κ̇; R is a dissipation function)

The fluid resists the spin of a section about its own tangent with the torque −ζ_r Ω·t per length. Twist settles
much faster than bending. So θ is always in balance: ∂E/∂θ_j = −ζ_r l_j Ω·t_j, a tridiagonal system. Then the force
of an edge is ∂(E + R)/∂e at constant θ. Here the frames follow the edges by parallel transport in time, so that
∂τ/∂e = κb/2|e| depends on neighbouring edges only.

`add_frames` adds the difference to the elastic forces of straight, untwisted tails (`sim.mechanics.rod`), where θ
is zero. A test compares them with a framed rod by automatic differentiation.
Left out: θ̇ in the torque and the turning of the directors in κ̇ (both are of second order in curvature).
Units: EI = 1, l = 1. Source: Bergou et al. (2008, 2010); Jawed, Novelia, O'Reilly, *A Primer on the Kinematics of
Discrete Elastic Rods* (2018).
"""

from __future__ import annotations

import numpy as np

from common.arrays import Floats
from sim.jit import borrowing, compiled, formula
from sim.linear.blocks import add, add_at, put, vector
from sim.linear.vectors import ZERO, Vector, cross, dot, minus, plus, times
from sim.mechanics.balance import TailMotion
from sim.mechanics.geometry import ROOT_TANGENT, Geometry, inverse_voronoi
from sim.model.body import Body

TWIST_STIFFNESS = 2 / 3  # GJ/EI for an incompressible rod
_MOST_CORRECTIONS = 30


@formula
def transported(director: Vector, before: Vector, after: Vector) -> Vector:
    """Transport a vector in parallel from unit tangent `before` to `after`."""
    axis = cross(before, after)
    cosine = dot(before, after)
    return plus(
        times(cosine, director), plus(cross(axis, director), times(dot(axis, director) / (1 + cosine), axis))
    )


@formula
def curvature_binormal(before: Vector, after: Vector) -> Vector:
    """Compute κb of a joint."""
    return times(2 / (1 + dot(before, after)), cross(before, after))


@formula
def curvatures(binormal: Vector, first: Vector, second: Vector) -> tuple[float, float]:
    """Compute κ1, κ2 from κb and the joint's summed directors m1_e + m1_f and m2_e + m2_f."""
    return 0.5 * dot(binormal, second), -0.5 * dot(binormal, first)


@formula
def curvatures_by_edges(
    before: Vector, after: Vector, first: Vector, second: Vector, kappa: tuple[float, float]
) -> tuple[Vector, Vector, Vector, Vector]:
    """Compute |e| ∂κ1/∂e, |e| ∂κ2/∂e, |f| ∂κ1/∂f, |f| ∂κ2/∂f; frames follow by parallel transport."""
    share = 1 / (1 + dot(before, after))
    t, m1, m2 = times(share, plus(before, after)), times(share, first), times(share, second)
    return (
        minus(cross(after, m2), times(kappa[0], t)),
        minus(times(-1.0, cross(after, m1)), times(kappa[1], t)),
        minus(times(-1.0, cross(before, m2)), times(kappa[0], t)),
        minus(cross(before, m1), times(kappa[1], t)),
    )


@compiled
def _twist(a: Floats, b: Floats, torque: Floats, natural_twist: float) -> Floats:
    """Solve for the balanced angles θ (n,); the torque of joint k on its edges is ½ (a_k sin θ + b_k cos θ)."""
    n = len(torque)
    theta, change = np.zeros(n), np.zeros(n)
    slope, right = np.zeros(n), np.zeros(n)
    for _ in range(_MOST_CORRECTIONS):
        for j in range(n):
            stiffness = TWIST_STIFFNESS * inverse_voronoi(j, n)
            before = theta[j - 1] if j > 0 else 0.0
            sin, cos = np.sin(theta[j]), np.cos(theta[j])
            right[j] = torque[j] - stiffness * (theta[j] - before - natural_twist / inverse_voronoi(j, n))
            right[j] -= 0.5 * (a[j] * sin + b[j] * cos)
            slope[j] = stiffness + 0.5 * (a[j] * cos - b[j] * sin)
            if j < n - 1:
                stiffness = TWIST_STIFFNESS * n
                right[j] += stiffness * (theta[j + 1] - theta[j] - natural_twist / n)
                right[j] -= 0.5 * (a[j + 1] * sin + b[j + 1] * cos)
                slope[j] += stiffness + 0.5 * (a[j + 1] * cos - b[j + 1] * sin)
        for j in range(1, n):  # tridiagonal, off-diagonals −β n
            factor = -TWIST_STIFFNESS * n / slope[j - 1]
            slope[j] -= factor * -TWIST_STIFFNESS * n
            right[j] -= factor * right[j - 1]
        largest = 0.0
        for j in range(n - 1, -1, -1):
            change[j] = right[j] / slope[j] if j == n - 1 else (
                right[j] + TWIST_STIFFNESS * n * change[j + 1]
            ) / slope[j]  # fmt: skip
            largest = max(largest, abs(change[j]))
        theta += change
        if largest < 1e-12 or not np.isfinite(largest):
            break
    return theta


@borrowing
def _rate(geometry: Geometry, x_dot: Floats, k: int, m: int) -> Vector:
    """Compute ė/|e| of edge k."""
    rate = vector(x_dot, k, m)
    if k > 0:
        rate = minus(rate, vector(x_dot, k - 1, m))
    return times(1 / geometry.length[k, m], rate)


@borrowing
def _add_viscosity(
    geometry: Geometry, directors: Floats, viscosity: float, m: int, x_dot: Floats, torque: Floats
) -> Vector:
    """Add forces and torques of the moments η κ̇ in untwisted frames (n + 1, 1, 3); returns the clamp's moment.

    The tail stays untwisted: θ̇ cancels the twist that parallel transport in time would make.
    """
    n = geometry.length.shape[0]
    before, spin_before, rate_before = ROOT_TANGENT, 0.0, ZERO
    moment = ZERO
    for k in range(n):
        after, rate = vector(geometry.tangent, k + 1, m), _rate(geometry, x_dot, k, m)
        first_before, first_after = vector(directors, k, 0), vector(directors, k + 1, 0)
        first = plus(first_before, first_after)
        second = plus(cross(before, first_before), cross(after, first_after))
        binormal = curvature_binormal(before, after)
        kappa = curvatures(binormal, first, second)
        e_1, e_2, f_1, f_2 = curvatures_by_edges(before, after, first, second, kappa)
        spin = spin_before - 0.5 * dot(binormal, plus(rate_before, rate))
        mean_spin = 0.5 * (spin_before + spin)
        scale = viscosity * inverse_voronoi(k, n)
        moment_1 = scale * (dot(e_1, rate_before) + dot(f_1, rate) + mean_spin * kappa[1])
        moment_2 = scale * (dot(e_2, rate_before) + dot(f_2, rate) - mean_spin * kappa[0])
        about = 0.5 * (moment_1 * kappa[1] - moment_2 * kappa[0])  # ∂R/∂θ̇ of either edge
        change = plus(times(moment_1, f_1), times(moment_2, f_2))
        add(geometry.force, k, m, times(1 / geometry.length[k, m], change))
        torque[k] -= about
        if k > 0:
            change_before = plus(times(moment_1, e_1), times(moment_2, e_2))
            add(geometry.force, k - 1, m, times(1 / geometry.length[k - 1, m], change_before))
            torque[k - 1] -= about
        else:
            moment = plus(cross(after, change), times(about, after))
        before, spin_before, rate_before = after, spin, rate
    return moment


@borrowing
def has_frames(body: Body) -> bool:
    """Tell whether the tails are anything but straight, untwisted and elastic."""
    terms = body.nonlocal_terms
    curved = terms.natural_splay != 0 or terms.natural_curvature != 0 or terms.natural_twist != 0
    return bool(curved or terms.tail_spin_drag != 0 or terms.rate_dependent_modulus != 0)


@compiled
def add_frames(body: Body, geometry: Geometry, motion: TailMotion, m: int, x_dot: Floats, moments: Floats) -> None:
    """Add the forces of the frames to the edges of tail m, and the clamp's further moment to `moments`.

    Args:
        x_dot: velocities of the free nodes in the disc frame, (n, M, 3).
        moments: (M, 3).
    """
    n = geometry.length.shape[0]
    terms = body.nonlocal_terms
    out, across = terms.natural_splay, terms.natural_curvature
    a, b, torque = np.zeros(n), np.zeros(n), np.zeros(n)
    directors = np.zeros((n + 1, 1, 3))
    _untwisted(body, geometry, motion, m, directors, a, b, torque)
    moment = ZERO
    if terms.rate_dependent_modulus != 0:
        moment = _add_viscosity(geometry, directors, terms.rate_dependent_modulus, m, x_dot, torque)
    theta = _twist(a, b, torque, terms.natural_twist)
    for k in range(n):
        before, after = vector(geometry.tangent, k, m), vector(geometry.tangent, k + 1, m)
        angle_before = theta[k - 1] if k > 0 else 0.0
        first_before, second_before = _turned(vector(directors, k, 0), before, angle_before)
        first_after, second_after = _turned(vector(directors, k + 1, 0), after, theta[k])
        first, second = plus(first_before, first_after), plus(second_before, second_after)
        binormal = curvature_binormal(before, after)
        kappa = curvatures(binormal, first, second)
        e_1, e_2, f_1, f_2 = curvatures_by_edges(before, after, first, second, kappa)
        weight = inverse_voronoi(k, n)
        twist_moment = TWIST_STIFFNESS * weight * (theta[k] - angle_before - terms.natural_twist / weight)
        twisting = times(0.5 * twist_moment, binormal)
        change = minus(minus(twisting, times(out, f_1)), times(across, f_2))
        add(geometry.force, k, m, times(1 / geometry.length[k, m], change))
        if k > 0:
            change = minus(minus(twisting, times(out, e_1)), times(across, e_2))
            add(geometry.force, k - 1, m, times(1 / geometry.length[k - 1, m], change))
        else:  # the clamp turns with the disc: moment = e_0 × ∂E_0/∂e_0 + t_0 ∂E_0/∂θ_0
            about = twist_moment + 0.5 * (a[0] * np.sin(theta[0]) + b[0] * np.cos(theta[0]))
            moment = plus(moment, plus(cross(after, change), times(about, after)))
    add_at(moments, m, moment)


@borrowing
def _untwisted(
    body: Body,
    geometry: Geometry,
    motion: TailMotion,
    m: int,
    directors: Floats,
    a: Floats,
    b: Floats,
    torque: Floats,
) -> None:
    """Carry the clamp's director along tail m without twist, and compute the torques on the edges.

    Args:
        directors: (n + 1, 1, 3), filled.
        a, b: (n,), filled: the torque of joint k on both its edges is ½ (a_k sin θ + b_k cos θ).
        torque: (n,), filled: the torque of the fluid on each edge.
    """
    n = len(torque)
    terms = body.nonlocal_terms
    out, across = terms.natural_splay, terms.natural_curvature
    before, director = ROOT_TANGENT, (1.0, 0.0, 0.0)
    put(directors, 0, 0, director)
    for k in range(n):
        after = vector(geometry.tangent, k + 1, m)
        binormal = curvature_binormal(before, after)
        along_1, along_2 = dot(binormal, director), dot(binormal, cross(before, director))
        a[k], b[k] = out * along_2 - across * along_1, out * along_1 + across * along_2
        torque[k] = -terms.tail_spin_drag / n * dot(motion.spin, after)
        director = transported(director, before, after)
        put(directors, k + 1, 0, director)
        before = after


@borrowing
def _turned(director: Vector, tangent: Vector, angle: float) -> tuple[Vector, Vector]:
    """Compute the material directors of an edge."""
    other = cross(tangent, director)
    sin, cos = np.sin(angle), np.cos(angle)
    return plus(times(cos, director), times(sin, other)), minus(times(cos, other), times(sin, director))
