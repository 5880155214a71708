"""Discrete elastic rod, twist condensed out: energy, force and stiffness of straight isotropic tails.

A tail has nodes 0..n and edges e_j = x_{j+1} − x_j of natural length h = 1/n. Its energy is

    E_s = ½ EA Σ (|e_j|/h − 1)² h
    E_b = ½ EI Σ |κ_k|² / l_k,   κ_k = 2 t_{k−1} × t_k / (1 + t_{k−1}·t_k)   (t = e/|e|).

Since |κ_k|² = 4 (1 − c)/(1 + c) depends on c = t_{k−1}·t_k alone, E_b = Σ g(c_k), with
g' = −4 EI/l_k (1 + c)⁻² and g'' = 8 EI/l_k (1 + c)⁻³; all that follows is the chain rule.

Clamp: node 0 and the root *tangent* t_{−1} are held; the bending energy between that tangent and edge 0
has the half Voronoi length l_0 = h/2 (l_k = h elsewhere). This converges at second order; holding two
nodes instead shortens the tail and converges at first order only.

Natural curvature and twist are zero here: then the twist of a free-ended isotropic rod relaxes to zero
whatever its shape and puts no force on the nodes (`sim.framed_rod` has the material frames, and a test
shows that the two agree).

Units: EI = 1, l = 1, so EA = 4 (l/r0)². Layout: arrays are (n, 3, N, B): node or edge, component, tail,
robot, with the batch last so that every operation runs over contiguous lanes.
Source: Bergou et al. (2008, 2010); Jawed, Novelia, O'Reilly, *A Primer on the Kinematics of Discrete
Elastic Rods* (2018); the paper's energies (arXiv 2103.05712, eqs. 1-3).
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor


class Stretching(NamedTuple):
    """Geometry of a tail: edge lengths, tangents (root tangent first) and turning cosines."""

    length: Tensor  # (n, 1, N, B)
    tangent: Tensor  # (n + 1, 3, N, B): root tangent, then one an edge
    cosine: Tensor  # (n, 1, N, B): between tangent k and k + 1, at node k


class EdgeStiffness(NamedTuple):
    """Second derivatives of the energy in the edge vectors (block tridiagonal, symmetric)."""

    diagonal: Tensor  # (n, 3, 3, N, B)
    upper: Tensor  # (n − 1, 3, 3, N, B): ∂²E/∂e_j ∂e_{j+1}


def dot(a: Tensor, b: Tensor) -> Tensor:
    """Scalar product over the component axis, kept: (..., 3, N, B) -> (..., 1, N, B)."""
    return (a * b).sum(-3, keepdim=True)


def cross(a: Tensor, b: Tensor) -> Tensor:
    """Vector product over the component axis (third from the end)."""
    return torch.linalg.cross(a, b, dim=-3)


def outer(a: Tensor, b: Tensor) -> Tensor:
    """a ⊗ b over the component axis: (n, 3, N, B) twice -> (n, 3, 3, N, B)."""
    return a.unsqueeze(-3) * b.unsqueeze(-4)


def geometry(nodes: Tensor, root_tangent: Tensor) -> Stretching:
    """Edges of tails with nodes (n + 1, 3, N, B) clamped along root_tangent (1, 3, N, B)."""
    edge = nodes[1:] - nodes[:-1]
    length = dot(edge, edge).sqrt()
    tangent = torch.cat([root_tangent, edge / length])
    return Stretching(length, tangent, dot(tangent[:-1], tangent[1:]))


def inverse_voronoi(n: int, like: Tensor) -> Tensor:
    """1/l_k of the bending energies at nodes 0..n−1, (n, 1, 1, 1): 2n at the clamp, n elsewhere."""
    weight = torch.full((n, 1, 1, 1), float(n), dtype=like.dtype, device=like.device)
    weight[0] = 2.0 * n
    return weight


def energy(shape: Stretching, axial_stiffness: Tensor) -> Tensor:
    """Elastic energy of each tail, (N, B), in EI/l; `axial_stiffness` is EA l²/EI, (B,)."""
    n = shape.length.shape[0]
    stretch = 0.5 * axial_stiffness * (shape.length * n - 1) ** 2 / n
    c = shape.cosine
    bend = 2 * inverse_voronoi(n, c) * (1 - c) / (1 + c)
    return (stretch + bend).sum((0, 1))


class _Bending(NamedTuple):
    first: Tensor  # g'(c_k), (n, 1, N, B)
    second: Tensor  # g''(c_k)
    by_next: Tensor  # ∂c_k/∂e_k, (n, 3, N, B)
    by_previous: Tensor  # ∂c_{k+1}/∂e_k with a zero row for the last edge, (n, 3, N, B)


def _bending(shape: Stretching) -> _Bending:
    n = shape.length.shape[0]
    tangent, c, length = shape.tangent, shape.cosine, shape.length
    inverse = 1 / (1 + c)
    first = -4 * inverse_voronoi(n, c) * inverse**2
    by_next = (tangent[:-1] - c * tangent[1:]) / length
    by_previous = torch.zeros_like(by_next)
    torch.div(tangent[2:] - c[1:] * tangent[1:-1], length[:-1], out=by_previous[:-1])
    return _Bending(first, -2 * first * inverse, by_next, by_previous)


def _shifted(a: Tensor) -> Tensor:
    """a_{k+1} at place k, zero at the last place."""
    out = torch.zeros_like(a)
    out[:-1] = a[1:]
    return out


def edge_forces(shape: Stretching, axial_stiffness: Tensor) -> Tensor:
    """∂E/∂e_j, (n, 3, N, B): the internal force carried by edge j, in EI/l²."""
    bending = _bending(shape)
    return _edge_forces(shape, bending, _shifted(bending.first), axial_stiffness)


def _edge_forces(shape: Stretching, bending: _Bending, first_after: Tensor, axial_stiffness: Tensor) -> Tensor:
    n = shape.length.shape[0]
    force = (axial_stiffness * (shape.length * n - 1)) * shape.tangent[1:]
    force.addcmul_(bending.first, bending.by_next)
    return force.addcmul_(first_after, bending.by_previous)


class ElasticResponse(NamedTuple):
    """Forces and stiffness of tails, and what the clamp transmits."""

    edge_force: Tensor  # ∂E/∂e, (n, 3, N, B)
    stiffness: EdgeStiffness
    clamp_moment: Tensor  # moment of the bending spring at the clamp on the disc, (3, N, B)
    clamp_moment_by_edge: Tensor  # its derivative in e_0, (3, 3, N, B)


def respond(shape: Stretching, axial_stiffness: Tensor) -> ElasticResponse:
    """Internal forces, their derivatives in the edges, and the clamp's moment.

    Args:
        shape: geometry of tails with n edges.
        axial_stiffness: EA l²/EI = 4 (l/r0)², (B,).
    """
    n = shape.length.shape[0]
    length, tangent, c = shape.length, shape.tangent[1:], shape.cosine
    bending = _bending(shape)
    first, second, by_next, by_previous = bending
    first_after = _shifted(first)
    force = _edge_forces(shape, bending, first_after, axial_stiffness)

    # Diagonal blocks α I + t⊗(β t + q) + q⊗t + g''_k p⊗p + g''_{k+1} m⊗m.
    turning = (first * c + first_after * _shifted(c)) / length**2
    q = -(first * by_next + first_after * by_previous) / length
    alpha = axial_stiffness * (n - 1 / length) - turning
    beta = axial_stiffness / length + turning
    diagonal = outer(tangent, beta * tangent + q)
    diagonal.addcmul_(q.unsqueeze(2), tangent.unsqueeze(1))
    diagonal.addcmul_(by_next.unsqueeze(2), (second * by_next).unsqueeze(1))
    diagonal.addcmul_(by_previous.unsqueeze(2), (_shifted(second) * by_previous).unsqueeze(1))
    _add_to_trace(diagonal, alpha)

    # Upper blocks g'' m⊗p + g' P_j P_{j+1}/(|e_j||e_{j+1}|).
    here, after, inner = tangent[:-1], tangent[1:], c[1:]
    scale = first[1:] / (length[:-1] * length[1:])
    upper = outer(by_previous[:-1], second[1:] * by_next[1:])
    upper.addcmul_((scale * here).unsqueeze(2), (inner * after - here).unsqueeze(1))
    upper.addcmul_((-scale * after).unsqueeze(2), after.unsqueeze(1))
    _add_to_trace(upper, scale)

    # Clamp: energy g(t_{−1}·t_0) turns the disc with moment −g' t_{−1} × t_0.
    root = shape.tangent[0]
    axis = cross(root, tangent[0])
    projected = torch.linalg.cross(
        root.unsqueeze(1).expand(3, 3, *root.shape[1:]),
        (_identity(root) - tangent[0].unsqueeze(1) * tangent[0].unsqueeze(0)) / length[0],
        dim=0,
    )
    moment_by_edge = -(second[0] * axis.unsqueeze(1) * by_next[0].unsqueeze(0) + first[0] * projected)
    return ElasticResponse(force, EdgeStiffness(diagonal, upper), -first[0] * axis, moment_by_edge)


def _identity(like: Tensor) -> Tensor:
    return torch.eye(3, dtype=like.dtype, device=like.device).reshape(3, 3, 1, 1)


def _add_to_trace(blocks: Tensor, scalar: Tensor) -> None:
    """blocks += scalar I, blocks (n, 3, 3, N, B), scalar (n, 1, N, B)."""
    torch.diagonal(blocks, dim1=1, dim2=2).add_(scalar.squeeze(1).unsqueeze(-1))


def node_forces(edge_force: Tensor) -> Tensor:
    """Elastic force on the free nodes 1..n from the edge forces, (n, 3, N, B)."""
    force = -edge_force.clone()
    force[:-1] += edge_force[1:]
    return force
