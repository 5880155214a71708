"""The forces of the fluid on each node of the tails, and its wrench on the head, at one instant.

    q_k = −l_k [ζ⊥ I + (ζ∥ − ζ⊥) tt] (v_k − w_k)        (w: flow that other parts cause; thinning changes q)

In balance the forces on all nodes, the loads on the tails and the wrench on the head add up to zero. Units: l,
μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled
from sim.linear.blocks import put, vector
from sim.linear.vectors import cross, minus, plus
from sim.mechanics.balance import head_drag, motion_at
from sim.mechanics.drag import node_drag
from sim.mechanics.geometry import measure, node_tangent
from sim.model.body import Body
from sim.solve.residual import new_room, surround


@compiled
def fluid_forces(body: Body, x: Floats, x_dot: Floats, u: Floats, phase: float) -> tuple[Floats, Floats]:
    """Compute the forces of the fluid on the tails, (n + 1, N, 3), and its wrench on head and disc, (4,).

    Args:
        x, x_dot: free nodes and their velocities, (n, N, 3), each tail in its own frame, as the forces are.
        u: (v_x, v_z, ω_yr, ω_h), (4,).
        phase: of the disc.

    Returns:
        The forces on nodes 0 (the clamp) to n, and (F_x, F_z, M_y, M_z) about J, with
        friction of a contact line.
    """
    n, tails, _ = x.shape
    room = new_room(x, u.copy().reshape(1, 4))
    room.x_dot[:] = x_dot
    measure(room.geometry, x, body.offset, body.axial_stiffness)
    surround(body, x, u, phase, 0, 1, room)
    forces, on_head = np.empty((n + 1, tails, 3)), room.around.wrench[0].copy()
    for a in range(4):
        on_head[a] -= head_drag(body, u, a)
    for m in range(tails):
        motion = motion_at(body, u, phase + 2 * np.pi * m / tails)
        for k in range(n + 1):
            cell = 0.5 / n if k in (0, n) else 1.0 / n
            position = (body.offset, 0.0, 0.0) if k == 0 else vector(x, k - 1, m)
            velocity = plus(motion.linear, cross(motion.spin, position))
            velocity = minus(velocity, vector(room.around.flow, k, m))
            if k > 0:
                velocity = plus(velocity, vector(x_dot, k - 1, m))
            tangent, _ = node_tangent(room.geometry, k, m)
            force = node_drag(
                tangent, velocity, cell * body.zeta_perp, cell * (body.zeta_parallel - body.zeta_perp)
            )
            put(forces, k, m, plus(force, vector(room.around.drag, k, m)))
    return forces, on_head
