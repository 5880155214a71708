"""Tails in compiled loops: geometry, forces and stiffness of every edge and joint.

The loops run the formulas of `sim.rod` over the nodes of M lanes side by side: disc phases of one tail in
`sim.orbit`. `sim.elastic` does the same with tensors.

Layout: arrays are (node, lane, component), so that the 3 M components of a node lie together.
Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.compiling import compiled
from sim.rod import bend, edge_force, edge_stiffness, joint_stiffness
from sim.vectors import Matrix, Vector, dot, minus, plus, times

Array = NDArray[np.float64]

ROOT_TANGENT = (0.0, 0.0, -1.0)
NONE = (0.0, 0.0, 0.0)


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
def vector(a: Array, k: int, m: int) -> Vector:
    """a[k, m] as components."""
    return (a[k, m, 0], a[k, m, 1], a[k, m, 2])


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
