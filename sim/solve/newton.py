"""Newton's method for a robot on an orbit or in a stage of a time step.

Unknowns: free nodes x (n, M, 3) and the robot's velocities u (P, 4). Equations: `sim.solve.residual`. One linear
system with the matrix of `sim.solve.linearise` for robots whose effects are local. With non-local effects each
correction is found by GMRES; that matrix is its preconditioner, and products with the true one are central
differences of the residual.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled_exactly
from sim.lanes import zeros
from sim.linear import chains as separate
from sim.linear import coupled
from sim.linear.coupled import Coupled, Coupling, new_coupled
from sim.linear.gmres import combine, extend, new_krylov, start
from sim.mechanics.balance import tail_spin
from sim.mechanics.geometry import turned_edges
from sim.mechanics.tail_contact import has_contact
from sim.model.body import Body
from sim.solve.linearise import Equations, linearise, new_equations
from sim.solve.rates import Rates, is_joined
from sim.solve.residual import Room, fill_residual, is_local, new_room

FINITE_DIFFERENCE_STEP = 1e-6  # of the largest entry, in l or 1 + |ω|
RELATIVE_TOLERANCE = 1e-3  # of the residual in one Newton correction by GMRES
_MOST_PRODUCTS = 60
MOST_CORRECTIONS = 30
LARGEST_MOVE = 0.3  # of a node in one correction, in l; r0 where tails feel each other


class Workspace(NamedTuple):
    """Everything that Newton's method works in; only a coupled system needs the last part."""

    room: Room
    equations: Equations
    system: Coupled


@compiled_exactly
def new_workspace(rates: Rates, x: Floats, u: Floats) -> Workspace:
    """Allocate room for unknowns like x (n, M, 3) and u (P, 4)."""
    n, columns, instants = x.shape[0], x.shape[1], u.shape[0]
    joined = 1 if is_joined(rates) else 0
    system = new_coupled(x, n, joined * columns, joined * instants)
    return Workspace(new_room(x, u), new_equations(x, u), system)


@compiled_exactly
def newton(body: Body, rates: Rates, x: Floats, u: Floats, work: Workspace, tolerance: float) -> tuple[int, float]:
    """Improve x (n, M, 3) and u (P, 4) in place.

    Args:
        tolerance: on the last correction.

    Returns:
        Number of corrections, and size of the last one (in l and 1 + |ω|; above `tolerance`: not converged).
    """
    size = np.inf
    for count in range(1, MOST_CORRECTIONS + 1):
        dx, du = correct(body, rates, x, u, work, True)
        size = max(np.max(np.abs(dx)), np.max(np.abs(du)) / (1 + abs(body.omega)))
        if not np.isfinite(size):
            return count, np.inf
        share = min(1.0, largest_move(body) / size)
        move(body, x, share * dx)
        u += share * du
        if size < tolerance:
            return count, size
    return MOST_CORRECTIONS, size


@compiled_exactly
def correct(body: Body, rates: Rates, x: Floats, u: Floats, work: Workspace, anew: bool) -> tuple[Floats, Floats]:
    """Compute one correction dx (n, M, 3), du (P, 4), with a new factorisation (`anew`) or the stored factors."""
    local = is_local(body)
    dx, du = np.empty_like(x), np.empty_like(u)
    if anew:
        linearise(body, rates, x, u, work.room, work.equations)
    if not (anew and local):
        fill_residual(body, rates, x, u, work.room, work.equations.r, work.equations.t)
    negate(work.equations, dx, du)
    solve_linear(body, rates, x, u, work, anew, RELATIVE_TOLERANCE, dx, du)
    return dx, du


@compiled_exactly
def largest_move(body: Body) -> float:
    """Bound the move of a node in one correction, in l; tails in contact must not pass through each other."""
    return body.tail_radius if has_contact(body) else LARGEST_MOVE


@compiled_exactly
def move(body: Body, x: Floats, dx: Floats) -> None:
    """Correct the nodes x (n, M, 3) by dx; with flow, edges are turned, since stretching them would drive flow."""
    if is_local(body):
        x += dx
    else:
        x[:] = turned_edges(x, dx, body.offset)


@compiled_exactly
def negate(equations: Equations, dx: Floats, du: Floats) -> None:
    """Negate the residual: the right-hand sides of Newton's equations."""
    n, columns, _ = dx.shape
    for k in range(n):
        for m in range(columns):
            for c in range(3):
                dx[k, m, c] = -equations.r[k, m, c]
    for p in range(len(du)):
        for a in range(4):
            du[p, a] = -equations.t[p, a]


@compiled_exactly
def solve_linear(
    body: Body,
    rates: Rates,
    x: Floats,
    u: Floats,
    work: Workspace,
    anew: bool,
    tolerance: float,
    dx: Floats,
    du: Floats,
) -> None:
    """Solve with the derivative of the residual at x, u, which `linearise` left in `work`.

    Args:
        anew: factorise it; otherwise the stored factors are used.
        tolerance: of GMRES for non-local effects, a share of the preconditioned right-hand side.
        dx, du: come in as right-hand sides, (n, M, 3) and (P, 4); solved in place.
    """
    if anew:
        factor_and_solve(body, rates, u, work, dx, du)
    else:
        solve_local(rates, work, dx, du)
    if not is_local(body):
        _solve_nonlocal(body, rates, x, u, work, tolerance, dx, du)


@compiled_exactly
def factor_and_solve(body: Body, rates: Rates, u: Floats, work: Workspace, dx: Floats, du: Floats) -> None:
    """Factorise Newton's matrix without non-local effects, which `linearise` left in `work`, and solve with it.

    Args:
        dx, du: come in as right-hand sides, (n, M, 3) and (P, 4); solved in place.
    """
    chains = work.equations.chains
    if not is_joined(rates):
        separate.factor_and_solve(chains, dx, du[0])
        return
    n, columns, _ = dx.shape
    speed = zeros(dx, (columns,))
    for m in range(columns):
        speed[m] = tail_spin(body, u[m % u.shape[0]])
    coupling = Coupling(work.equations.resistance, speed, rates.differentiation)
    coupled.factor_and_solve(work.system, chains, coupling, dx.reshape((n, 3 * columns)), du.reshape(du.size))


@compiled_exactly
def solve_local(rates: Rates, work: Workspace, dx: Floats, du: Floats) -> None:
    """Solve with the factors, in place: dx (n, M, 3) and du (P, 4) come in as right-hand sides."""
    if not is_joined(rates):
        separate.solve(work.equations.chains, dx, du[0])
    else:
        n, columns, _ = dx.shape
        coupled.solve(work.system, work.equations.chains, dx.reshape(n, 3 * columns), du.reshape(du.size))


@compiled_exactly
def _solve_nonlocal(
    body: Body, rates: Rates, x: Floats, u: Floats, work: Workspace, tolerance: float, dx: Floats, du: Floats
) -> None:
    """Solve with the matrix of everything that acts, by GMRES with the factors as preconditioner.

    Args:
        tolerance: share of the preconditioned right-hand side that may be left.
        dx, du: come in as the right-hand side after `solve_local`, (n, M, 3) and (P, 4).
    """
    nodes, size = dx.size, dx.size + du.size
    scale = 1 + abs(body.omega)
    krylov = new_krylov(size, _MOST_PRODUCTS)
    above, below = np.empty(size), np.empty(size)
    right = np.empty(size)
    right[:nodes], right[nodes:] = dx.reshape(nodes), du.reshape(du.size) / scale
    count = 0
    if start(krylov, right) > 0:
        for i in range(_MOST_PRODUCTS):
            direction = krylov.basis[i]
            along_x = direction[:nodes].reshape(x.shape)
            along_u = (direction[nodes:] * scale).reshape(u.shape)
            step = FINITE_DIFFERENCE_STEP / max(np.max(np.abs(direction)), 1e-12)
            for sign, side in ((1.0, above), (-1.0, below)):
                fill_residual(
                    body, rates, x + sign * step * along_x, u + sign * step * along_u, work.room,
                    side[:nodes].reshape(x.shape), side[nodes:].reshape(u.shape),
                )  # fmt: skip
            image = (above - below) / (2 * step)
            solve_local(rates, work, image[:nodes].reshape(x.shape), image[nodes:].reshape(u.shape))
            image[nodes:] /= scale
            count = i + 1
            if extend(krylov, i, image) < tolerance:
                break
    z = combine(krylov, count)
    dx[:] = z[:nodes].reshape(dx.shape)
    du[:] = (z[nodes:] * scale).reshape(du.shape)
