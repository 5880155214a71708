"""Relative periodic orbit: the steady motion at constant motor speed, solved for directly.

At constant ω the robot's shape and velocities repeat with the disc's phase φ. With φ as the independent variable,
ẋ = ω_t dx/dφ, and there is no unknown period:

    r(x(φ), ω_t x'(φ), u(φ), φ) = 0 on each tail,   t(φ) = 0 on the robot,   x and u 2π-periodic.

Tails are equal and evenly spaced. In the motion in which they move alike, tail j at phase φ has the shape of tail
0 at phase φ + 2πj/N. So one tail at all phases is enough, and u has the period 2π/N. x is collocated at M = N P
phases φ_m = π/2 + 2π m/M, u at the P phases of one period. (The mirror image of this set of phases is the same
set, so a reversed motor gives exactly the mirror image.) d/dφ is the derivative of the trigonometric interpolant.
It has spectral
accuracy: at low ω̄ the shape hardly depends on φ, and M = 4 to 8 phases are enough. Newton's method solves for all
phases together (`sim.solve.newton`).

Left out: motions in which the tails move differently (time stepping finds those, `sim.motion.settling`).
Units: l, μ0 l⁴/EI, EI/l². Source: the paper's model (arXiv 2103.05712); for collocation Trefethen (2000), ch. 3.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled_exactly
from sim.lanes import zeros
from sim.linear.spectral import with_phases
from sim.mechanics.balance import tail_spin
from sim.mechanics.contact import tail_gap
from sim.mechanics.geometry import measure, new_geometry, straight
from sim.model.body import Body
from sim.solve.newton import new_workspace, newton
from sim.solve.rates import on_orbit
from sim.solve.residual import fill_residual, new_room

FIRST_PHASE = np.pi / 2
HEAD_SHARE = 0.3  # of the motor's speed, in the first guess


@compiled_exactly
def straight_start(body: Body, n: int, phases: int, tails: int) -> tuple[Floats, Floats]:
    """Guess x (n, M, 3) and u (P, 4): straight tails, with a part of the motor's speed in the head."""
    u = np.zeros((phases // tails, 4))
    u[:, 3] = -HEAD_SHARE * body.omega
    return straight(n, phases, body.offset), u


@compiled_exactly
def solve_orbit(body: Body, x: Floats, u: Floats, tolerance: float) -> tuple[int, float]:
    """Improve x (n, M, 3) and u (P, 4) in place; see `sim.solve.newton.newton`."""
    rates = on_orbit(x.shape[1], FIRST_PHASE)
    return newton(body, rates, x, u, new_workspace(rates, x, u), tolerance)


@compiled_exactly
def residual_on_orbit(body: Body, x: Floats, u: Floats) -> tuple[Floats, Floats]:
    """Compute the residual at x (n, M, 3), u (P, 4): r (n, M, 3) on the nodes and t (P, 4) on the robot."""
    room = new_room(x, u)
    r, t = np.empty_like(x), np.empty_like(u)
    fill_residual(body, on_orbit(x.shape[1], FIRST_PHASE), x, u, room, r, t)
    return r, t


@compiled_exactly
def largest_force(body: Body, x: Floats) -> float:
    """Find the largest force that an edge of the tails x (n, M, 3) carries."""
    geometry = new_geometry(x, x.shape[0], x.shape[1])
    measure(geometry, x, body.offset, body.axial_stiffness)
    return float(np.max(np.abs(geometry.force)))


@compiled_exactly
def mean_motion(body: Body, u: Floats) -> Floats:
    """Average (ω_t, ω_h, ω_yr, v_x, v_z) of the head's centre over time: ∫ u dφ/ω_t over ∫ dφ/ω_t."""
    total, time = zeros(u, (5,)), 0.0 * u[0, 0]
    for p in range(u.shape[0]):
        omega_t = tail_spin(body, u[p])
        time += 1 / omega_t
        total[0] += 1.0
        total[1] += u[p, 3] / omega_t
        total[2] += u[p, 2] / omega_t
        total[3] += (u[p, 0] + u[p, 2] * body.head_length / 2) / omega_t
        total[4] += u[p, 1] / omega_t
    for i in range(5):
        total[i] = total[i] / time
    return total


@compiled_exactly
def turns_forward(body: Body, u: Floats) -> bool:
    """Tell whether the tails turn with the motor at all phases."""
    smallest = np.inf
    for p in range(u.shape[0]):
        smallest = min(smallest, tail_spin(body, u[p]) * body.omega)
    return bool(smallest > 0)


@compiled_exactly
def smallest_gap(body: Body, x: Floats, tails: int) -> float:
    """Find the smallest gap between tails in a revolution, over 2 r0."""
    x = with_phases(x, 2 * x.shape[1])
    spacing = x.shape[1] // tails
    shape, smallest = np.empty((x.shape[0], tails, 3)), np.inf
    for m in range(spacing):
        for j in range(tails):
            shape[:, j] = x[:, m + j * spacing]
        smallest = min(smallest, tail_gap(shape, body.offset, body.tail_radius))
    return smallest
