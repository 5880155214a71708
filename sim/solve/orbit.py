"""Relative periodic orbit: the steady motion at constant motor speed, solved for directly.

At constant ω the robot's shape and velocities repeat with the disc's phase φ. With φ as the independent variable,
ẋ = ω_t dx/dφ, and there is no unknown period:

    r(x(φ), ω_t x'(φ), u(φ), φ) = 0 on each tail,   t(φ) = 0 on the robot,   x and u 2π-periodic.

Tails are equal and evenly spaced. In the motion in which they move alike, tail j at phase φ has the shape of tail
0 at phase φ + 2πj/N. So one tail at all phases is enough, and u has the period 2π/N. x is collocated at M = N P
phases φ_m = π/2 + 2π m/M, u at the P phases of one period. (The mirror image of this set of phases is the same
set, so a reversed motor gives exactly the mirror image.) d/dφ is the derivative of the trigonometric interpolant.
It has spectral accuracy: at low ω̄ the shape hardly depends on φ, and M = 4 to 8 phases are enough. Newton's method
solves for all phases together (`sim.solve.newton`). Arrays are (B, …) for B robots, and (G, …, W) in compiled
loops: groups of W robots in lanes (`sim.solve.grouping`).

Left out: motions in which the tails move differently (time stepping finds those, `sim.motion.settling`).
Units: l, μ0 l⁴/EI, EI/l². Source: the paper's model (arXiv 2103.05712); for collocation Trefethen (2000), ch. 3.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from common.arrays import Flags, Floats
from sim.jit import compiled
from sim.lanes import lanes
from sim.linear.lane_arrays import largest_entry
from sim.linear.spectral import with_phases
from sim.mechanics import tail_contact
from sim.mechanics.balance import tail_spin
from sim.mechanics.geometry import measure, straight
from sim.model.body import PLACES, Body
from sim.solve.grouping import InLanes, from_groups, group_of, in_groups, robots_in_lanes
from sim.solve.linearise import linearise
from sim.solve.newton import new_workspace, newton, solve_linear
from sim.solve.rates import on_orbit
from sim.solve.residual import fill_residual, new_scratch

HEAD_SHARE = 0.3  # of the motor's speed, in the first guess
_TOLERANCE = 1e-6  # of GMRES, for right-hand sides


def straight_starts(rows: Floats, n: int, phases: int, tails: int) -> tuple[Floats, Floats]:
    """Guess x (B, n, M, 3) and u (B, P, 4): straight tails, with a part of the motor's speed in the head."""
    u = np.zeros((len(rows), phases // tails, 4))
    u[:, :, 3] = -HEAD_SHARE * rows[:, PLACES.omega, None]
    return straight(n, phases, rows[:, PLACES.offset]), u


def solve_orbits_in_place(
    rows: Floats, x: Floats, u: Floats, tolerance: float, going: Flags | None = None
) -> Floats:
    """Improve the orbits x (B, n, M, 3), u (B, P, 4) of B robots in place.

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K).
        tolerance: on the last correction.
        going: which robots, (B,); all by default.

    Returns:
        Size of each robot's last correction, (B,), see `sim.solve.newton.newton`; NaN of those that are not going.
    """
    robots, shapes, velocities = robots_in_lanes(rows, going), in_groups(x), in_groups(u)
    sizes = np.empty_like(robots.wanted)
    _solve_groups(robots, shapes, velocities, tolerance, sizes)
    x[:], u[:] = from_groups(shapes, len(x)), from_groups(velocities, len(u))
    return from_groups(sizes, len(x))


def residuals_on_orbits(rows: Floats, x: Floats, u: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute the residuals at x (B, n, M, 3), u (B, P, 4) of B robots with numbers (B, K).

    Returns:
        r (B, n, M, 3) on the nodes, t (B, P, 4) on the robots, and the largest elastic force in an edge, (B,).
    """
    robots, shapes, velocities = robots_in_lanes(rows), in_groups(x), in_groups(u)
    r, t, force = np.empty_like(shapes), np.empty_like(velocities), np.empty_like(robots.wanted)
    _fill_residuals(robots, shapes, velocities, r, t, force)
    return from_groups(r, len(x)), from_groups(t, len(x)), from_groups(force, len(x))


def solve_at_orbits(rows: Floats, x: Floats, u: Floats, r: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Solve with the derivatives of `residuals_on_orbits` at x (B, n, M, 3), u (B, P, 4).

    Args:
        rows: the robots' numbers, (B, K').
        r, t: K right-hand sides for each robot, (B, K, n, M, 3) and (B, K, P, 4).

    Returns:
        The solutions, of the same shapes.
    """
    dx, du = in_groups(r), in_groups(t)
    _solve_linear_in_groups(robots_in_lanes(rows), in_groups(x), in_groups(u), dx, du)
    return from_groups(dx, len(x)), from_groups(du, len(x))


def mean_motion(body: Body, u: Floats) -> Floats:
    """Average (ω_t, ω_h, ω_yr, v_x, v_z) of the head's centre over time: ∫ u dφ/ω_t over ∫ dφ/ω_t.

    Args:
        body: one robot, or B of them (`sim.solve.assembly.batch`).
        u: velocities, (P, 4); (…, B, P, 4) for B robots.

    Returns:
        (5,), or (…, B, 5).
    """
    velocities = u.transpose(-1, -2, *range(u.ndim - 2))
    time = 1 / tail_spin(body, velocities)
    whole = time.cumsum(0)[-1]  # in the same order for one robot and for many
    v_x, v_z, omega_yr, omega_h = (velocities * time).cumsum(1)[:, -1] / whole
    sway = v_x + omega_yr * (body.head_length / 2)
    means = np.array([len(time) / whole, omega_h, omega_yr, sway, v_z])
    return np.ascontiguousarray(means.transpose(*range(1, means.ndim), 0))


def turns_forward(body: Body, u: Floats) -> Any:
    """Tell whether the tails turn with the motor at all phases; arguments as in `mean_motion`."""
    return (tail_spin(body, u.T) * body.omega > 0).all(0)


def smallest_gaps(rows: Floats, x: Floats, tails: int) -> Floats:
    """Find the smallest gap (B,) between tails x (B, n, M, 3) in a revolution, over 2 r0."""
    fine = with_phases(x, 2 * x.shape[-2])
    count, n, phases, _ = fine.shape
    shapes = np.ascontiguousarray(np.moveaxis(fine.reshape(count, n, tails, phases // tails, 3), 3, 1))
    offset, radius = np.ascontiguousarray(rows[:, [PLACES.offset, PLACES.tail_radius]].T)
    return tail_contact.smallest_gaps(shapes, offset, radius)


@compiled
def _solve_groups(robots: InLanes, x: Floats, u: Floats, tolerance: float, sizes: Floats) -> None:
    """Improve x (G, n, M, 3, W) and u (G, P, 4, W) in place; `sizes` (G, W) of the last corrections are filled."""
    shapes, velocities, size = lanes(x), lanes(u), lanes(sizes)
    rates = on_orbit(shapes[0])
    work = new_workspace(rates, shapes[0], velocities[0])
    for g in range(len(size)):
        body, going = group_of(robots, g)
        size[g] = newton(body, rates, shapes[g], velocities[g], work, tolerance, going)[1]


@compiled
def _fill_residuals(robots: InLanes, x: Floats, u: Floats, r: Floats, t: Floats, force: Floats) -> None:
    """Fill r (G, n, M, 3, W), t (G, P, 4, W) and force (G, W) at x and u, see `residuals_on_orbits`."""
    shapes, velocities = lanes(x), lanes(u)
    on_nodes, on_robots, largest = lanes(r), lanes(t), lanes(force)
    rates, scratch = on_orbit(shapes[0]), new_scratch(shapes[0], velocities[0])
    for g in range(len(largest)):
        body, where = group_of(robots, g)
        fill_residual(body, rates, shapes[g], velocities[g], where, scratch, on_nodes[g], on_robots[g])
        measure(scratch.geometry, shapes[g], body.offset, body.axial_stiffness)
        largest[g] = largest_entry(scratch.geometry.force)


@compiled
def _solve_linear_in_groups(robots: InLanes, x: Floats, u: Floats, dx: Floats, du: Floats) -> None:
    """Solve in place for the right-hand sides dx (G, K, n, M, 3, W), du (G, K, P, 4, W) at x and u."""
    shapes, velocities = lanes(x), lanes(u)
    changes, changes_of_robot = lanes(dx), lanes(du)
    rates = on_orbit(shapes[0])
    work = new_workspace(rates, shapes[0], velocities[0])
    for g in range(len(shapes)):
        (body, going), at_x, at_u = group_of(robots, g), shapes[g], velocities[g]
        linearise(body, rates, at_x, at_u, work.scratch, work.equations)
        for i in range(changes.shape[1]):
            solve_linear(
                body, rates, at_x, at_u, work, i == 0, _TOLERANCE, going, changes[g, i], changes_of_robot[g, i]
            )
