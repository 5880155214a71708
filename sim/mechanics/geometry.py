"""Tails as arrays in compiled loops: edges, joints, elastic forces and their derivatives.

The formulas of `sim.mechanics.rod`, applied to the nodes of M tails. Every tail is in its own frame, in which its
clamp is at (a, 0, 0). So tail j of a robot at disc phase φ is at phase φ + 2πj/N.

A root may turn about its clamp as on a spring. Its compliance c is in series with the half cell at the clamp:
1/l_0 in the energy of joint 0 becomes 1/(l_0 + c). `add_root_spring` adds the difference to the elastic forces of
rigidly clamped tails.

Arrays are (node, tail, component). Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats
from sim.jit import borrowing, compiled
from sim.lanes import zeros
from sim.linear.blocks import add, add_at, put, vector
from sim.linear.vectors import ZERO, Matrix, Vector, dot, minus, plus, times
from sim.mechanics.rod import bend, clamp_moment, edge_force, edge_stiffness, joint_stiffness
from sim.model.body import Body

ROOT_TANGENT = (0.0, 0.0, -1.0)


class Geometry(NamedTuple):
    """Edges and joints of M tails with n edges; joint k lies between edges k − 1 and k, joint 0 at the clamp."""

    tangent: Floats  # (n + 1, M, 3): root tangent, then one an edge
    length: Floats  # (n, M)
    joint: Floats  # (n, M, 3): c, g', g''
    by_after: Floats  # (n, M, 3) ∂c/∂e_k
    by_before: Floats  # (n, M, 3) ∂c/∂e_{k−1}
    force: Floats  # (n, M, 3) ∂E/∂e


@compiled
def new_geometry(like: Floats, n: int, tails: int) -> Geometry:
    """Allocate scratch arrays for M tails of n edges, of the kind of number that `like` holds."""
    return Geometry(
        zeros(like, (n + 1, tails, 3)),
        zeros(like, (n, tails)),
        zeros(like, (n, tails, 3)),
        zeros(like, (n, tails, 3)),
        zeros(like, (n, tails, 3)),
        zeros(like, (n, tails, 3)),
    )


def straight(n: int, tails: int, offset: Any) -> Floats:
    """Return the free nodes (n, M, 3) of straight tails; (B, n, M, 3) for B robots with offsets (B,)."""
    x = np.zeros((*np.shape(offset), n, tails, 3))
    x[..., 0] = np.reshape(offset, (*np.shape(offset), 1, 1))
    x[..., 2] = -np.arange(1, n + 1)[:, None] / n
    return x


@compiled
def turned_edges(x: Floats, share: Any, dx: Floats, offset: float) -> Floats:
    """Compute the free nodes (n, M, 3) after a correction share · dx that turns the edges.

    If it were added to the positions, edges that turn would also become longer, by a term of second order. Here
    every edge gets its new direction, and its length changes only by the first-order term of the correction.
    """
    n, tails, _ = x.shape
    out = zeros(x, x.shape)
    for m in range(tails):
        below, below_dx, moved = (offset, 0.0, 0.0), ZERO, (offset, 0.0, 0.0)
        for k in range(n):
            node, node_dx = vector(x, k, m), vector(dx, k, m)
            edge, change = minus(node, below), times(share, minus(node_dx, below_dx))
            length = np.sqrt(dot(edge, edge))
            turned = plus(edge, change)
            wanted = length + dot(edge, change) / length
            moved = plus(moved, times(wanted / np.sqrt(dot(turned, turned)), turned))
            put(out, k, m, moved)
            below, below_dx = node, node_dx
    return out


@borrowing
def measure(geometry: Geometry, x: Floats, offset: float, axial_stiffness: float) -> None:
    """Fill `geometry` for free nodes x (n, M, 3) of tails clamped at (offset, 0, 0) along −e_z."""
    n, tails, _ = x.shape
    tangents, lengths, joints, by_afters, by_befores, forces = geometry
    for m in range(tails):
        put(tangents, 0, m, ROOT_TANGENT)
        below, before, length_before = (offset, 0.0, 0.0), ROOT_TANGENT, 1.0
        for k in range(n):
            node = vector(x, k, m)
            edge = minus(node, below)
            length = np.sqrt(dot(edge, edge))
            tangent = times(1 / length, edge)
            c, first, second, by_after, by_before = bend(
                before, tangent, length_before, length, inverse_voronoi(k, n)
            )
            put(tangents, k + 1, m, tangent)
            lengths[k, m] = length
            put(joints, k, m, (c, first, second))
            put(by_afters, k, m, by_after)
            put(by_befores, k, m, by_before)
            below, before, length_before = node, tangent, length
        for k in range(n):
            first_next, by_before_next = 0.0, ZERO
            if k < n - 1:
                first_next, by_before_next = joints[k + 1, m, 1], vector(by_befores, k + 1, m)
            tangent, by_after = vector(tangents, k + 1, m), vector(by_afters, k, m)
            force = edge_force(
                tangent, lengths[k, m], n, axial_stiffness, joints[k, m, 1], by_after, first_next, by_before_next
            )
            put(forces, k, m, force)


@borrowing
def inverse_voronoi(k: int, n: int) -> float:
    """Compute 1/l_k of the bending energy of joint k: 2n at the clamp, n elsewhere."""
    return 2.0 * n if k == 0 else 1.0 * n


@borrowing
def edge_block(geometry: Geometry, k: int, m: int, axial_stiffness: float) -> Matrix:
    """Compute ∂²E/∂e_k²."""
    n = geometry.length.shape[0]
    c, first, second = vector(geometry.joint, k, m)
    c_next, first_next, second_next, by_before_next = 1.0, 0.0, 0.0, ZERO
    if k < n - 1:
        c_next, first_next, second_next = vector(geometry.joint, k + 1, m)
        by_before_next = vector(geometry.by_before, k + 1, m)
    return edge_stiffness(
        vector(geometry.tangent, k + 1, m), geometry.length[k, m], n, axial_stiffness,
        c, first, second, vector(geometry.by_after, k, m),
        c_next, first_next, second_next, by_before_next,
    )  # fmt: skip


@borrowing
def joint_block(geometry: Geometry, k: int, m: int) -> Matrix:
    """Compute ∂²E/∂e_{k−1} ∂e_k of joint k."""
    c, first, second = vector(geometry.joint, k, m)
    return joint_stiffness(
        vector(geometry.tangent, k, m), vector(geometry.tangent, k + 1, m),
        geometry.length[k - 1, m], geometry.length[k, m],
        c, first, second, vector(geometry.by_after, k, m), vector(geometry.by_before, k, m),
    )  # fmt: skip


@borrowing
def node_tangent(geometry: Geometry, k: int, m: int) -> tuple[Vector, float]:
    """Compute the unit tangent of node k (0: clamp), the mean of the adjacent edges', and |S| of their sum S."""
    total = vector(geometry.tangent, k, m)
    if k < geometry.length.shape[0]:
        total = plus(total, vector(geometry.tangent, k + 1, m))
    spread = np.sqrt(dot(total, total))
    return times(1 / spread, total), spread


@borrowing
def add_root_spring(body: Body, geometry: Geometry, m: int, moments: Floats) -> None:
    """Add the spring's forces to edge 0 of tail m, and the clamp's further moment to `moments` (M, 3)."""
    compliance = body.nonlocal_terms.root_compliance
    share = 1 / (1 + inverse_voronoi(0, geometry.length.shape[0]) * compliance) - 1
    slope = share * geometry.joint[0, m, 1]  # change of dE/dc, c = cosine at the joint
    add(geometry.force, 0, m, times(slope, vector(geometry.by_after, 0, m)))
    add_at(moments, m, clamp_moment(ROOT_TANGENT, vector(geometry.tangent, 1, m), slope))
