"""Forces on one node, one clamp and the head, in compiled loops. If a robot is in balance, their sums are zero.

    node   r_k = q_k + ∂E/∂e_{k+1} − ∂E/∂e_k + l_k b          (drag + elastic force + load)
    clamp  force and moment of edge 0, its bending spring and the drag on node 0, about J
    head   −R (v_x, v_z, ω_yr, ω_h, ω_t)                       (`sim.mechanics.drag`)

Frames. Body: origin J (disc centre), e_z forward along the axis, e_y up, e_x = e_y × e_z. Disc: the body frame
turned about e_z by the phase φ, φ' = ω_t. A tail's frame is the disc frame, turned so that the clamp is at (a, 0,
0). In this frame the body axes at a phase φ are

    e_x = (cos φ, −sin φ, 0),   e_y = (sin φ, cos φ, 0),   e_z = (0, 0, 1).

The motor sets ω_t = ω + gain ω_h. The gain is 1 if the motor holds its speed. It is 1 + droop R_spin if the motor
loses speed in proportion to the head's torque.

Units: l, μ0 l⁴/EI, EI/l². Source: Du, Miller, Jawed (arXiv 2103.05712), force balance; the disc frame is ours.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats
from sim.jit import borrowing, formula, inlined
from sim.linear.blocks import vector
from sim.linear.vectors import (
    E_Z,
    ZERO_MATRIX,
    Matrix,
    Vector,
    added,
    cross,
    crossed,
    dot,
    minus,
    plus,
    projected,
    subtracted,
    times,
)
from sim.mechanics.drag import drag_by_tangents, node_drag, node_resistance
from sim.mechanics.geometry import ROOT_TANGENT, Geometry, edge_block, joint_block, node_tangent
from sim.mechanics.rod import clamp_moment, clamp_moment_by_edge
from sim.model.body import Body


@formula
def motor_gain(body: Body) -> Any:
    """Compute ∂ω_t/∂ω_h."""
    return 1.0 + body.droop * body.resistance[3, 3]


@formula
def tail_spin(body: Body, u: Any) -> Any:
    """Compute ω_t for the velocities u = (v_x, v_z, ω_yr, ω_h)."""
    return body.omega + motor_gain(body) * u[3]


class TailMotion(NamedTuple):
    """Velocities of the robot in the frame of a tail at some phase."""

    e_x: Vector
    e_y: Vector
    linear: Vector  # of J
    spin: Vector  # of the disc frame
    load: Vector  # on the tails, force per length


@borrowing
def motion_at(body: Body, u: Floats, phase: float) -> TailMotion:
    """Compute the motion for the velocities u = (v_x, v_z, ω_yr, ω_h) at a phase."""
    e_x, e_y = (np.cos(phase), -np.sin(phase), 0.0), (np.sin(phase), np.cos(phase), 0.0)
    linear = plus(times(u[0], e_x), times(u[1], E_Z))
    load = plus(plus(times(body.tail_load[0], e_x), times(body.tail_load[1], e_y)), times(body.tail_load[2], E_Z))
    return TailMotion(e_x, e_y, linear, plus(times(u[2], e_y), times(tail_spin(body, u), E_Z)), load)


@inlined
def node_balance(
    geometry: Geometry, body: Body, motion: TailMotion, k: int, m: int, velocity: Vector
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
    after = ZERO_MATRIX
    if not last:
        residual = plus(residual, vector(geometry.force, k + 1, m))
        after = projected(tilt, vector(geometry.tangent, k + 2, m), 1 / geometry.length[k + 1, m])
    return residual, node_resistance(tangent, perp, excess), before, after


class Clamp(NamedTuple):
    """Force and moment of a tail on the disc, about J, and their derivatives in the first two free nodes."""

    force: Vector
    moment: Vector
    resistance: Matrix  # of the half cell at the clamp
    force_by_first: Matrix
    moment_by_first: Matrix
    force_by_second: Matrix
    moment_by_second: Matrix


@inlined
def clamp_balance(
    geometry: Geometry, body: Body, m: int, motion: TailMotion, flow: Vector, moment: Vector
) -> Clamp:
    """Load of edge 0, its bending spring and the drag on node 0 on the disc; n ≥ 2 edges.

    If the nodes are in balance, this is equal to the sum of drag over the tail. But its derivative depends only on
    the first two nodes.

    Args:
        flow: velocity of the fluid at the clamp.
        moment: further moment of the clamp, beside the bending moment of an elastic, straight tail.
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


@borrowing
def body_wrench(motion: TailMotion, force: Vector, moment: Vector) -> tuple[float, float, float, float]:
    """Compute the wrench (F_x, F_z, M_y, M_z) in the body frame of a force and a moment in a tail's frame."""
    return dot(motion.e_x, force), force[2], dot(motion.e_y, moment), moment[2]


@borrowing
def head_drag(body: Body, u: Floats, a: int) -> float:
    """Compute entry a of R (v_x, v_z, ω_yr, ω_h, ω_t): the resistance of the fluid to head and disc, about J."""
    total = body.resistance[a, 4] * tail_spin(body, u)
    for c in range(4):
        total += body.resistance[a, c] * u[c]
    return total
