"""How the mean motions of a group of robots change with their numbers, one robot in each lane; effects are local.

The method is that of `sim.solve.derivative`: −(∂F/∂z)⁻¹ ∂F/∂p with the matrix of Newton's method, and ∂F/∂p by
central differences. Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled_exactly
from sim.lanes import lanes, zeros
from sim.solve.groups import add_chosen, body_in_lanes
from sim.solve.linearise import linearise
from sim.solve.newton import factor_and_solve, new_workspace, solve_local
from sim.solve.orbit import FIRST_PHASE, mean_motion
from sim.solve.rates import on_orbit
from sim.solve.residual import fill_local_residual


@compiled_exactly
def slopes_of_group(
    numbers: Floats, terms: Any, directions: Floats, step: float, x: Floats, u: Floats, width: Any
) -> Floats:
    """Compute the derivatives of the means (`sim.solve.orbit.mean_motion`) on one mesh, (K, 5, W).

    Args:
        numbers: of the robots, (K', W), in the order of `sim.solve.assembly.numbers`.
        terms: numbers of the non-local effects, all zero.
        directions: in the numbers, (K, K', W).
        step: of central differences along the directions.
        x, u: the orbits, (n, M, 3, W) and (P, 4, W).
        width: of the group, see `sim.lanes`.
    """
    middle, along = lanes(numbers, width), lanes(directions, width)
    x, u = lanes(x, width), lanes(u, width)
    rates, count = on_orbit(x.shape[1], FIRST_PHASE), along.shape[0]
    work = new_workspace(rates, x, u)
    body = body_in_lanes(middle, terms)
    linearise(body, rates, x, u, work.room, work.equations)
    r, t = work.equations.r, work.equations.t
    dx, du = zeros(x, x.shape), zeros(u, u.shape)
    ends = zeros(middle, (2, middle.shape[0]))
    out = np.empty((count, 5, len(width)))
    slopes = lanes(out, width)
    for i in range(count):
        for j in range(len(middle)):
            ends[0, j], ends[1, j] = middle[j] - step * along[i, j], middle[j] + step * along[i, j]
        below, above = body_in_lanes(ends[0], terms), body_in_lanes(ends[1], terms)
        fill_local_residual(below, rates, x, u, work.room, r, t)
        _set(dx, 1 / (2 * step), r)
        _set(du, 1 / (2 * step), t)
        fill_local_residual(above, rates, x, u, work.room, r, t)
        add_chosen(dx, -1 / (2 * step), r, 1.0)
        add_chosen(du, -1 / (2 * step), t, 1.0)
        if i == 0:
            factor_and_solve(body, rates, u, work, dx, du)
        else:
            solve_local(rates, work, dx, du)
        t[:] = u
        add_chosen(t, step, du, 1.0)
        rise = mean_motion(above, t)
        add_chosen(t, -2 * step, du, 1.0)
        fall = mean_motion(below, t)
        for c in range(5):
            slopes[i, c] = (rise[c] - fall[c]) / (2 * step)
    return out


@compiled_exactly
def _set(out: Floats, factor: float, values: Floats) -> None:
    """Set out = factor · values."""
    flat, given = out.reshape(out.size), values.reshape(values.size)
    for i in range(len(flat)):
        flat[i] = factor * given[i]
