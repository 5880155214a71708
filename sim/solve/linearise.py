"""Newton's equations of a robot on an orbit or in a stage of a time step, without the non-local effects.

    A_m δx_m + B_m δu = −r_m on every tail,   Σ_m C_m δx_m + D δu = −t on the robot

The blocks of a tail are the derivatives of drag and elastic forces in the positions of its nodes. In a time step
the blocks contain ∂ẋ/∂x = rate. On an orbit ẋ couples the phases; `sim.linear.coupled` adds this coupling.
Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from common.arrays import Floats
from sim.jit import borrowing, compiled, inlined
from sim.lanes import zeros
from sim.linear.blocks import put, put_block, vector
from sim.linear.chains import Chains, new_chains
from sim.linear.vectors import (
    E_Z,
    ZERO,
    ZERO_MATRIX,
    Matrix,
    Vector,
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
from sim.mechanics.balance import (
    TailMotion,
    body_wrench,
    clamp_balance,
    head_drag,
    motion_at,
    motor_gain,
    node_balance,
)
from sim.mechanics.geometry import edge_block, joint_block, measure
from sim.model.body import Body
from sim.solve.rates import Rates, base_phase, fill_rates, phase_gain
from sim.solve.residual import Scratch


class Equations(NamedTuple):
    """Newton's matrix, and the residual."""

    chains: Chains
    resistance: Floats  # (n, M, 3, 3): −∂q/∂v of every free node
    r: Floats  # (n, M, 3)
    t: Floats  # (P, 4)


@compiled
def new_equations(x: Floats, u: Floats) -> Equations:
    """Allocate arrays for unknowns like x (n, M, 3) and u (P, 4)."""
    n, columns, _ = x.shape
    chains = new_chains(x, n, columns, u.shape[0])
    return Equations(chains, zeros(x, (n, columns, 3, 3)), zeros(x, x.shape), zeros(u, u.shape))


@borrowing
def linearise(body: Body, rates: Rates, x: Floats, u: Floats, scratch: Scratch, equations: Equations) -> None:
    """Fill the equations at x (n, M, 3), u (P, 4)."""
    columns, instants = x.shape[1], u.shape[0]
    measure(scratch.geometry, x, body.offset, body.axial_stiffness)
    fill_rates(rates, body, x, u, scratch.x_dot, scratch.by_spin)
    base = base_phase(rates, body, u)
    for p in range(instants):
        _head(body, u[p], equations.chains.corner[p], equations.t[p])
    for m in range(columns):
        motion = motion_at(body, u[m % instants], base + 2 * np.pi * m / columns)
        _tail(body, motion, rates, x, scratch, equations, m)
        _clamp(body, motion, rates, scratch, equations, m, m % instants)


@inlined
def _head(body: Body, u: Floats, corner: Floats, t: Floats) -> None:
    """Compute the drag on head and disc, and its derivative in u."""
    gain = motor_gain(body)
    for a in range(4):
        for c in range(4):
            corner[a, c] = -body.resistance[a, c]
        corner[a, 3] -= gain * body.resistance[a, 4]
        t[a] = -head_drag(body, u, a)


@inlined
def _tail(
    body: Body, motion: TailMotion, rates: Rates, x: Floats, scratch: Scratch, equations: Equations, m: int
) -> None:
    """Balance of the nodes of column m, its blocks, and its derivative in the robot's velocities."""
    n, gain, rate = x.shape[0], motor_gain(body), rates.rate
    turning_load = times(phase_gain(rates, body) / n, _load_by_phase(body, motion))
    chains, geometry = equations.chains, scratch.geometry
    edge, joint = edge_block(geometry, 0, m, body.axial_stiffness), ZERO_MATRIX  # of node k
    after_below = ZERO_MATRIX
    for k in range(n):
        edge_next, joint_next = ZERO_MATRIX, ZERO_MATRIX
        if k < n - 1:
            edge_next = edge_block(geometry, k + 1, m, body.axial_stiffness)
            joint_next = joint_block(geometry, k + 1, m)
        position = vector(x, k, m)
        velocity = plus(plus(motion.linear, cross(motion.spin, position)), vector(scratch.x_dot, k, m))
        residual, resistance, before, after = node_balance(geometry, body, motion, k, m, velocity)
        put(equations.r, k, m, residual)
        put_block(equations.resistance, k, m, resistance)

        diagonal = subtracted(added(joint_next, transposed(joint_next)), added(edge, edge_next))
        diagonal = subtracted(added(diagonal, subtracted(after, before)), turned(resistance, motion.spin))
        diagonal = subtracted(
            diagonal, (times(rate, resistance[0]), times(rate, resistance[1]), times(rate, resistance[2]))
        )
        put_block(chains.diagonal, k, m, diagonal)
        if k > 0:
            lower = subtracted(added(edge, before), transposed(added(joint, joint_next)))
            put_block(chains.lower, k, m, lower)
            put_block(chains.upper, k, m, subtracted(subtracted(edge, added(joint, joint_next)), after_below))
        if k > 1:
            put_block(chains.upper2, k, m, joint)
            put_block(chains.lower2, k, m, transposed(joint))

        about_z = times(gain, plus(cross(E_Z, position), vector(scratch.by_spin, k, m)))
        border = chains.border[k]
        put(border, m, 0, times(-1.0, applied(resistance, motion.e_x)))
        put(border, m, 1, times(-1.0, transposed(resistance)[2]))
        put(border, m, 2, times(-1.0, applied(resistance, cross(motion.e_y, position))))
        by_load = times(0.5 if k == n - 1 else 1.0, turning_load)
        put(border, m, 3, minus(by_load, applied(resistance, about_z)))
        edge, joint, after_below = edge_next, joint_next, after


@inlined
def _clamp(
    body: Body, motion: TailMotion, rates: Rates, scratch: Scratch, equations: Equations, m: int, p: int
) -> None:
    """Compute the force and moment of column m on the disc at instant p."""
    clamp = clamp_balance(scratch.geometry, body, m, motion, ZERO, ZERO)
    chains, root = equations.chains, (body.offset, 0.0, 0.0)
    wrench = body_wrench(motion, clamp.force, clamp.moment)
    for a in range(4):
        equations.t[p, a] += wrench[a]
    _put_foot(chains.foot[0], m, motion, clamp.force_by_first, clamp.moment_by_first)
    _put_foot(chains.foot[1], m, motion, clamp.force_by_second, clamp.moment_by_second)
    corner = chains.corner[p]
    _subtract_clamp_drag(corner, 0, motion, clamp.resistance, root, motion.e_x)
    _subtract_clamp_drag(corner, 1, motion, clamp.resistance, root, E_Z)
    _subtract_clamp_drag(corner, 2, motion, clamp.resistance, root, cross(motion.e_y, root))
    _subtract_clamp_drag(corner, 3, motion, clamp.resistance, root, times(motor_gain(body), cross(E_Z, root)))
    # Body axes and load turn with the phase: ∂e_x/∂φ = −e_y, ∂e_y/∂φ = e_x.
    turning = phase_gain(rates, body)
    corner[0, 3] -= dot(motion.e_y, clamp.force) * turning
    corner[2, 3] += dot(motion.e_x, clamp.moment) * turning
    load = times(0.5 * turning / scratch.geometry.length.shape[0], _load_by_phase(body, motion))
    by_load = body_wrench(motion, load, cross(root, load))
    for a in range(4):
        corner[a, 3] += by_load[a]


@borrowing
def _subtract_clamp_drag(
    corner: Floats, c: int, motion: TailMotion, resistance: Matrix, root: Vector, direction: Vector
) -> None:
    """Subtract the drag on the half cell at the clamp, which moves with the disc, from column c of the corner."""
    drag = applied(resistance, direction)
    by_velocity = body_wrench(motion, drag, cross(root, drag))
    for a in range(4):
        corner[a, c] -= by_velocity[a]


@borrowing
def _load_by_phase(body: Body, motion: TailMotion) -> Vector:
    """Compute the derivative of the load on a tail, force per length, in the phase."""
    return minus(times(body.tail_load[1], motion.e_x), times(body.tail_load[0], motion.e_y))


@borrowing
def _put_foot(foot: Floats, m: int, motion: TailMotion, force: Matrix, moment: Matrix) -> None:
    """Put the rows of the robot's equations for one node of column m."""
    put(foot, m, 0, applied(transposed(force), motion.e_x))
    put(foot, m, 1, force[2])
    put(foot, m, 2, applied(transposed(moment), motion.e_y))
    put(foot, m, 3, moment[2])
