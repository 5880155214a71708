"""Newton's method for the orbits of a group of robots, one in each lane; their effects are local.

The equations are those of `sim.solve.newton`, and so is each lane's sequence of corrections. A lane that has
converged, or cannot, waits for the others. Its numbers depend neither on them nor on the number of lanes
(`sim.lanes`). Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled_exactly
from sim.lanes import choose, lane, larger, less, somewhere, with_lane, zeros
from sim.model.body import Body
from sim.solve.linearise import linearise
from sim.solve.newton import LARGEST_MOVE, MOST_CORRECTIONS, Workspace, factor_and_solve, negate
from sim.solve.rates import Rates


@compiled_exactly
def body_in_lanes(numbers: Floats, terms: Any) -> Body:
    """Return the robots of a group as one, or one robot.

    Args:
        numbers: in the order of `sim.solve.assembly.numbers`, as vectors or as plain numbers, (K,).
        terms: numbers of the non-local effects, all zero.
    """
    v = numbers
    resistance = zeros(v, (4, 5))
    for a in range(4):
        for c in range(5):
            resistance[a, c] = v[9 + 5 * a + c]
    return Body(
        v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], resistance, v[29], (v[30], v[31], v[32]), terms
    )


@compiled_exactly
def newton_in_lanes(
    body: Body, rates: Rates, x: Floats, u: Floats, work: Workspace, tolerance: float, going: Any
) -> Any:
    """Improve x (n, M, 3) and u (P, 4) in place, in the lanes where `going` is 1.

    Returns:
        Size of each lane's last correction (in l and 1 + |ω|; above `tolerance`: not converged).
    """
    size = going * np.inf
    dx, du = zeros(x, x.shape), zeros(u, u.shape)
    for _ in range(MOST_CORRECTIONS):
        linearise(body, rates, x, u, work.room, work.equations)
        negate(work.equations, dx, du)
        factor_and_solve(body, rates, u, work, dx, du)
        change = larger(largest_entry(dx), largest_entry(du) / (1 + abs(body.omega)))
        finite = less(change, np.inf)
        size = choose(going, choose(finite, change, np.inf), size)
        going = going * finite
        share = choose(less(LARGEST_MOVE, change), LARGEST_MOVE / change, 1.0)
        add_chosen(x, share, dx, going)
        add_chosen(u, share, du, going)
        going = going * (1 - less(change, tolerance))
        if not somewhere(going):
            break
    return size


@compiled_exactly
def largest_entry(a: Floats) -> Any:
    """Find the largest magnitude in each lane; NaN where there is one."""
    flat = a.reshape(a.size)
    largest = abs(flat[0])
    for i in range(1, len(flat)):
        largest = larger(largest, abs(flat[i]))
    return largest


@compiled_exactly
def put_lane(out: Floats, i: int, values: Floats) -> None:
    """Set lane i of an array of vectors to the numbers of an array of the same size."""
    flat, given = out.reshape(out.size), values.reshape(values.size)
    for j in range(len(flat)):
        flat[j] = with_lane(flat[j], i, given[j])


@compiled_exactly
def take_lane(out: Floats, values: Floats, i: int) -> None:
    """Set the numbers of an array to lane i of an array of vectors of the same size."""
    flat, given = out.reshape(out.size), values.reshape(values.size)
    for j in range(len(flat)):
        flat[j] = lane(given[j], i)


@compiled_exactly
def add_chosen(a: Floats, share: Any, change: Floats, going: Any) -> None:
    """Add in place: a += share · change, in the lanes where `going` is 1."""
    flat, changes = a.reshape(a.size), change.reshape(change.size)
    for i in range(len(flat)):
        flat[i] = choose(going, flat[i] + share * changes[i], flat[i])
