"""Elastic response of many tails at once, as tensors: the formulas of `sim.mechanics.rod`.

Arrays are (n, 3, N, B): node or edge, component, tail, robot, with the batch last so that every operation runs
over contiguous memory. Units: EI = 1, l = 1, so EA = 4 (l/r0)².
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from sim.linear.vectors import Matrix, Vector
from sim.mechanics import rod


class Shape(NamedTuple):
    """Geometry of tails: edge lengths and tangents (root tangent first)."""

    length: Tensor  # (n, N, B)
    tangent: Tensor  # (n + 1, 3, N, B)


class EdgeStiffness(NamedTuple):
    """Second derivatives of the energy in the edge vectors (block tridiagonal, symmetric)."""

    diagonal: Tensor  # (n, 3, 3, N, B)
    upper: Tensor  # (n − 1, 3, 3, N, B): ∂²E/∂e_j ∂e_{j+1}


class ElasticResponse(NamedTuple):
    """Forces and stiffness of tails, and the moment at the clamp."""

    edge_force: Tensor  # ∂E/∂e, (n, 3, N, B)
    stiffness: EdgeStiffness
    clamp_moment: Tensor  # moment of the bending spring at the clamp on the disc, (3, N, B)
    clamp_moment_by_edge: Tensor  # its derivative in e_0, (3, 3, N, B)


def components(a: Tensor) -> Vector:
    """Split (n, 3, N, B) into its three components, (n, N, B) each."""
    x, y, z = a.unbind(1)
    return x, y, z


def stacked(a: Vector) -> Tensor:
    """Stack three components, the inverse of `components`."""
    return torch.stack(a, 1)


def stacked_matrix(a: Matrix) -> Tensor:
    """Stack nine entries (n, N, B) to (n, 3, 3, N, B)."""
    return torch.stack([torch.stack(row, 1) for row in a], 1)


def geometry(nodes: Tensor, root_tangent: Tensor) -> Shape:
    """Compute the edges of tails with nodes (n + 1, 3, N, B) clamped along root_tangent (1, 3, N, B)."""
    edge = nodes[1:] - nodes[:-1]
    length = edge.square().sum(1).sqrt()
    return Shape(length, torch.cat([root_tangent, edge / length.unsqueeze(1)]))


def inverse_voronoi(n: int, like: Tensor) -> Tensor:
    """Compute 1/l_k of the bending energies at nodes 0..n−1, (n, 1, 1): 2n at the clamp, n elsewhere."""
    weight = torch.full((n, 1, 1), float(n), dtype=like.dtype, device=like.device)
    weight[0] = 2.0 * n
    return weight


def energy(shape: Shape, axial_stiffness: Tensor) -> Tensor:
    """Compute the elastic energy of each tail, (N, B), in EI/l; `axial_stiffness` is EA l²/EI, (B,)."""
    n = shape.length.shape[0]
    stretch = 0.5 * axial_stiffness * (shape.length * n - 1) ** 2 / n
    cosine = (shape.tangent[:-1] * shape.tangent[1:]).sum(1)
    return (stretch + rod.bending_energy(cosine, inverse_voronoi(n, cosine))).sum(0)


class _Joints(NamedTuple):
    """The joint before each edge, and the joint after it (zero after the last edge)."""

    tangent: Vector
    cosine: Tensor
    first: Tensor
    second: Tensor
    by_after: Vector
    cosine_next: Tensor
    first_next: Tensor
    second_next: Tensor
    by_before_next: Vector


def _joints(shape: Shape) -> _Joints:
    n = shape.length.shape[0]
    before, after = components(shape.tangent[:-1]), components(shape.tangent[1:])
    length_before = torch.cat([torch.ones_like(shape.length[:1]), shape.length[:-1]])
    c, first, second, by_after, by_before = rod.bend(
        before, after, length_before, shape.length, inverse_voronoi(n, shape.length)
    )
    b_x, b_y, b_z = (_next(b) for b in by_before)
    return _Joints(after, c, first, second, by_after, _next(c), _next(first), _next(second), (b_x, b_y, b_z))


def _next(a: Tensor) -> Tensor:
    """Shift a_{k+1} to place k, with zero at the last place."""
    return torch.cat([a[1:], torch.zeros_like(a[:1])])


def edge_forces(shape: Shape, axial_stiffness: Tensor) -> Tensor:
    """Compute ∂E/∂e_j, (n, 3, N, B): the internal force carried by edge j, in EI/l²."""
    return _edge_forces(shape, _joints(shape), axial_stiffness)


def _edge_forces(shape: Shape, joints: _Joints, axial_stiffness: Tensor) -> Tensor:
    n = shape.length.shape[0]
    return stacked(
        rod.edge_force(
            joints.tangent, shape.length, n, axial_stiffness,
            joints.first, joints.by_after, joints.first_next, joints.by_before_next,
        )
    )  # fmt: skip


def respond(shape: Shape, axial_stiffness: Tensor) -> ElasticResponse:
    """Compute internal forces, their derivatives in the edges, and the clamp's moment.

    Args:
        shape: geometry of tails with n edges.
        axial_stiffness: EA l²/EI = 4 (l/r0)², (B,).
    """
    n = shape.length.shape[0]
    joints = _joints(shape)
    diagonal = rod.edge_stiffness(
        joints.tangent, shape.length, n, axial_stiffness,
        joints.cosine, joints.first, joints.second, joints.by_after,
        joints.cosine_next, joints.first_next, joints.second_next, joints.by_before_next,
    )  # fmt: skip
    edges = components(shape.tangent[1:])
    before, after = _part(edges, slice(None, -1)), _part(edges, slice(1, None))
    upper = rod.joint_stiffness(
        before, after, shape.length[:-1], shape.length[1:],
        joints.cosine[1:], joints.first[1:], joints.second[1:],
        _part(joints.by_after, slice(1, None)), _part(joints.by_before_next, slice(None, -1)),
    )  # fmt: skip
    root, first_edge = components(shape.tangent[:1]), _part(edges, slice(1))
    by_after = _part(joints.by_after, slice(1))
    moment = rod.clamp_moment(root, first_edge, joints.first[:1])
    moment_by_edge = rod.clamp_moment_by_edge(
        root, first_edge, shape.length[:1], joints.first[:1], joints.second[:1], by_after
    )
    return ElasticResponse(
        _edge_forces(shape, joints, axial_stiffness),
        EdgeStiffness(stacked_matrix(diagonal), stacked_matrix(upper)),
        stacked(moment)[0],
        stacked_matrix(moment_by_edge)[0],
    )


def _part(a: Vector, where: slice) -> Vector:
    return a[0][where], a[1][where], a[2][where]


def node_forces(edge_force: Tensor) -> Tensor:
    """Compute the elastic force on the free nodes 1..n from the edge forces, (n, 3, N, B)."""
    force = -edge_force.clone()
    force[:-1] += edge_force[1:]
    return force
