"""Implicit time steps of one robot in compiled loops: the scheme of `sim.stepper`, fast on a processor.

The N tails are N lanes, each turned so that its clamp lies at (a, 0, 0); tail j of a robot at disc phase φ is at
phase φ + 2πj/N. Every stage solves the balance of `sim.balance` with x = x* + τ ẋ, φ = φ* + τ ω_t by Newton's
method; the matrix of a tail is block pentadiagonal in 3×3 blocks and is eliminated from tip to root, so that the
body's four equations need the first two nodes alone. What lies beyond (`sim.instant`) is not in the matrix: there
the factors precondition GMRES.

`sim.stepper` does the same with tensors, many robots at a time and on any device; a test holds the two together.
Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.chains import Chains, block, eliminate, new_chains, put_block, solve
from sim.compiling import compiled
from sim.instant import Surroundings, still, unbalanced
from sim.krylov import LEFT, MOST_STEPS, NUDGE, combine, extend, new_krylov, start
from sim.tail import (
    E_Z,
    NO_BLOCK,
    NONE,
    Body,
    Geometry,
    Motion,
    add_head,
    clamp_balance,
    edge_block,
    joint_block,
    measure,
    motion_at,
    move,
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
    minus,
    plus,
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


@compiled
def new_state(tails: int, edges: int, offset: float) -> State:
    """Straight tails at rest."""
    x = straight(edges, tails, offset)
    return State(x, np.zeros_like(x), np.zeros(6), np.zeros(4))


@compiled
def _linearise_tail(
    body: Body, motion: Motion, w_yaw: float, sway: float, x: Array, x_dot: Array, rate: float,
    geometry: Geometry, chains: Chains, m: int, s: Array,
) -> None:  # fmt: skip
    """Blocks of tail m, and what its nodes lack to balance in s (n, N, 3)."""
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
        put(s, k, m, times(-1.0, residual))

        own = subtracted(added(joint_next, transposed(joint_next)), added(edge, edge_next))
        own = subtracted(added(own, subtracted(after, before)), turned(resistance, motion.spin))
        own = subtracted(own, (times(rate, resistance[0]), times(rate, resistance[1]), times(rate, resistance[2])))
        put_block(chains.own, k, m, own)
        if k > 0:
            lower = subtracted(added(edge, before), transposed(added(joint, joint_next)))
            put_block(chains.lower, k, m, lower)
            put_block(chains.upper, k, m, subtracted(subtracted(edge, added(joint, joint_next)), after_below))
        if k > 1:
            put_block(chains.upper2, k, m, joint)
            put_block(chains.lower2, k, m, transposed(joint))

        # The body's velocities; ω_h also turns the disc: ∂v/∂φ = −v_x e_y + ω_yr e_x × x, ∂φ/∂ω_h = gain/rate.
        by_phase = minus(times(w_yaw, cross(motion.e_x, position)), times(sway, motion.e_y))
        about_z = times(body.gain, plus(cross(E_Z, position), times(1 / rate, by_phase)))
        border = chains.border[k]
        put(border, m, 0, times(-1.0, applied(resistance, motion.e_x)))
        put(border, m, 1, times(-1.0, transposed(resistance)[2]))
        put(border, m, 2, times(-1.0, applied(resistance, cross(motion.e_y, position))))
        put(border, m, 3, times(-1.0, applied(resistance, about_z)))
        edge, joint, after_below = edge_next, joint_next, after


@compiled
def _add_clamp(
    body: Body, motion: Motion, geometry: Geometry, chains: Chains, m: int, rate: float, t: Array
) -> None:
    """The body's equations: what tail m puts on the disc, with its nodes eliminated; right-hand side in t (4,)."""
    clamp = clamp_balance(geometry, body, m, motion, NONE, NONE)
    corner, foot = chains.corner, chains.foot
    _put_foot(foot[0], m, motion, clamp.force_by_first, clamp.moment_by_first)
    _put_foot(foot[1], m, motion, clamp.force_by_second, clamp.moment_by_second)
    lower = block(chains.lower, 1, m)
    root = (body.offset, 0.0, 0.0)
    load = wrench_of(motion, clamp.force, clamp.moment)
    for a in range(4):
        t[a] -= load[a]
    directions = (motion.e_x, E_Z, cross(motion.e_y, root), times(body.gain, cross(E_Z, root)))
    for c in range(4):
        first = vector(chains.border[0], m, c)
        second = minus(vector(chains.border[1], m, c), applied(lower, first))
        drag = applied(clamp.resistance, directions[c])  # the half cell at the clamp moves with the body
        wrench = wrench_of(motion, drag, cross(root, drag))
        for a in range(4):
            through = dot(vector(foot[0], m, a), first) + dot(vector(foot[1], m, a), second)
            corner[a, c] -= wrench[a] + through
    # The body axes turn with the phase: ∂e_x/∂φ = −e_y, ∂e_y/∂φ = e_x.
    corner[0, 3] -= dot(motion.e_y, clamp.force) * body.gain / rate
    corner[2, 3] += dot(motion.e_x, clamp.moment) * body.gain / rate


@compiled
def _put_foot(foot: Array, m: int, motion: Motion, force: Matrix, moment: Matrix) -> None:
    put(foot, m, 0, applied(transposed(force), motion.e_x))
    put(foot, m, 1, force[2])
    put(foot, m, 2, applied(transposed(moment), motion.e_y))
    put(foot, m, 3, moment[2])


@compiled
def _factor(
    body: Body, x: Array, x_dot: Array, phase: float, u: Array, rate: float, geometry: Geometry, chains: Chains,
    s: Array, t: Array,
) -> None:  # fmt: skip
    """Newton's equations without what lies beyond, eliminated; right-hand sides in s (n, N, 3) and t (4,)."""
    tails = x.shape[1]
    measure(geometry, x, (body.offset, 0.0, 0.0), body.axial_stiffness)
    chains.corner[:] = 0.0
    add_head(body, u, chains.corner, 0)
    t[:] = chains.corner[:, 4]
    for m in range(tails):
        motion = motion_at(body, u, phase + 2 * np.pi * m / tails)
        _linearise_tail(body, motion, u[2], u[0], x, x_dot, rate, geometry, chains, m, s)
        eliminate(chains, m)
        _add_clamp(body, motion, geometry, chains, m, rate, t)


@compiled
def _residual(
    body: Body, x: Array, x_star: Array, phase_star: float, u: Array, rate: float, geometry: Geometry,
    around: Surroundings, r: Array, t: Array,
) -> None:  # fmt: skip
    """What a stage leaves unbalanced: r (n, N, 3) on the nodes, t (4,) on the robot."""
    phase = phase_star + (body.omega + body.gain * u[3]) / rate
    measure(geometry, x, (body.offset, 0.0, 0.0), body.axial_stiffness)
    unbalanced(body, geometry, x, (x - x_star) * rate, u, phase, 0, x.shape[1], around, r, t)


@compiled
def _with_beyond(
    body: Body, x: Array, x_star: Array, phase_star: float, u: Array, rate: float, geometry: Geometry,
    around: Surroundings, chains: Chains, dx: Array, du: Array,
) -> None:  # fmt: skip
    """Newton's correction with what lies beyond, by GMRES; the factors' own answer comes in as dx and du."""
    nodes, size = dx.size, dx.size + du.size
    scale = 1 + abs(body.omega)
    krylov = new_krylov(size, MOST_STEPS)
    sides_x, sides_u = np.empty((2, *dx.shape)), np.empty((2, 4))
    right = np.empty(size)
    right[:nodes], right[nodes:] = dx.copy().reshape(-1), du / scale
    count = 0
    if start(krylov, right) > 0:
        for i in range(MOST_STEPS):
            direction = krylov.basis[i]
            step_x, step_u = direction[:nodes].copy().reshape(dx.shape), direction[nodes:] * scale
            nudge = NUDGE / max(np.max(np.abs(direction)), 1e-12)
            for side in range(2):
                move = nudge * (2 * side - 1.0)
                _residual(
                    body, x + move * step_x, x_star, phase_star, u + move * step_u, rate, geometry, around,
                    sides_x[side], sides_u[side],
                )  # fmt: skip
            image_x, image_u = (sides_x[1] - sides_x[0]) / (2 * nudge), (sides_u[1] - sides_u[0]) / (2 * nudge)
            solve(chains, image_x, image_u)
            image = np.empty(size)
            image[:nodes], image[nodes:] = image_x.reshape(-1), image_u / scale
            count = i + 1
            if extend(krylov, i, image) < LEFT:
                break
    z = combine(krylov, count)
    dx[:] = z[:nodes].copy().reshape(dx.shape)
    du[:] = z[nodes:] * scale


@compiled
def _stage(
    body: Body, x_star: Array, phase_star: float, tau: float, x: Array, x_dot: Array, u: Array, tolerance: float,
    geometry: Geometry, around: Surroundings, chains: Chains, dx: Array, du: Array,
) -> bool:  # fmt: skip
    """Solve one stage for x, x_dot and u, in place; says whether Newton's method converged."""
    rate = 1 / tau
    scale = 1 + abs(body.omega)
    for _ in range(_MOST_CORRECTIONS):
        x_dot[:] = (x - x_star) * rate
        phase = phase_star + tau * (body.omega + body.gain * u[3])
        _factor(body, x, x_dot, phase, u, rate, geometry, chains, dx, du)
        if body.beyond.none:
            solve(chains, dx, du)
        else:
            _residual(body, x, x_star, phase_star, u, rate, geometry, around, dx, du)
            dx *= -1.0
            du *= -1.0
            solve(chains, dx, du)
            _with_beyond(body, x, x_star, phase_star, u, rate, geometry, around, chains, dx, du)
        size = max(np.max(np.abs(dx)), np.max(np.abs(du)) / scale)
        if not np.isfinite(size):
            return False
        factor = min(1.0, _LARGEST_MOVE / size)
        move(body, x, dx, factor)
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
    geometry, chains, around = new_geometry(n, tails), new_chains(n, tails), still(n, tails)
    dx, du = np.zeros_like(x), np.zeros(4)
    x_before, x_start, pose_before, u_before = x.copy(), x.copy(), pose.copy(), u.copy()
    for i in range(count):
        x_start[:] = x
        if i == 0:  # SDIRK2
            tau = _GAMMA * dt
            first_dot = x_dot.copy()
            x += tau * x_dot
            if not _stage(
                body, x_start, pose[PHASE], tau, x, first_dot, u, tolerance, geometry, around, chains, dx, du
            ):
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
        if not _stage(
            body, x_star, pose_star[PHASE], tau, x, x_dot, u, tolerance, geometry, around, chains, dx, du
        ):
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
