"""Implicit time steps of one robot in compiled loops: the scheme of `sim.stepper`, fast on a processor.

The N tails are N lanes, each turned so that its clamp lies at (a, 0, 0); tail j of a robot at disc phase φ is at
phase φ + 2πj/N. Every stage solves the balance of `sim.balance` with x = x* + τ ẋ, φ = φ* + τ ω_t by Newton's
method; the matrix of a tail is block pentadiagonal in 3×3 blocks and is eliminated from tip to root, so that the
body's four equations need the first two nodes alone.

`sim.stepper` does the same with tensors, many robots at a time and on any device; a test holds the two together.
Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.compiling import compiled
from sim.elimination import matrix_at, solve_dense
from sim.tail import (
    E_Z,
    NO_BLOCK,
    Body,
    Geometry,
    Motion,
    add_head,
    clamp_balance,
    edge_block,
    joint_block,
    measure,
    motion_at,
    new_geometry,
    node_balance,
    put,
    straight,
    vector,
    wrench_of,
)
from sim.vectors import (
    Matrix,
    added,
    applied,
    cross,
    dot,
    inverse,
    minus,
    plus,
    product,
    subtracted,
    times,
    transposed,
    turned,
)

Array = NDArray[np.float64]

PHASE, YAW, X, Y, SWAY, SURGE = range(6)  # entries of State.pose, here and in `sim.stepper`
TOLERANCE = 2e-4  # on the last correction; Newton converges quadratically
_GAMMA = 1 - 1 / np.sqrt(2)
_MOST_CORRECTIONS = 15
_LARGEST_MOVE = 0.3


class State(NamedTuple):
    """Where a robot is; changed in place by `advance`. Shapes are (n, N, 3), every tail in its own frame."""

    x: Array
    x_dot: Array
    pose: Array  # (6,): φ, ψ, X, Y, ∫h_x, ∫v_z
    u: Array  # (4,): v_x, v_z (of J), ω_yr, ω_h


class _Chains(NamedTuple):
    """Newton's equations of N tails: blocks between a node and itself, its first and its second neighbours."""

    own: Array  # (n, N, 3, 3)
    lower: Array  # A_{k,k−1}
    upper: Array  # A_{k−1,k}
    lower2: Array  # A_{k,k−2}
    upper2: Array  # A_{k−2,k}
    border: Array  # (n, N, 5, 3): columns of the body's velocities, and −r
    corner: Array  # (4, 5): the body's equations, right-hand side last


@compiled
def new_state(tails: int, edges: int, offset: float) -> State:
    """Straight tails at rest."""
    x = straight(edges, tails, offset)
    return State(x, np.zeros_like(x), np.zeros(6), np.zeros(4))


@compiled
def _new_chains(n: int, tails: int) -> _Chains:
    return _Chains(
        np.zeros((n, tails, 3, 3)),
        np.zeros((n, tails, 3, 3)),
        np.zeros((n, tails, 3, 3)),
        np.zeros((n, tails, 3, 3)),
        np.zeros((n, tails, 3, 3)),
        np.zeros((n, tails, 5, 3)),
        np.zeros((4, 5)),
    )


@compiled
def _block(a: Array, k: int, m: int) -> Matrix:
    return matrix_at(a[k, m], 0, 0)


@compiled
def _put_block(a: Array, k: int, m: int, b: Matrix) -> None:
    c = a[k, m]
    c[0, 0], c[0, 1], c[0, 2] = b[0]
    c[1, 0], c[1, 1], c[1, 2] = b[1]
    c[2, 0], c[2, 1], c[2, 2] = b[2]


@compiled
def _linearise_tail(
    body: Body, motion: Motion, w_yaw: float, sway: float, x: Array, x_dot: Array, rate: float,
    geometry: Geometry, chains: _Chains, m: int,
) -> None:  # fmt: skip
    """Residual and blocks of tail m."""
    n = x.shape[0]
    edge, joint = edge_block(geometry, 0, m, body.axial_stiffness), NO_BLOCK  # of node k
    edge_next, joint_next, after_below = NO_BLOCK, NO_BLOCK, NO_BLOCK
    for k in range(n):
        if k < n - 1:
            edge_next = edge_block(geometry, k + 1, m, body.axial_stiffness)
            joint_next = joint_block(geometry, k + 1, m)
        else:
            edge_next, joint_next = NO_BLOCK, NO_BLOCK
        position = vector(x, k, m)
        velocity = plus(plus(motion.linear, cross(motion.spin, position)), vector(x_dot, k, m))
        residual, resistance, before, after = node_balance(geometry, body, motion, k, m, velocity)

        own = subtracted(added(joint_next, transposed(joint_next)), added(edge, edge_next))
        own = subtracted(added(own, subtracted(after, before)), turned(resistance, motion.spin))
        own = subtracted(own, (times(rate, resistance[0]), times(rate, resistance[1]), times(rate, resistance[2])))
        _put_block(chains.own, k, m, own)
        if k > 0:
            lower = subtracted(added(edge, before), transposed(added(joint, joint_next)))
            _put_block(chains.lower, k, m, lower)
            _put_block(chains.upper, k, m, subtracted(subtracted(edge, added(joint, joint_next)), after_below))
        if k > 1:
            _put_block(chains.upper2, k, m, joint)
            _put_block(chains.lower2, k, m, transposed(joint))

        # The body's velocities; ω_h also turns the disc: ∂v/∂φ = −v_x e_y + ω_yr e_x × x, ∂φ/∂ω_h = gain/rate.
        by_phase = minus(times(w_yaw, cross(motion.e_x, position)), times(sway, motion.e_y))
        about_z = times(body.gain, plus(cross(E_Z, position), times(1 / rate, by_phase)))
        border = chains.border[k]
        put(border, m, 0, times(-1.0, applied(resistance, motion.e_x)))
        put(border, m, 1, times(-1.0, transposed(resistance)[2]))
        put(border, m, 2, times(-1.0, applied(resistance, cross(motion.e_y, position))))
        put(border, m, 3, times(-1.0, applied(resistance, about_z)))
        put(border, m, 4, times(-1.0, residual))
        edge, joint, after_below = edge_next, joint_next, after


@compiled
def _eliminate(chains: _Chains, m: int) -> None:
    """Reduce tail m from tip to root: lower, lower2 and border become A⁻¹ of themselves."""
    n = chains.own.shape[0]
    for k in range(n - 1, -1, -1):
        inverted = inverse(_block(chains.own, k, m))
        upper, upper2 = _block(chains.upper, k, m), _block(chains.upper2, k, m)
        lower = product(inverted, _block(chains.lower, k, m))
        lower2 = product(inverted, _block(chains.lower2, k, m))
        if k > 0:
            _put_block(chains.lower, k, m, lower)
            own = subtracted(_block(chains.own, k - 1, m), product(upper, lower))
            _put_block(chains.own, k - 1, m, own)
        if k > 1:
            _put_block(chains.lower2, k, m, lower2)
            below = subtracted(_block(chains.lower, k - 1, m), product(upper, lower2))
            _put_block(chains.lower, k - 1, m, below)
            above = subtracted(_block(chains.upper, k - 1, m), product(upper2, lower))
            _put_block(chains.upper, k - 1, m, above)
            own = subtracted(_block(chains.own, k - 2, m), product(upper2, lower2))
            _put_block(chains.own, k - 2, m, own)
        for c in range(5):
            column = applied(inverted, vector(chains.border[k], m, c))
            put(chains.border[k], m, c, column)
            if k > 0:
                first = minus(vector(chains.border[k - 1], m, c), applied(upper, column))
                put(chains.border[k - 1], m, c, first)
            if k > 1:
                second = minus(vector(chains.border[k - 2], m, c), applied(upper2, column))
                put(chains.border[k - 2], m, c, second)


@compiled
def _add_clamp(body: Body, motion: Motion, geometry: Geometry, chains: _Chains, m: int, rate: float) -> None:
    """The body's equations: what tail m puts on the disc, with its nodes eliminated."""
    clamp = clamp_balance(geometry, body, m, motion)
    corner = chains.corner
    lower = _block(chains.lower, 1, m)
    root = (body.offset, 0.0, 0.0)
    directions = (motion.e_x, E_Z, cross(motion.e_y, root), times(body.gain, cross(E_Z, root)))
    for c in range(5):
        first = vector(chains.border[0], m, c)
        second = minus(vector(chains.border[1], m, c), applied(lower, first))
        force = plus(applied(clamp.force_by_first, first), applied(clamp.force_by_second, second))
        moment = plus(applied(clamp.moment_by_first, first), applied(clamp.moment_by_second, second))
        if c < 4:
            # Columns of C A⁻¹ B are subtracted; the half cell at the clamp moves with the body.
            drag = applied(clamp.resistance, directions[c])
            force, moment = plus(force, drag), plus(moment, cross(root, drag))
        else:
            force, moment = plus(force, clamp.force), plus(moment, clamp.moment)
        wrench = wrench_of(motion, force, moment)
        for a in range(4):
            corner[a, c] -= wrench[a]
    # The body axes turn with the phase: ∂e_x/∂φ = −e_y, ∂e_y/∂φ = e_x.
    corner[0, 3] -= dot(motion.e_y, clamp.force) * body.gain / rate
    corner[2, 3] += dot(motion.e_x, clamp.moment) * body.gain / rate


@compiled
def _correct(
    body: Body, x: Array, x_dot: Array, phase: float, u: Array, rate: float,
    geometry: Geometry, chains: _Chains, dx: Array, du: Array,
) -> None:  # fmt: skip
    """One Newton correction dx (n, N, 3), du (4,)."""
    n, tails, _ = x.shape
    measure(geometry, x, (body.offset, 0.0, 0.0), body.axial_stiffness)
    corner = chains.corner
    corner[:] = 0.0
    add_head(body, u, corner, 0)
    for m in range(tails):
        motion = motion_at(body, u, phase + 2 * np.pi * m / tails)
        _linearise_tail(body, motion, u[2], u[0], x, x_dot, rate, geometry, chains, m)
        _eliminate(chains, m)
        _add_clamp(body, motion, geometry, chains, m, rate)
    solve_dense(corner, corner[:, 4:])
    du[:] = corner[:, 4]
    for m in range(tails):
        for k in range(n):
            change = vector(chains.border[k], m, 4)
            for c in range(4):
                change = minus(change, times(du[c], vector(chains.border[k], m, c)))
            if k > 0:
                change = minus(change, applied(_block(chains.lower, k, m), vector(dx, k - 1, m)))
            if k > 1:
                change = minus(change, applied(_block(chains.lower2, k, m), vector(dx, k - 2, m)))
            put(dx, k, m, change)


@compiled
def _stage(
    body: Body, x_star: Array, phase_star: float, tau: float, x: Array, x_dot: Array, u: Array, tolerance: float,
    geometry: Geometry, chains: _Chains, dx: Array, du: Array,
) -> bool:  # fmt: skip
    """Solve one stage for x, x_dot and u, in place; says whether Newton's method converged."""
    rate = 1 / tau
    scale = 1 + abs(body.omega)
    for _ in range(_MOST_CORRECTIONS):
        x_dot[:] = (x - x_star) * rate
        phase = phase_star + tau * (body.omega + body.gain * u[3])
        _correct(body, x, x_dot, phase, u, rate, geometry, chains, dx, du)
        size = max(np.max(np.abs(dx)), np.max(np.abs(du)) / scale)
        if not np.isfinite(size):
            return False
        factor = min(1.0, _LARGEST_MOVE / size)
        x += factor * dx
        u += factor * du
        if size < tolerance:
            x_dot[:] = (x - x_star) * rate
            return True
    return False


@compiled
def _pose(body: Body, head_length: float, star: Array, tau: float, u: Array) -> Array:
    sway, surge = u[0] + u[2] * head_length / 2, u[1]
    yaw = star[YAW] + tau * u[2]
    cos, sin = np.cos(yaw), np.sin(yaw)
    rates = np.array(
        [body.omega + body.gain * u[3], u[2], surge * cos - sway * sin, surge * sin + sway * cos, sway, surge]
    )
    return star + tau * rates


@compiled
def advance(
    body: Body,
    head_length: float,
    state: State,
    dt: float,
    count: int,
    tolerance: float,
    poses: Array,
    shapes: Array,
) -> bool:
    """Make `count` steps of dt at constant motor speed, from a state without memory of earlier steps.

    Args:
        poses: (count, 6), filled with the pose after every step.
        shapes: (K, n, N, 3), filled with the shape after each of the last K steps.

    Returns:
        Whether every step converged; if not, the state is where it broke down.
    """
    x, x_dot, pose, u = state
    n, tails, _ = x.shape
    geometry, chains = new_geometry(n, tails), _new_chains(n, tails)
    dx, du = np.zeros_like(x), np.zeros(4)
    x_before, x_start, pose_before, u_before = x.copy(), x.copy(), pose.copy(), u.copy()
    for i in range(count):
        x_start[:] = x
        if i == 0:  # SDIRK2
            tau = _GAMMA * dt
            first_dot = x_dot.copy()
            x += tau * x_dot
            if not _stage(body, x_start, pose[PHASE], tau, x, first_dot, u, tolerance, geometry, chains, dx, du):
                return False
            middle = _pose(body, head_length, pose, tau, u)
            x_star = x_start + (1 - _GAMMA) * dt * first_dot
            pose_star = pose + (1 - _GAMMA) * dt * (middle - pose) / tau
            x[:] = x_start + dt * first_dot
            u_start = u_before.copy()
        else:  # BDF2
            tau = dt * 2 / 3
            x_star = (4 * x - x_before) / 3
            pose_star = (4 * pose - pose_before) / 3
            x[:] = 2 * x - x_before
            u_start = u.copy()
            u[:] = 2 * u - u_before
        if not _stage(body, x_star, pose_star[PHASE], tau, x, x_dot, u, tolerance, geometry, chains, dx, du):
            return False
        x_before[:] = x_start
        pose_before[:] = pose
        u_before[:] = u_start
        pose[:] = _pose(body, head_length, pose_star, tau, u)
        poses[i] = pose
        late = i - (count - shapes.shape[0])
        if late >= 0:
            shapes[late] = x
    return True
