"""The residual of a robot's balance: drag, elastic forces and loads on every node, and the wrench on the robot.

    r = 0 on every free node, t = (F_x, F_z, M_y, M_z) = 0 about J

`fill_residual` adds up all forces: local drag and the elastic forces of straight tails (`sim.mechanics.balance`),
and the non-local effects. These are material frames (`frames`), flow between the parts (`flow`), contact
between tails (`tail_contact`), friction of the contact line, and thinning of the fluid, which changes the drag on
every node (`thinning`). A new non-local effect is called in `_surround` and adds to what `Surroundings` holds,
which is zero before the first one. Units: l, μ0 l⁴/EI, EI/l².

The Newton matrices of `sim.solve.linearise` leave the non-local effects out; GMRES takes them into account
(`sim.solve.newton`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled_exactly
from sim.lanes import zeros
from sim.linear.blocks import put, vector, vector_at
from sim.linear.vectors import ZERO, cross, dot, minus, plus
from sim.mechanics.balance import body_wrench, clamp_balance, head_drag, motion_at, node_balance
from sim.mechanics.contact_line import add_contact_line
from sim.mechanics.flow import add_flow, has_flow
from sim.mechanics.frames import add_frames, has_frames
from sim.mechanics.geometry import Geometry, measure, new_geometry
from sim.mechanics.root_spring import add_root_spring
from sim.mechanics.tail_contact import add_contact, has_contact
from sim.mechanics.thinning import thinned, thins
from sim.model.body import Body
from sim.solve.rates import Rates, base_phase, fill_rates


class Surroundings(NamedTuple):
    """What the non-local effects add up; zero without them."""

    flow: Floats  # of the fluid at nodes 0..n, (n + 1, M, 3)
    moment: Floats  # further moment of each clamp on the disc, (M, 3)
    wrench: Floats  # on the robot about J, (P, 4)


class Room(NamedTuple):
    """Arrays to evaluate a residual in."""

    geometry: Geometry
    around: Surroundings
    x_dot: Floats  # (n, M, 3)
    by_spin: Floats  # (n, M, 3), see `sim.solve.rates`


@compiled_exactly
def new_room(x: Floats, u: Floats) -> Room:
    """Allocate room for unknowns like x (n, M, 3) and u (P, 4)."""
    n, columns, _ = x.shape
    around = Surroundings(zeros(x, (n + 1, columns, 3)), zeros(x, (columns, 3)), zeros(u, u.shape))
    return Room(new_geometry(x, n, columns), around, zeros(x, x.shape), zeros(x, x.shape))


@compiled_exactly
def is_local(body: Body) -> bool:
    """Tell whether no effect reaches further than one node."""
    total = 0.0
    for value in body.nonlocal_terms:
        total += abs(value)
    return bool(total == 0)


@compiled_exactly
def fill_residual(body: Body, rates: Rates, x: Floats, u: Floats, room: Room, r: Floats, t: Floats) -> None:
    """Compute the residual at x (n, M, 3), u (P, 4).

    Args:
        r: (n, M, 3), filled.
        t: (P, 4), filled.
    """
    if is_local(body):
        fill_local_residual(body, rates, x, u, room, r, t)
        return
    n, columns, _ = x.shape
    instants = u.shape[0]
    measure(room.geometry, x, body.offset, body.axial_stiffness)
    fill_rates(rates, body, x, u, room.x_dot, room.by_spin)
    base = base_phase(rates, body, u)
    room.around.flow[:] = 0.0
    room.around.moment[:] = 0.0
    room.around.wrench[:] = 0.0
    for p in range(instants):
        phase = base + 2 * np.pi * p / columns
        _surround(body, x, u[p], phase, p, columns // instants, room)
        for a in range(4):
            t[p, a] = room.around.wrench[p, a] - head_drag(body, u[p], a)
    for m in range(columns):
        motion = motion_at(body, u[m % instants], base + 2 * np.pi * m / columns)
        for k in range(n):
            velocity = plus(plus(motion.linear, cross(motion.spin, vector(x, k, m))), vector(room.x_dot, k, m))
            velocity = minus(velocity, vector(room.around.flow, k + 1, m))
            residual = node_balance(room.geometry, body, motion, k, m, velocity)[0]
            if thins(body):
                height = dot(motion.e_y, vector(x, k, m))
                residual = plus(residual, thinned(room.geometry, body, k + 1, m, velocity, height))
            put(r, k, m, residual)
        flow, moment = vector(room.around.flow, 0, m), vector_at(room.around.moment, m)
        clamp = clamp_balance(room.geometry, body, m, motion, flow, moment)
        force, torque = clamp.force, clamp.moment
        if thins(body):
            root = (body.offset, 0.0, 0.0)
            velocity = minus(plus(motion.linear, cross(motion.spin, root)), flow)
            change = thinned(room.geometry, body, 0, m, velocity, dot(motion.e_y, root))
            force, torque = plus(force, change), plus(torque, cross(root, change))
        wrench = body_wrench(motion, force, torque)
        for a in range(4):
            t[m % instants, a] += wrench[a]


@compiled_exactly
def fill_local_residual(body: Body, rates: Rates, x: Floats, u: Floats, room: Room, r: Floats, t: Floats) -> None:
    """Compute the residual as `fill_residual` does, for one robot or a group, with local effects."""
    n, columns, _ = x.shape
    instants = u.shape[0]
    measure(room.geometry, x, body.offset, body.axial_stiffness)
    fill_rates(rates, body, x, u, room.x_dot, room.by_spin)
    base = base_phase(rates, body, u)
    for p in range(instants):
        for a in range(4):
            t[p, a] = -head_drag(body, u[p], a)
    for m in range(columns):
        motion = motion_at(body, u[m % instants], base + 2 * np.pi * m / columns)
        for k in range(n):
            velocity = plus(plus(motion.linear, cross(motion.spin, vector(x, k, m))), vector(room.x_dot, k, m))
            put(r, k, m, node_balance(room.geometry, body, motion, k, m, velocity)[0])
        clamp = clamp_balance(room.geometry, body, m, motion, ZERO, ZERO)
        wrench = body_wrench(motion, clamp.force, clamp.moment)
        for a in range(4):
            t[m % instants, a] += wrench[a]


@compiled_exactly
def _surround(body: Body, x: Floats, u: Floats, phase: float, p: int, tails: int, room: Room) -> None:
    """Add all non-local effects at instant p; forces in the tails come first, because the flow depends on them."""
    geometry, around, columns = room.geometry, room.around, x.shape[1]
    if has_frames(body):
        for m in range(p, columns, columns // tails):
            motion = motion_at(body, u, phase + 2 * np.pi * (m - p) / columns)
            add_frames(body, geometry, motion, m, room.x_dot, around.moment)
    if body.nonlocal_terms.root_compliance != 0:
        for m in range(p, columns, columns // tails):
            add_root_spring(body, geometry, m, around.moment)
    if has_contact(body):
        add_contact(body, geometry, x, u, phase, p, tails, around.wrench[p])
    if has_flow(body):
        add_flow(body, geometry, x, u, phase, p, tails, around.flow, around.wrench[p])
    add_contact_line(body, u, around.wrench[p])
