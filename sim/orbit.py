"""Relative periodic orbit: the steady motion at constant motor speed, solved for directly.

At constant ω the robot's shape and velocities repeat with the disc's phase φ (`sim.balance` has frames and
equations). Taking φ itself as the independent variable, ẋ = ω_t dx/dφ, there is no unknown period:

    r(x(φ), ω_t x'(φ), u(φ), φ) = 0 on each tail,   T(φ) = 0 on the robot,   x and u 2π-periodic.

Tails are equal and evenly spaced, so on the branch where they move alike tail j is tail 0 a j-th part of a turn
later: one tail at all phases carries the robot,

    T(φ) = Σ_j (wrench of tail 0 at φ + 2πj/N) − R u,

and u has period 2π/N. x is collocated at M = N P phases φ_m = π/2 + 2π m/M (so placed, the mirror image of a robot
is solved on the mirror image of the phases), u at the P phases of one period;
d/dφ is the derivative of the trigonometric interpolant (spectral accuracy: at low ω̄ the shape hardly depends on
φ and M = 4 to 8 phases do). Newton's method on all phases together, solved by `sim.elimination`.

Left out: branches on which the tails move differently (time stepping finds those, `sim.settling`).
Units: l, μ0 l⁴/EI, EI/l². Source: the paper's model (arXiv 2103.05712); for collocation Trefethen (2000), ch. 3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim import elimination
from sim.compiling import compiled
from sim.elimination import System
from sim.instant import still, unbalanced
from sim.krylov import LEFT, MOST_STEPS, NUDGE, combine, extend, new_krylov, start
from sim.tail import (
    E_Z,
    NONE,
    Body,
    Geometry,
    Motion,
    add_block,
    add_head,
    body_of,
    clamp_balance,
    edge_block,
    joint_block,
    measure,
    motion_at,
    move,
    new_geometry,
    node_balance,
    put,
    vector,
    wrench_of,
)
from sim.vectors import Matrix, Vector, added, applied, cross, plus, subtracted, times, transposed, turned

Array = NDArray[np.float64]

_LARGEST_MOVE = 0.3  # of a node in one Newton correction, in l
FIRST_PHASE = np.pi / 2


@compiled
def _derivative(x: Array, differentiation: Array, k: int, m: int) -> Vector:
    total = (0.0, 0.0, 0.0)
    for j in range(x.shape[1]):
        total = plus(total, times(differentiation[m, j], vector(x, k, j)))
    return total


@compiled
def _tail_rows(
    body: Body, motion: Motion, x: Array, differentiation: Array, geometry: Geometry, system: System, m: int
) -> None:
    """Residual and drag of the nodes at phase m."""
    n, phases, _ = x.shape
    size, i = 3 * phases, 3 * m
    body_column = 2 * size + 4 * (m % (system.corner.shape[0] // 4))
    right = 2 * size + system.corner.shape[0]
    for k in range(n):
        row = system.rows[k]
        position = vector(x, k, m)
        by_phase = _derivative(x, differentiation, k, m)
        velocity = plus(plus(motion.linear, cross(motion.spin, position)), times(motion.omega_t, by_phase))
        residual, resistance, before, after = node_balance(geometry, body, motion, k, m, velocity)
        row[i, right], row[i + 1, right], row[i + 2, right] = -residual[0], -residual[1], -residual[2]

        # Drag through the velocity: −R (Ω× δx + ω_t δx') and the body's velocities.
        add_block(row, i, i, turned(resistance, motion.spin), -1.0)
        for j in range(phases):
            add_block(row, i, 3 * j, resistance, -motion.omega_t * differentiation[m, j])
        along_x = applied(resistance, motion.e_x)
        about_y = applied(resistance, cross(motion.e_y, position))
        about_z = times(body.gain, applied(resistance, plus(cross(E_Z, position), by_phase)))
        _put_border(row, i, body_column, along_x, transposed(resistance)[2], about_y, about_z)

        # Drag through the node's tangent.
        add_block(row, i, i, subtracted(after, before), 1.0)
        if k > 0:
            add_block(row, i, size + i, before, 1.0)
        if k < n - 1:
            add_block(system.upper[k + 1], i, i, after, -1.0)


@compiled
def _put_border(row: Array, i: int, column: int, a: Vector, b: Vector, c: Vector, d: Vector) -> None:
    row[i, column], row[i + 1, column], row[i + 2, column] = -a[0], -a[1], -a[2]
    row[i, column + 1], row[i + 1, column + 1], row[i + 2, column + 1] = -b[0], -b[1], -b[2]
    row[i, column + 2], row[i + 1, column + 2], row[i + 2, column + 2] = -c[0], -c[1], -c[2]
    row[i, column + 3], row[i + 1, column + 3], row[i + 2, column + 3] = -d[0], -d[1], -d[2]


@compiled
def _elastic_rows(body: Body, geometry: Geometry, system: System, m: int) -> None:
    """Derivative of f_k = E_{e_k} − E_{e_{k−1}} in the node positions, at phase m."""
    n, phases = geometry.length.shape
    size, i = 3 * phases, 3 * m
    for k in range(n):  # edge k ends at the node of row k
        row = system.rows[k]
        block = edge_block(geometry, k, m, body.axial_stiffness)
        add_block(row, i, i, block, -1.0)
        if k > 0:
            above = system.rows[k - 1]
            add_block(above, i, i, block, -1.0)
            add_block(system.upper[k], i, i, block, 1.0)
            add_block(row, i, size + i, block, 1.0)
            joint = joint_block(geometry, k, m)  # between edges k − 1 and k
            back = transposed(joint)
            add_block(above, i, i, added(joint, back), 1.0)
            add_block(system.upper[k], i, i, joint, -1.0)
            add_block(row, i, size + i, back, -1.0)
            if k > 1:
                add_block(system.upper[k - 1], i, i, joint, -1.0)
                add_block(above, i, size + i, back, -1.0)
                add_block(system.upper2[k, m], 0, 0, joint, 1.0)
                add_block(system.lower2[k, m], 0, 0, back, 1.0)


@compiled
def _body_rows(body: Body, motion: Motion, geometry: Geometry, system: System, m: int) -> None:
    """What the tail puts on the disc through its clamp at phase m, about J."""
    unknowns = system.corner.shape[0]
    t, i = 4 * (m % (unknowns // 4)), 3 * m
    clamp = clamp_balance(geometry, body, m, motion, NONE, NONE)
    wrench = wrench_of(motion, clamp.force, clamp.moment)
    for a in range(4):
        system.corner[t + a, unknowns] -= wrench[a]
    _add_foot(system.foot[0], t, i, motion, clamp.force_by_first, clamp.moment_by_first)
    _add_foot(system.foot[1], t, i, motion, clamp.force_by_second, clamp.moment_by_second)
    root = (body.offset, 0.0, 0.0)
    directions = (motion.e_x, E_Z, cross(motion.e_y, root), times(body.gain, cross(E_Z, root)))
    for c in range(4):
        drag = applied(clamp.resistance, directions[c])
        by_velocity = wrench_of(motion, drag, cross(root, drag))
        for a in range(4):
            system.corner[t + a, t + c] -= by_velocity[a]


@compiled
def _add_foot(foot: Array, t: int, i: int, motion: Motion, force: Matrix, moment: Matrix) -> None:
    by_x, by_y = applied(transposed(force), motion.e_x), applied(transposed(moment), motion.e_y)
    for b in range(3):
        foot[t, i + b] += by_x[b]
        foot[t + 1, i + b] += force[2][b]
        foot[t + 2, i + b] += by_y[b]
        foot[t + 3, i + b] += moment[2][b]


@compiled
def linearise(body: Body, x: Array, u: Array, differentiation: Array, geometry: Geometry, system: System) -> None:
    """Newton's equations at x (n, M, 3), u (P, 4), of the robot without what lies beyond (`sim.instant`)."""
    elimination.clear(system)
    measure(geometry, x, (body.offset, 0.0, 0.0), body.axial_stiffness)
    for m in range(x.shape[1]):
        motion = motion_at(body, u[m % u.shape[0]], FIRST_PHASE + 2 * np.pi * m / x.shape[1])
        _tail_rows(body, motion, x, differentiation, geometry, system, m)
        _elastic_rows(body, geometry, system, m)
        _body_rows(body, motion, geometry, system, m)
    for p in range(u.shape[0]):
        add_head(body, u[p], system.corner, 4 * p)


@compiled
def _rates(body: Body, x: Array, u: Array, differentiation: Array) -> Array:
    """Velocities of the free nodes in the disc frame, (n, M, 3)."""
    n, phases, _ = x.shape
    x_dot = np.empty_like(x)
    for m in range(phases):
        omega_t = body.omega + body.gain * u[m % u.shape[0], 3]
        for k in range(n):
            put(x_dot, k, m, times(omega_t, _derivative(x, differentiation, k, m)))
    return x_dot


@compiled
def tail_wrench(body: Body, x: Array, u: Array, differentiation: Array) -> Array:
    """(F_x, F_z, M_y, M_z) about J that the tails of one robot put on the disc, mean over the phases, (4,)."""
    n, phases, _ = x.shape
    geometry = new_geometry(n, phases)
    r, t = np.zeros((n, 3 * phases)), np.zeros(u.size)
    residual(body, x, u, differentiation, geometry, r, t)
    total = np.zeros(4)
    for p in range(u.shape[0]):
        omega_t = body.omega + body.gain * u[p, 3]
        for a in range(4):
            on_head = body.resistance[a, 4] * omega_t
            for c in range(4):
                on_head += body.resistance[a, c] * u[p, c]
            total[a] += (t[4 * p + a] + on_head) / u.shape[0]
    return total


@compiled
def residual(
    body: Body, x: Array, u: Array, differentiation: Array, geometry: Geometry, r: Array, t: Array
) -> None:
    """What is unbalanced at x (n, M, 3), u (P, 4): r (n, 3 M) on the nodes, t (4 P,) on the robot."""
    n, phases, _ = x.shape
    instants = u.shape[0]
    measure(geometry, x, (body.offset, 0.0, 0.0), body.axial_stiffness)
    x_dot, around = _rates(body, x, u, differentiation), still(n, phases)
    on_nodes = r.reshape(x.shape)
    for p in range(instants):
        phase = FIRST_PHASE + 2 * np.pi * p / phases
        unbalanced(
            body, geometry, x, x_dot, u[p], phase, p, phases // instants, around, on_nodes, t[4 * p : 4 * p + 4]
        )


@compiled
def _times_inverse(
    body: Body, x: Array, u: Array, differentiation: Array, geometry: Geometry, system: System,
    dx: Array, du: Array, right: Array, left: float,
) -> None:  # fmt: skip
    """Solve F'(x, u) z = right for z = (dx, du) by GMRES; the factors in `system`, of the matrix that leaves out
    what lies beyond (`sim.instant`), are the preconditioner.

    Args:
        right: (size,), nodes first; used up.
        dx, du: (n, 3 M) and (4 P,), filled.
        left: share of `right` that may be left.
    """
    nodes, size = dx.size, dx.size + du.size
    scale = 1 + abs(body.omega)
    krylov = new_krylov(size, MOST_STEPS)
    sides = np.zeros((2, size))
    elimination.again(system, right[:nodes].reshape(dx.shape), right[nodes:])
    right[nodes:] /= scale
    count = 0
    if start(krylov, right) > 0:
        for i in range(MOST_STEPS):
            direction = krylov.basis[i]
            step_x = direction[:nodes].reshape(x.shape)
            step_u = (direction[nodes:] * scale).reshape(u.shape)
            nudge = NUDGE / max(np.max(np.abs(direction)), 1e-12)
            for side in range(2):
                sign = 2 * side - 1.0
                residual(
                    body, x + sign * nudge * step_x, u + sign * nudge * step_u, differentiation, geometry,
                    sides[side, :nodes].reshape(dx.shape), sides[side, nodes:],
                )  # fmt: skip
            image = (sides[1] - sides[0]) / (2 * nudge)
            elimination.again(system, image[:nodes].reshape(dx.shape), image[nodes:])
            image[nodes:] /= scale
            count = i + 1
            if extend(krylov, i, image) < left:
                break
    z = combine(krylov, count)
    dx[:] = z[:nodes].reshape(dx.shape)
    du[:] = z[nodes:] * scale


@compiled
def _corrected(
    body: Body,
    x: Array,
    u: Array,
    differentiation: Array,
    geometry: Geometry,
    system: System,
    dx: Array,
    du: Array,
) -> None:
    """One Newton correction dx (n, 3 M, 1), du (4 P, 1)."""
    linearise(body, x, u, differentiation, geometry, system)
    elimination.solve(system, dx, du)
    if not body.beyond.none:
        right = np.empty(dx.size + du.size)
        residual(
            body, x, u, differentiation, geometry, right[: dx.size].reshape(dx.shape[:2]), right[dx.size :]
        )  # fmt: skip
        right *= -1.0
        column, rates = np.empty(dx.shape[:2]), np.empty(len(du))
        _times_inverse(body, x, u, differentiation, geometry, system, column, rates, right, LEFT)
        dx[:, :, 0], du[:, 0] = column, rates


@compiled
def newton(
    body: Body, x: Array, u: Array, differentiation: Array, tolerance: float, most: int
) -> tuple[int, float]:
    """Improve x (n, M, 3) and u (P, 4) in place.

    Returns:
        Number of corrections, and size of the last one (in l and 1 + |ω|; above `tolerance`: not converged).
    """
    n, phases, _ = x.shape
    geometry = new_geometry(n, phases)
    system = elimination.new_system(n, phases, u.size, 1)
    dx, du = np.zeros((n, 3 * phases, 1)), np.zeros((u.size, 1))
    size = np.inf
    for count in range(1, most + 1):
        _corrected(body, x, u, differentiation, geometry, system, dx, du)
        size = max(np.max(np.abs(dx)), np.max(np.abs(du)) / (1 + abs(body.omega)))
        if not np.isfinite(size):
            return count, np.inf
        factor = min(1.0, _LARGEST_MOVE / size)
        move(body, x, dx.reshape(x.shape), factor)
        u += factor * du.reshape(u.shape)
        if size < tolerance:
            return count, size
    return most, size


@compiled
def imbalance(body: Body, x: Array, u: Array, differentiation: Array) -> float:
    """The largest unbalanced force or wrench over the largest force that an edge carries."""
    geometry = new_geometry(x.shape[0], x.shape[1])
    r, t = np.zeros((x.shape[0], 3 * x.shape[1])), np.zeros(u.size)
    residual(body, x, u, differentiation, geometry, r, t)
    return max(np.max(np.abs(r)), np.max(np.abs(t))) / np.max(np.abs(geometry.force))


@compiled
def sensitivity(body: Body, changed: Array, width: float, x: Array, u: Array, differentiation: Array) -> Array:
    """How u changes with the robot, du/dp (K, P, 4), by the implicit function theorem: J dz/dp = −∂F/∂p.

    Args:
        changed: rows (2 K, 41): for each of K parameters the robot moved by −width and by +width. The balance is
            linear in every coefficient but the offset of the clamps, so their difference is exact to rounding.
        x, u: the solution for `body`.
    """
    n, phases, _ = x.shape
    count = len(changed) // 2
    geometry = new_geometry(n, phases)
    system = elimination.new_system(n, phases, u.size, count)
    linearise(body, x, u, differentiation, geometry, system)
    r, t = np.zeros((2, n, 3 * phases)), np.zeros((2, u.size))
    first = 6 * phases + u.size
    for i in range(count):
        for side in range(2):
            residual(body_of(changed[2 * i + side]), x, u, differentiation, geometry, r[side], t[side])
        system.rows[:, :, first + i] = (r[0] - r[1]) / (2 * width)
        system.corner[:, u.size + i] = (t[0] - t[1]) / (2 * width)
    dx, du = np.zeros((n, 3 * phases, count)), np.zeros((u.size, count))
    rights = np.empty((count, r[0].size + u.size))
    for i in range(count):
        rights[i, : r[0].size] = system.rows[:, :, first + i].copy().reshape(-1)
        rights[i, r[0].size :] = system.corner[:, u.size + i]
    elimination.solve(system, dx, du)
    if not body.beyond.none:
        for i in range(count):
            column, rates = np.empty((n, 3 * phases)), np.empty(u.size)
            _times_inverse(body, x, u, differentiation, geometry, system, column, rates, rights[i], 1e-6)
            dx[:, :, i], du[:, i] = column, rates
    return du.T.copy().reshape(count, u.shape[0], 4)
