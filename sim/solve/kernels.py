"""What is compiled of orbits: Newton's method, residuals and linear solutions for groups of robots in lanes.

Arrays are (G, …, W) for G groups of W robots (`sim.solve.grouping`). Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import Any

from sim.arrays import Floats
from sim.compiling import compiled_exactly
from sim.lanes import lanes
from sim.linear.lane_arrays import largest_entry
from sim.mechanics.geometry import measure
from sim.solve.linearise import linearise
from sim.solve.newton import new_workspace, newton, solve_linear
from sim.solve.rates import on_orbit
from sim.solve.residual import fill_residual, new_room
from sim.solve.robots_in_lanes import body_in_lanes

_TOLERANCE = 1e-6  # of GMRES, for right-hand sides


@compiled_exactly
def solve_groups(
    numbers: Floats, names: Any, x: Floats, u: Floats, tolerance: float, wanted: Floats, sizes: Floats, width: Any
) -> None:
    """Improve x (G, n, M, 3, W) and u (G, P, 4, W) in place.

    Args:
        numbers: of the robots, (G, K, W).
        names: of the non-local effects.
        wanted: 1 in the lanes that are wanted, (G, W).
        sizes: of the last corrections, (G, W), filled.
        width: of the groups, see `sim.lanes`.
    """
    given, shapes, velocities = lanes(numbers, width), lanes(x, width), lanes(u, width)
    going, size = lanes(wanted, width), lanes(sizes, width)
    rates = on_orbit(shapes[0])
    work = new_workspace(rates, shapes[0], velocities[0])
    for g in range(len(given)):
        body = body_in_lanes(given[g], names)
        size[g] = newton(body, rates, shapes[g], velocities[g], work, tolerance, going[g])[1]


@compiled_exactly
def fill_residuals(
    numbers: Floats, names: Any, x: Floats, u: Floats, wanted: Floats, r: Floats, t: Floats, force: Floats,
    width: Any,
) -> None:  # fmt: skip
    """Fill r (G, n, M, 3, W), t (G, P, 4, W) and force (G, W) at x and u; arguments as in `solve_groups`."""
    given, shapes, velocities = lanes(numbers, width), lanes(x, width), lanes(u, width)
    where, largest = lanes(wanted, width), lanes(force, width)
    on_nodes, on_robots = lanes(r, width), lanes(t, width)
    rates, room = on_orbit(shapes[0]), new_room(shapes[0], velocities[0])
    for g in range(len(given)):
        body = body_in_lanes(given[g], names)
        fill_residual(body, rates, shapes[g], velocities[g], where[g], room, on_nodes[g], on_robots[g])
        measure(room.geometry, shapes[g], body.offset, body.axial_stiffness)
        largest[g] = largest_entry(room.geometry.force)


@compiled_exactly
def solve_linear_in_groups(
    numbers: Floats, names: Any, x: Floats, u: Floats, wanted: Floats, dx: Floats, du: Floats, width: Any
) -> None:
    """Solve in place for the right-hand sides dx (G, K, n, M, 3, W), du (G, K, P, 4, W); see `solve_groups`."""
    given, shapes, velocities = lanes(numbers, width), lanes(x, width), lanes(u, width)
    going, changes, changes_of_robot = lanes(wanted, width), lanes(dx, width), lanes(du, width)
    rates = on_orbit(shapes[0])
    work = new_workspace(rates, shapes[0], velocities[0])
    for g in range(len(given)):
        body, at_x, at_u = body_in_lanes(given[g], names), shapes[g], velocities[g]
        linearise(body, rates, at_x, at_u, work.room, work.equations)
        for i in range(changes.shape[1]):
            solve_linear(
                body, rates, at_x, at_u, work, i == 0, _TOLERANCE, going[g], changes[g, i], changes_of_robot[g, i]
            )
