"""Newton's method on an orbit or in a stage of a time step, for a group of robots, one in each lane.

Unknowns: free nodes x (n, M, 3) and the robot's velocities u (P, 4). Equations: `sim.solve.residual`. One linear
system with the matrix of `sim.solve.linearise` for robots whose effects are local. With non-local effects each
correction is found by GMRES; that matrix is its preconditioner, and products with the true one are central
differences of the residual.

A lane that has converged, or cannot, waits for the others. Its numbers depend neither on them nor on the number of
lanes (`sim.lanes`). Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats
from sim.jit import borrowing, compiled, inlined
from sim.lanes import choose, empty, larger, less, somewhere, zeros
from sim.linear import chains as separate
from sim.linear import coupled
from sim.linear.coupled import Coupled, Coupling, new_coupled
from sim.linear.gmres import extend, new_krylov, solution, start
from sim.linear.lane_arrays import add_chosen, choose_all, combine, copy, divide, largest_entry
from sim.mechanics.balance import tail_spin
from sim.mechanics.geometry import turned_edges
from sim.model.body import Body
from sim.solve.grouping import reaches_further
from sim.solve.linearise import Equations, linearise, new_equations
from sim.solve.rates import Rates, is_periodic
from sim.solve.residual import Scratch, fill_residual, new_scratch

FINITE_DIFFERENCE_STEP = 1e-6  # of the largest entry, in l or 1 + |ω|
RELATIVE_TOLERANCE = 1e-3  # of the residual in one Newton correction by GMRES
_MOST_PRODUCTS = 60
MOST_CORRECTIONS = 30
LARGEST_MOVE = 0.3  # of a node in one correction, in l; r0 where tails feel each other


class Workspace(NamedTuple):
    """Everything that Newton's method works in; only a coupled system needs the last part."""

    scratch: Scratch
    equations: Equations
    system: Coupled


@compiled
def new_workspace(rates: Rates, x: Floats, u: Floats) -> Workspace:
    """Allocate arrays for unknowns like x (n, M, 3) and u (P, 4)."""
    n, columns, instants = x.shape[0], x.shape[1], u.shape[0]
    joined = 1 if is_periodic(rates) else 0
    system = new_coupled(x, n, joined * columns, joined * instants)
    return Workspace(new_scratch(x, u), new_equations(x, u), system)


class Unknowns(NamedTuple):
    """Shapes and velocities, or what belongs to their equations."""

    x: Floats  # (n, M, 3)
    u: Floats  # (P, 4)


@compiled
def new_unknowns(x: Floats, u: Floats) -> Unknowns:
    """Allocate arrays like x and u."""
    return Unknowns(empty(x, x.shape), empty(u, u.shape))


@inlined
def newton(
    body: Body, rates: Rates, x: Floats, u: Floats, work: Workspace, tolerance: float, going: Any
) -> tuple[int, Any]:
    """Improve x (n, M, 3) and u (P, 4) in place, in the lanes where `going` is 1.

    Args:
        tolerance: on the last correction.

    Returns:
        Number of corrections of the slowest lane, and the size of each lane's last one (in l and 1 + |ω|; above
        `tolerance`: not converged).
    """
    size, limit = going * np.inf, largest_move(body)
    dx, du = zeros(x, x.shape), zeros(u, u.shape)
    count = 0
    while count < MOST_CORRECTIONS and somewhere(going):
        count += 1
        correct(body, rates, x, u, work, True, going, dx, du)
        change = larger(largest_entry(dx), largest_entry(du) / (1 + abs(body.omega)))
        finite = less(change, np.inf)
        size = choose(going, choose(finite, change, np.inf), size)
        going = going * finite
        move(body, x, choose(less(limit, change), limit / change, 1.0), dx, going)
        add_chosen(u, choose(less(limit, change), limit / change, 1.0), du, going)
        going = going * (1 - less(change, tolerance))
    return count, size


@inlined
def correct(
    body: Body, rates: Rates, x: Floats, u: Floats, work: Workspace, anew: bool, going: Any, dx: Floats, du: Floats
) -> None:
    """Compute one correction dx (n, M, 3), du (P, 4), with a new factorisation (`anew`) or the stored factors."""
    if anew:
        linearise(body, rates, x, u, work.scratch, work.equations)
    if not anew or somewhere(going * reaches_further(body)):
        fill_residual(body, rates, x, u, going, work.scratch, work.equations.r, work.equations.t)
    divide(dx, work.equations.r, -1.0)
    divide(du, work.equations.t, -1.0)
    solve_linear(body, rates, x, u, work, anew, RELATIVE_TOLERANCE, going, dx, du)


@borrowing
def largest_move(body: Body) -> Any:
    """Bound the move of a node in one correction, in l; tails in contact must not pass through each other."""
    return choose(abs(body.nonlocal_terms.tail_contact), body.tail_radius, LARGEST_MOVE)


@compiled
def move(body: Body, x: Floats, share: Any, dx: Floats, going: Any) -> None:
    """Correct the nodes x (n, M, 3) by share · dx in the lanes where `going` is 1.

    With flow, edges are turned, since stretching them would drive flow.
    """
    further = going * reaches_further(body)
    if somewhere(further):
        choose_all(x, further, turned_edges(x, share, dx, body.offset), x)
    add_chosen(x, share, dx, going - further)


@inlined
def solve_linear(
    body: Body, rates: Rates, x: Floats, u: Floats, work: Workspace, anew: bool, tolerance: float, going: Any,
    dx: Floats, du: Floats,
) -> None:  # fmt: skip
    """Solve with the derivative of the residual at x, u, which `linearise` left in `work`.

    Args:
        anew: factorise it; otherwise the stored factors are used.
        tolerance: of GMRES for non-local effects, a share of the preconditioned right-hand side.
        going: 1 in the lanes that are wanted.
        dx, du: come in as right-hand sides, (n, M, 3) and (P, 4); solved in place.
    """
    if anew:
        factor_and_solve(body, rates, u, work, dx, du)
    else:
        solve_local(rates, work, dx, du)
    further = going * reaches_further(body)
    if somewhere(further):
        _solve_nonlocal(body, rates, x, u, work, tolerance, further, dx, du)


@inlined
def factor_and_solve(body: Body, rates: Rates, u: Floats, work: Workspace, dx: Floats, du: Floats) -> None:
    """Factorise Newton's matrix without non-local effects, which `linearise` left in `work`, and solve with it.

    Args:
        dx, du: come in as right-hand sides, (n, M, 3) and (P, 4); solved in place.
    """
    chains = work.equations.chains
    if not is_periodic(rates):
        separate.factor_and_solve(chains, dx, du[0])
        return
    n, columns, _ = dx.shape
    speed = zeros(dx, (columns,))
    for m in range(columns):
        speed[m] = tail_spin(body, u[m % u.shape[0]])
    coupling = Coupling(work.equations.resistance, speed, rates.differentiation)
    coupled.factor_and_solve(work.system, chains, coupling, dx.reshape((n, 3 * columns)), du.reshape(du.size))


@inlined
def solve_local(rates: Rates, work: Workspace, dx: Floats, du: Floats) -> None:
    """Solve with the factors, in place: dx (n, M, 3) and du (P, 4) come in as right-hand sides."""
    if not is_periodic(rates):
        separate.solve(work.equations.chains, dx, du[0])
    else:
        n, columns, _ = dx.shape
        coupled.solve(work.system, work.equations.chains, dx.reshape(n, 3 * columns), du.reshape(du.size))


@inlined
def _solve_nonlocal(
    body: Body, rates: Rates, x: Floats, u: Floats, work: Workspace, tolerance: float, going: Any, dx: Floats,
    du: Floats,
) -> None:  # fmt: skip
    """Solve with the matrix of everything that acts, by GMRES with the factors as preconditioner.

    Args:
        tolerance: share of the preconditioned right-hand side that may be left.
        going: 1 in the lanes that are wanted.
        dx, du: come in as the right-hand side after `solve_local`, (n, M, 3) and (P, 4).
    """
    size, scale = dx.size + du.size, 1 + abs(body.omega)
    krylov, image = new_krylov(dx, size, _MOST_PRODUCTS), empty(dx, (size,))
    above, below = new_unknowns(x, u), new_unknowns(x, u)
    moved = new_unknowns(x, u)
    copy(image[: dx.size], dx)
    divide(image[dx.size :], du, scale)
    norm = start(krylov, image)
    wanted = going = going * less(0.0, norm)
    count = 0
    while count < _MOST_PRODUCTS and somewhere(going):
        direction = krylov.basis[count]
        step = FINITE_DIFFERENCE_STEP / larger(largest_entry(direction), 1e-12)
        # The matrix times a direction is a central difference of the residual: effects have no derivatives.
        _displace(moved, x, u, step, scale, direction)
        fill_residual(body, rates, moved.x, moved.u, going, work.scratch, above.x, above.u)
        _displace(moved, x, u, -step, scale, direction)
        fill_residual(body, rates, moved.x, moved.u, going, work.scratch, below.x, below.u)
        half = 1 / (2 * step)
        combine(moved.x, half, above.x, -half, below.x)
        combine(moved.u, half, above.u, -half, below.u)
        solve_local(rates, work, moved.x, moved.u)
        copy(image[: dx.size], moved.x)
        divide(image[dx.size :], moved.u, scale)
        left = extend(krylov, count, image, going)
        going = going * (1 - less(left, tolerance * norm))
        count += 1
    solution(krylov, count, image)
    flat, velocities = dx.reshape(dx.size), du.reshape(du.size)
    choose_all(flat, wanted, image[: dx.size], flat)
    for i in range(len(velocities)):
        velocities[i] = choose(wanted, image[dx.size + i] * scale, velocities[i])


@borrowing
def _displace(out: Unknowns, x: Floats, u: Floats, step: Any, scale: Any, direction: Floats) -> None:
    """Move x and u by a step along a direction whose velocities are divided by `scale`."""
    combine(out.x, 1.0, x, step, direction[: x.size])
    combine(out.u, 1.0, u, step * scale, direction[x.size :])
