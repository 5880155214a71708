"""The residual of a robot's balance: drag, elastic forces and loads on every node, and the wrench on the robot.

    r = 0 on every free node, t = (F_x, F_z, M_y, M_z) = 0 about J

`fill_residual` adds up all forces, for a robot in each lane (`sim.lanes`): local drag and the elastic forces of
straight tails (`sim.mechanics.balance`), and the non-local effects. These are material frames (`frames`), springs
at the roots (`geometry`), contact between tails (`tail_contact`), flow between the parts (`flow`), thinning of the
fluid, and friction of the contact line (`drag`). Their formulas are for the plain numbers of one robot and are
called lane by lane. A new non-local effect is called in `surround` and adds to what `Surroundings` holds,
which is zero before the first one. Units: l, μ0 l⁴/EI, EI/l².

The Newton matrices of `sim.solve.linearise` leave the non-local effects out; GMRES takes them into account
(`sim.solve.newton`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats
from sim.jit import borrowing, compiled
from sim.lanes import lane, lane_count, somewhere, zeros
from sim.linear.blocks import add, put, vector, vector_at
from sim.linear.lane_arrays import put_lane, take_lane
from sim.linear.vectors import ZERO, Vector, cross, dot, minus, plus
from sim.mechanics.balance import TailMotion, body_wrench, clamp_balance, head_drag, motion_at, node_balance
from sim.mechanics.drag import add_contact_line, node_drag, thinned, thins
from sim.mechanics.flow import add_flow, has_flow
from sim.mechanics.frames import add_frames, has_frames
from sim.mechanics.geometry import Geometry, add_root_spring, measure, new_geometry, node_tangent
from sim.mechanics.tail_contact import add_contact, has_contact
from sim.model.body import Body
from sim.solve.grouping import body_of_lane, reaches_further
from sim.solve.rates import Rates, base_phase, fill_rates


class Surroundings(NamedTuple):
    """What the non-local effects add up; zero without them."""

    flow: Floats  # of the fluid at nodes 0..n, (n + 1, M, 3)
    drag: Floats  # further drag on nodes 0..n, (n + 1, M, 3)
    moment: Floats  # further moment of each clamp on the disc, (M, 3)
    wrench: Floats  # on the robot about J, (P, 4)


class Scratch(NamedTuple):
    """Arrays to evaluate a residual in."""

    geometry: Geometry
    around: Surroundings
    x_dot: Floats  # (n, M, 3)
    by_spin: Floats  # (n, M, 3), see `sim.solve.rates`


@compiled
def new_scratch(x: Floats, u: Floats) -> Scratch:
    """Allocate arrays for unknowns like x (n, M, 3) and u (P, 4)."""
    n, columns, _ = x.shape
    flow, drag = zeros(x, (n + 1, columns, 3)), zeros(x, (n + 1, columns, 3))
    around = Surroundings(flow, drag, zeros(x, (columns, 3)), zeros(u, u.shape))
    return Scratch(new_geometry(x, n, columns), around, zeros(x, x.shape), zeros(x, x.shape))


@borrowing
def fill_residual(
    body: Body, rates: Rates, x: Floats, u: Floats, where: Any, scratch: Scratch, r: Floats, t: Floats
) -> None:
    """Compute the residual at x (n, M, 3), u (P, 4).

    Args:
        where: 1 in the lanes where it is wanted; in the others the non-local effects may be left out.
        r: (n, M, 3), filled.
        t: (P, 4), filled.
    """
    n, columns, _ = x.shape
    instants, around = u.shape[0], scratch.around
    measure(scratch.geometry, x, body.offset, body.axial_stiffness)
    fill_rates(rates, body, x, u, scratch.x_dot, scratch.by_spin)
    base = base_phase(rates, body, u)
    for values in (around.flow, around.drag):
        values[:] = 0.0
    around.moment[:], around.wrench[:] = 0.0, 0.0
    further = where * reaches_further(body)
    if somewhere(further):
        _surround_lanes(body, base, x, u, further, scratch)
    for p in range(instants):
        for a in range(4):
            t[p, a] = around.wrench[p, a] - head_drag(body, u[p], a)
    for m in range(columns):
        motion = motion_at(body, u[m % instants], base + 2 * np.pi * m / columns)
        for k in range(n):
            velocity = _velocity(
                motion, vector(x, k, m), vector(scratch.x_dot, k, m), vector(around.flow, k + 1, m)
            )
            residual = node_balance(scratch.geometry, body, motion, k, m, velocity)[0]
            put(r, k, m, plus(residual, vector(around.drag, k + 1, m)))
        flow, moment = vector(around.flow, 0, m), vector_at(around.moment, m)
        clamp = clamp_balance(scratch.geometry, body, m, motion, flow, moment)
        root, drag = (body.offset, 0.0, 0.0), vector(around.drag, 0, m)
        wrench = body_wrench(motion, plus(clamp.force, drag), plus(clamp.moment, cross(root, drag)))
        for a in range(4):
            t[m % instants, a] += wrench[a]


@borrowing
def _velocity(motion: TailMotion, position: Vector, x_dot: Vector, flow: Vector) -> Vector:
    """Compute the velocity of a node through the fluid."""
    return minus(plus(plus(motion.linear, cross(motion.spin, position)), x_dot), flow)


@compiled
def _surround_lanes(body: Body, base: Any, x: Floats, u: Floats, where: Any, scratch: Scratch) -> None:
    """Add up all non-local effects of the robots in the lanes where `where` is 1, one robot after the other."""
    columns, instants = x.shape[1], u.shape[0]
    shape, velocities = np.empty(x.shape), np.empty(u.shape)
    for i in range(lane_count(where)):
        if lane(where, i) == 0:
            continue
        robot, first = body_of_lane(body, i), lane(base, i)
        take_lane(shape, x, i)
        take_lane(velocities, u, i)
        alone = new_scratch(shape, velocities)
        take_lane(alone.x_dot, scratch.x_dot, i)
        measure(alone.geometry, shape, robot.offset, robot.axial_stiffness)
        for p in range(instants):
            surround(robot, shape, velocities[p], first + 2 * np.pi * p / columns, p, instants, alone)
        put_lane(scratch.geometry.force, i, alone.geometry.force)
        put_lane(scratch.around.flow, i, alone.around.flow)
        put_lane(scratch.around.drag, i, alone.around.drag)
        put_lane(scratch.around.moment, i, alone.around.moment)
        put_lane(scratch.around.wrench, i, alone.around.wrench)


@borrowing
def surround(body: Body, x: Floats, u: Floats, phase: float, p: int, instants: int, scratch: Scratch) -> None:
    """Add all non-local effects of one robot at instant p, its columns p, p + P, …

    Forces in the tails come first, because the flow depends on them, then the drag, which depends on the flow.
    """
    geometry, around, columns = scratch.geometry, scratch.around, x.shape[1]
    tails = columns // instants
    if has_frames(body):
        for m in range(p, columns, instants):
            motion = motion_at(body, u, phase + 2 * np.pi * (m - p) / columns)
            add_frames(body, geometry, motion, m, scratch.x_dot, around.moment)
    if body.nonlocal_terms.root_compliance != 0:
        for m in range(p, columns, instants):
            add_root_spring(body, geometry, m, around.moment)
    if has_contact(body):
        add_contact(body, geometry, x, u, phase, p, tails, around.wrench[p])
    if has_flow(body):
        add_flow(body, geometry, x, u, phase, p, tails, around.flow, around.wrench[p])
    if thins(body):
        for m in range(p, columns, instants):
            motion = motion_at(body, u, phase + 2 * np.pi * (m - p) / columns)
            for k in range(x.shape[0] + 1):
                position, rate = (body.offset, 0.0, 0.0), ZERO
                if k > 0:
                    position, rate = vector(x, k - 1, m), vector(scratch.x_dot, k - 1, m)
                velocity = _velocity(motion, position, rate, vector(around.flow, k, m))
                change = thinned(geometry, body, k, m, velocity, dot(motion.e_y, position))
                add(around.drag, k, m, change)
    add_contact_line(body, u, around.wrench[p])


@compiled
def fluid_forces(body: Body, x: Floats, x_dot: Floats, u: Floats, phase: float) -> tuple[Floats, Floats]:
    """Compute the forces of the fluid on the tails, (n + 1, N, 3), and its wrench on head and disc, (4,).

    A node of velocity v in a flow w has the force −l_k [ζ⊥ I + (ζ∥ − ζ⊥) tt] (v − w), changed by thinning. In
    balance all forces, the loads on the tails and the wrench on the head add up to zero.

    Args:
        x, x_dot: free nodes and their velocities, (n, N, 3), each tail in its own frame, as the forces are.
        u: (v_x, v_z, ω_yr, ω_h), (4,).
        phase: of the disc.

    Returns:
        The forces on nodes 0 (the clamp) to n, and (F_x, F_z, M_y, M_z) about J, with
        friction of a contact line.
    """
    n, tails, _ = x.shape
    scratch = new_scratch(x, u.copy().reshape(1, 4))
    scratch.x_dot[:] = x_dot
    measure(scratch.geometry, x, body.offset, body.axial_stiffness)
    surround(body, x, u, phase, 0, 1, scratch)
    forces, on_head = np.empty((n + 1, tails, 3)), scratch.around.wrench[0].copy()
    for a in range(4):
        on_head[a] -= head_drag(body, u, a)
    for m in range(tails):
        motion = motion_at(body, u, phase + 2 * np.pi * m / tails)
        for k in range(n + 1):
            cell = 0.5 / n if k in (0, n) else 1.0 / n
            position, rate = (body.offset, 0.0, 0.0), ZERO
            if k > 0:
                position, rate = vector(x, k - 1, m), vector(x_dot, k - 1, m)
            velocity = _velocity(motion, position, rate, vector(scratch.around.flow, k, m))
            tangent, _ = node_tangent(scratch.geometry, k, m)
            force = node_drag(
                tangent, velocity, cell * body.zeta_perp, cell * (body.zeta_parallel - body.zeta_perp)
            )
            put(forces, k, m, plus(force, vector(scratch.around.drag, k, m)))
    return forces, on_head
