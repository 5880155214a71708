"""Tails in compiled loops: geometry, stiffness of edges and joints, balance of nodes and clamp.

The loops run the formulas of `sim.rod` and `sim.drag` over the nodes of M lanes side by side: disc phases of one
tail in `sim.orbit`, the N tails of a robot in `sim.march`. Every lane is turned about the axis so that its clamp
lies at (a, 0, 0): tail j of a robot at disc phase φ is a lane at phase φ + 2πj/N. `sim.elastic` and `sim.balance`
do the same with tensors.

Layout: arrays are (node, lane, component), so that the 3 M components of a node lie together.
Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.compiling import compiled
from sim.drag import drag_by_tangents, node_drag, node_resistance
from sim.rod import bend, clamp_moment, clamp_moment_by_edge, edge_force, edge_stiffness, joint_stiffness
from sim.vectors import Matrix, Vector, added, cross, crossed, dot, minus, plus, projected, subtracted, times

Array = NDArray[np.float64]

ROOT_TANGENT = (0.0, 0.0, -1.0)
NONE = (0.0, 0.0, 0.0)
NO_BLOCK = (NONE, NONE, NONE)
E_Z = (0.0, 0.0, 1.0)


class Beyond(NamedTuple):
    """What reaches further than one node of a straight, untwisted, elastic tail, see `sim.coefficients`."""

    none: bool  # all of it is zero
    head_radius: float
    head_length: float
    tail_radius: float
    curvature_out: float
    curvature_across: float
    natural_twist: float
    spin_drag: float
    bending_viscosity: float
    tail_flow: float
    head_flow: float
    surface_flow: float
    contact_line: float


class Body(NamedTuple):
    """Numbers that make one robot, see `sim.balance.Swimmer`."""

    omega: float
    offset: float  # a/l
    axial_stiffness: float
    zeta_parallel: float
    zeta_perp: float
    gain: float
    resistance: Array  # (4, 5): wrench by (v_x, v_z, ω_yr, ω_h, ω_t)
    load: Vector  # on the tails, force per length in the body frame [EI/l³]
    beyond: Beyond


HEAD_LENGTH, TAIL_RADIUS = 6, 7  # entries of a robot's row: L/l and r0/l
NUMBERS = 41  # entries of a row


@compiled
def body_of(row: Array) -> Body:
    """The robot of one row of `sim.direct.bodies`."""
    resistance, load = row[8:28].copy().reshape(4, 5), (row[28], row[29], row[30])
    none = not np.any(row[32:41])
    beyond = Beyond(
        none, row[31], row[6], row[7],
        row[32], row[33], row[34], row[35], row[36], row[37], row[38], row[39], row[40],
    )  # fmt: skip
    return Body(row[0], row[1], row[2], row[3], row[4], row[5], resistance, load, beyond)


@compiled
def without_beyond(body: Body) -> Body:
    """The same robot with local drag and straight, untwisted, elastic tails."""
    part = body.beyond
    none = Beyond(
        True, part.head_radius, part.head_length, part.tail_radius, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )
    return Body(
        body.omega, body.offset, body.axial_stiffness, body.zeta_parallel, body.zeta_perp, body.gain,
        body.resistance, body.load, none,
    )  # fmt: skip


class Motion(NamedTuple):
    """Velocities of the robot as a lane at some phase sees them."""

    e_x: Vector
    e_y: Vector
    linear: Vector  # of J
    spin: Vector  # of the disc frame
    omega_t: float
    load: Vector  # on the tails, force per length


@compiled
def motion_at(body: Body, u: Array, phase: float) -> Motion:
    """Motion for the velocities u = (v_x, v_z, ω_yr, ω_h) at a phase."""
    e_x, e_y = (np.cos(phase), -np.sin(phase), 0.0), (np.sin(phase), np.cos(phase), 0.0)
    omega_t = body.omega + body.gain * u[3]
    linear = plus(times(u[0], e_x), times(u[1], E_Z))
    load = plus(plus(times(body.load[0], e_x), times(body.load[1], e_y)), times(body.load[2], E_Z))
    return Motion(e_x, e_y, linear, plus(times(u[2], e_y), times(omega_t, E_Z)), omega_t, load)


class Geometry(NamedTuple):
    """Edges and joints of M tails with n edges; joint k lies between edges k − 1 and k, joint 0 at the clamp."""

    tangent: Array  # (n + 1, M, 3): root tangent, then one an edge
    length: Array  # (n, M)
    joint: Array  # (n, M, 3): c, g', g''
    by_after: Array  # (n, M, 3) ∂c/∂e_k
    by_before: Array  # (n, M, 3) ∂c/∂e_{k−1}
    force: Array  # (n, M, 3) ∂E/∂e


@compiled
def new_geometry(n: int, lanes: int) -> Geometry:
    """Room for n edges in `lanes` lanes."""
    return Geometry(
        np.zeros((n + 1, lanes, 3)),
        np.zeros((n, lanes)),
        np.zeros((n, lanes, 3)),
        np.zeros((n, lanes, 3)),
        np.zeros((n, lanes, 3)),
        np.zeros((n, lanes, 3)),
    )


@compiled
def straight(n: int, lanes: int, offset: float) -> Array:
    """Free nodes (n, M, 3) of straight tails."""
    x = np.zeros((n, lanes, 3))
    x[:, :, 0] = offset
    for k in range(n):
        x[k, :, 2] = -(k + 1) / n
    return x


@compiled
def vector(a: Array, k: int, m: int) -> Vector:
    """a[k, m] as components."""
    return (a[k, m, 0], a[k, m, 1], a[k, m, 2])


@compiled
def entry(a: Array, i: int) -> Vector:
    """a[i] as components."""
    return (a[i, 0], a[i, 1], a[i, 2])


@compiled
def put(a: Array, k: int, m: int, v: Vector) -> None:
    """a[k, m] = v."""
    a[k, m, 0] = v[0]
    a[k, m, 1] = v[1]
    a[k, m, 2] = v[2]


@compiled
def add_block(a: Array, row: int, column: int, block: Matrix, sign: float) -> None:
    """a[row:row + 3, column:column + 3] += sign block."""
    a[row, column] += sign * block[0][0]
    a[row, column + 1] += sign * block[0][1]
    a[row, column + 2] += sign * block[0][2]
    a[row + 1, column] += sign * block[1][0]
    a[row + 1, column + 1] += sign * block[1][1]
    a[row + 1, column + 2] += sign * block[1][2]
    a[row + 2, column] += sign * block[2][0]
    a[row + 2, column + 1] += sign * block[2][1]
    a[row + 2, column + 2] += sign * block[2][2]


@compiled
def move(body: Body, x: Array, dx: Array, factor: float) -> None:
    """Move free nodes (n, M, 3) by a Newton correction.

    Added to positions, a correction stretches the edges that it turns, in second order, and stretching is stiff:
    large forces for the next correction to undo. Where they are flows as well (beyond), it cannot: there edges
    turn, and stretch by the correction's first order alone.
    """
    if body.beyond.none:
        x += factor * dx
        return
    n, lanes, _ = x.shape
    offset = body.offset
    for m in range(lanes):
        below, below_dx, moved = (offset, 0.0, 0.0), NONE, (offset, 0.0, 0.0)
        for k in range(n):
            here, here_dx = vector(x, k, m), vector(dx, k, m)
            edge, change = minus(here, below), times(factor, minus(here_dx, below_dx))
            length = np.sqrt(dot(edge, edge))
            turned = plus(edge, change)
            wanted = length + dot(edge, change) / length
            moved = plus(moved, times(wanted / np.sqrt(dot(turned, turned)), turned))
            put(x, k, m, moved)
            below, below_dx = here, here_dx


@compiled
def measure(geometry: Geometry, x: Array, root: Vector, axial_stiffness: float) -> None:
    """Fill `geometry` for free nodes x (n, M, 3) of tails clamped at `root` along −e_z."""
    n, lanes, _ = x.shape
    tangents, lengths, joints, by_afters, by_befores, forces = geometry
    for m in range(lanes):
        put(tangents, 0, m, ROOT_TANGENT)
        below, before, length_before = root, ROOT_TANGENT, 1.0
        for k in range(n):
            here = vector(x, k, m)
            edge = minus(here, below)
            length = np.sqrt(dot(edge, edge))
            tangent = times(1 / length, edge)
            weight = 2.0 * n if k == 0 else 1.0 * n
            c, first, second, by_after, by_before = bend(before, tangent, length_before, length, weight)
            put(tangents, k + 1, m, tangent)
            lengths[k, m] = length
            put(joints, k, m, (c, first, second))
            put(by_afters, k, m, by_after)
            put(by_befores, k, m, by_before)
            below, before, length_before = here, tangent, length
        for k in range(n):
            first_next, by_before_next = 0.0, NONE
            if k < n - 1:
                first_next, by_before_next = joints[k + 1, m, 1], vector(by_befores, k + 1, m)
            tangent, by_after = vector(tangents, k + 1, m), vector(by_afters, k, m)
            force = edge_force(
                tangent, lengths[k, m], n, axial_stiffness, joints[k, m, 1], by_after, first_next, by_before_next
            )
            put(forces, k, m, force)


@compiled
def edge_block(geometry: Geometry, k: int, m: int, axial_stiffness: float) -> Matrix:
    """∂²E/∂e_k²."""
    n = geometry.length.shape[0]
    c, first, second = vector(geometry.joint, k, m)
    c_next, first_next, second_next, by_before_next = 1.0, 0.0, 0.0, NONE
    if k < n - 1:
        c_next, first_next, second_next = vector(geometry.joint, k + 1, m)
        by_before_next = vector(geometry.by_before, k + 1, m)
    return edge_stiffness(
        vector(geometry.tangent, k + 1, m), geometry.length[k, m], n, axial_stiffness,
        c, first, second, vector(geometry.by_after, k, m),
        c_next, first_next, second_next, by_before_next,
    )  # fmt: skip


@compiled
def joint_block(geometry: Geometry, k: int, m: int) -> Matrix:
    """∂²E/∂e_{k−1} ∂e_k of joint k."""
    c, first, second = vector(geometry.joint, k, m)
    return joint_stiffness(
        vector(geometry.tangent, k, m), vector(geometry.tangent, k + 1, m),
        geometry.length[k - 1, m], geometry.length[k, m],
        c, first, second, vector(geometry.by_after, k, m), vector(geometry.by_before, k, m),
    )  # fmt: skip


@compiled
def node_tangent(geometry: Geometry, k: int, m: int) -> tuple[Vector, float]:
    """Unit tangent of node k (0: the clamp), the mean of the adjacent edges', and |S| of their sum."""
    total = vector(geometry.tangent, k, m)
    if k < geometry.length.shape[0]:
        total = plus(total, vector(geometry.tangent, k + 1, m))
    spread = np.sqrt(dot(total, total))
    return times(1 / spread, total), spread


@compiled
def node_balance(
    geometry: Geometry, body: Body, motion: Motion, k: int, m: int, velocity: Vector
) -> tuple[Vector, Matrix, Matrix, Matrix]:
    """Balance of the free node k + 1: drag, elastic force and load, and the drag's derivatives.

    Returns:
        r, −∂q/∂v, −∂q/∂e_k through the tangents, −∂q/∂e_{k+1} (zero at the tip).
    """
    n = geometry.length.shape[0]
    last = k == n - 1
    voronoi = 0.5 / n if last else 1.0 / n
    perp, excess = voronoi * body.zeta_perp, voronoi * (body.zeta_parallel - body.zeta_perp)
    tangent, spread = node_tangent(geometry, k + 1, m)
    residual = minus(node_drag(tangent, velocity, perp, excess), vector(geometry.force, k, m))
    residual = plus(residual, times(voronoi, motion.load))
    tilt = drag_by_tangents(tangent, spread, velocity, excess)
    before = projected(tilt, vector(geometry.tangent, k + 1, m), 1 / geometry.length[k, m])
    after = NO_BLOCK
    if not last:
        residual = plus(residual, vector(geometry.force, k + 1, m))
        after = projected(tilt, vector(geometry.tangent, k + 2, m), 1 / geometry.length[k + 1, m])
    return residual, node_resistance(tangent, perp, excess), before, after


class Clamp(NamedTuple):
    """What a tail puts on the disc, about J, and its derivatives in the first two free nodes."""

    force: Vector
    moment: Vector
    resistance: Matrix  # of the half cell at the clamp
    force_by_first: Matrix
    moment_by_first: Matrix
    force_by_second: Matrix
    moment_by_second: Matrix


@compiled
def clamp_balance(geometry: Geometry, body: Body, m: int, motion: Motion, flow: Vector, moment: Vector) -> Clamp:
    """Load that edge 0, its bending spring and the drag on node 0 pass to the disc; n ≥ 2 edges.

    Args:
        flow: velocity of the fluid at the clamp.
        moment: what the clamp passes on beside the bending of an elastic, straight tail.
    """
    root = (body.offset, 0.0, 0.0)
    voronoi = 0.5 / geometry.length.shape[0]
    perp, excess = voronoi * body.zeta_perp, voronoi * (body.zeta_parallel - body.zeta_perp)
    tangent, spread = node_tangent(geometry, 0, m)
    edge, length = vector(geometry.tangent, 1, m), geometry.length[0, m]
    _, first, second = vector(geometry.joint, 0, m)
    velocity = minus(plus(motion.linear, cross(motion.spin, root)), flow)
    force = plus(vector(geometry.force, 0, m), node_drag(tangent, velocity, perp, excess))
    force = plus(force, times(voronoi, motion.load))
    tilt = drag_by_tangents(tangent, spread, velocity, excess)
    by_second = joint_block(geometry, 1, m)  # edge 1 moves the force of edge 0
    by_edge = subtracted(edge_block(geometry, 0, m, body.axial_stiffness), projected(tilt, edge, 1 / length))
    by_first = subtracted(by_edge, by_second)
    turn = clamp_moment_by_edge(ROOT_TANGENT, edge, length, first, second, vector(geometry.by_after, 0, m))
    return Clamp(
        force,
        plus(plus(cross(root, force), clamp_moment(ROOT_TANGENT, edge, first)), moment),
        node_resistance(tangent, perp, excess),
        by_first,
        added(crossed(root, by_first), turn),
        by_second,
        crossed(root, by_second),
    )


@compiled
def wrench_of(motion: Motion, force: Vector, moment: Vector) -> tuple[float, float, float, float]:
    """(F_x, F_z, M_y, M_z) in the body frame of a force and a moment in a lane's."""
    return dot(motion.e_x, force), force[2], dot(motion.e_y, moment), moment[2]


@compiled
def add_head(body: Body, u: Array, corner: Array, first: int) -> None:
    """Head and disc in the body's equations `first` to first + 3: derivative in u (4,), and right-hand side."""
    right = corner.shape[0]
    omega_t = body.omega + body.gain * u[3]
    for a in range(4):
        row = corner[first + a]
        for c in range(4):
            row[first + c] -= body.resistance[a, c]
            row[right] += body.resistance[a, c] * u[c]
        row[first + 3] -= body.gain * body.resistance[a, 4]
        row[right] += body.resistance[a, 4] * omega_t
