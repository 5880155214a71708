"""Force balance of the whole robot: residual and Newton matrix in the disc frame.

Frames. Body: origin J (disc centre), e_z forward along the axis, e_y up, e_x = e_y × e_z. Disc: body
turned about e_z by the phase φ, φ' = ω_t. Tails are held in the disc frame, so the clamps stand still
and a constant motor speed gives an almost steady shape. Components below are in the disc frame:

    e_x = (cos φ, −sin φ, 0),   e_y = (sin φ, cos φ, 0),   e_z = (0, 0, 1).

A node moves in the lab with v_k = ẋ_k + G_k w, where w = (v_x, v_z, ω_yr, ω_t) is the velocity of J and

    G_k = [e_x, e_z, e_y × x_k, e_z × x_k].

The motor sets ω = ω_t − ω_h, so the unknown body velocity is u = (v_x, v_z, ω_yr, ω_h). At low Reynolds
number (no inertia):

    tails, each free node:   r_k = q_k(x, ẋ, u, φ) + f_k(x) = 0           (drag + elastic force)
    body, total wrench:      T = Gᵀ-projection of what the clamps transmit − R_h u = 0

T uses the force and moment that pass through each clamp (edge 0, its bending spring, drag on node 0)
instead of the sum of drag over the tail: where r = 0 the two are equal, and the derivative of T then
touches only the first two nodes. `fluid_wrench` is the other one, the sum over the fluid's loads.

The equations know no effect by name: every effect's contribution enters through the hooks of
`sim.effects.base`. Left out: inertia, contact between tails, everything in `sim.effects` at its null.
Units: length l, time μ0 l⁴/EI, force EI/l². Arrays (n, 3, N, B), see `sim.rod`.
Source: Du, Miller, Jawed (arXiv 2103.05712), force balance; disc-frame formulation is ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from sim import drag, rod
from sim.banded import BlockBanded
from sim.effects import adjust_head_resistance, adjust_tail_coefficients
from sim.robot import Groups
from sim.rod import cross, dot, outer


@dataclass(frozen=True)
class Swimmer:
    """A batch of B robots with N tails of n edges, ready to be balanced (dimensionless)."""

    n: int
    root: Tensor  # (1, 3, N, B): clamps in the disc frame
    root_tangent: Tensor  # (1, 3, N, B)
    axial_stiffness: Tensor  # EA l²/EI, (B,)
    zeta_parallel: Tensor  # (B,)
    zeta_perp: Tensor  # (B,)
    head_resistance: Tensor  # (4, 4, B)
    head_length: Tensor  # L/l, (B,)
    tail_radius: Tensor  # r0/l, (B,)

    @property
    def tails(self) -> int:
        return self.root.shape[2]

    @property
    def robots(self) -> int:
        return self.root.shape[3]

    def straight(self) -> Tensor:
        """Free nodes 1..n of straight tails, (n, 3, N, B)."""
        arc = torch.arange(1, self.n + 1, dtype=self.root.dtype, device=self.root.device) / self.n
        return self.root + arc.reshape(-1, 1, 1, 1) * self.root_tangent

    def select(self, lanes: Tensor) -> Swimmer:
        """The robots at `lanes`, (K,) indices."""
        fields: dict[str, Any] = {
            name: value[..., lanes] for name, value in vars(self).items() if torch.is_tensor(value)
        }
        return replace(self, **fields)


def assemble(groups: Groups, *, edges: int) -> Swimmer:
    """Build the swimmers of `groups` (B robots of one N) with `edges` edges a tail."""
    like = groups.l_over_R
    R = 1 / groups.l_over_R
    L = groups.L_over_R * R
    offset = groups.a_over_R * R
    angle = 2 * math.pi * torch.arange(groups.N, dtype=like.dtype, device=like.device) / groups.N
    ring = torch.stack([torch.cos(angle), torch.sin(angle), torch.zeros_like(angle)])
    root = (ring.unsqueeze(-1) * offset).unsqueeze(0)
    root_tangent = torch.zeros_like(root)
    root_tangent[:, 2] = -1.0
    parallel, perp = adjust_tail_coefficients(groups, drag.tail_coefficients(groups.l_over_r0))
    head = drag.head_resistance(groups.C_t, groups.C_r, groups.C_yr, R, L)
    return Swimmer(
        n=edges,
        root=root,
        root_tangent=root_tangent,
        axial_stiffness=4 * groups.l_over_r0**2,
        zeta_parallel=parallel,
        zeta_perp=perp,
        head_resistance=adjust_head_resistance(groups, head),
        head_length=L,
        tail_radius=1 / groups.l_over_r0,
    )


def body_axes(phase: Tensor) -> tuple[Tensor, Tensor]:
    """e_x and e_y in the disc frame, each (3, 1, B), for phases (B,)."""
    c, s, none = torch.cos(phase), torch.sin(phase), torch.zeros_like(phase)
    return torch.stack([c, -s, none]).unsqueeze(1), torch.stack([s, c, none]).unsqueeze(1)


def _directions(nodes: Tensor, e_x: Tensor, e_y: Tensor) -> Tensor:
    """G as (4, n + 1, 3, N, B)."""
    G = torch.zeros(4, *nodes.shape, dtype=nodes.dtype, device=nodes.device)
    G[0] = e_x
    G[1, :, 2] = 1.0
    G[2] = cross(e_y.expand_as(nodes), nodes)
    G[3, :, 0] = -nodes[:, 1]
    G[3, :, 1] = nodes[:, 0]
    return G


@dataclass(frozen=True)
class _Drag:
    """Drag on every node and what its derivatives need; arrays lead with nodes 0..n."""

    tangent: Tensor  # unit node tangents
    spread: Tensor  # |t_{k−1} + t_k|, (n + 1, 1, N, B)
    along: Tensor  # t·v
    perp: Tensor  # l_k ζ⊥
    excess: Tensor  # l_k (ζ∥ − ζ⊥)
    force: Tensor  # q

    def resist(self, v: Tensor) -> Tensor:
        """l_k [ζ⊥ v + (ζ∥ − ζ⊥)(t·v) t] for (..., n + 1, 3, N, B)."""
        return self.perp * v + self.excess * dot(self.tangent, v) * self.tangent


def _node_drag(swimmer: Swimmer, shape: rod.Stretching, velocity: Tensor) -> _Drag:
    n = swimmer.n
    total = torch.cat([shape.tangent[:-1] + shape.tangent[1:], shape.tangent[-1:]])
    spread = dot(total, total).sqrt()
    tangent = total / spread
    voronoi = torch.full((n + 1, 1, 1, 1), 1 / n, dtype=total.dtype, device=total.device)
    voronoi[0] = voronoi[-1] = 0.5 / n
    perp = voronoi * swimmer.zeta_perp
    excess = voronoi * (swimmer.zeta_parallel - swimmer.zeta_perp)
    along = dot(tangent, velocity)
    return _Drag(tangent, spread, along, perp, excess, -(perp * velocity + excess * along * tangent))


def _body_velocity(u: Tensor, omega: Tensor) -> Tensor:
    """w = (v_x, v_z, ω_yr, ω_t), (4, B)."""
    return torch.cat([u[:3], (u[3] + omega).unsqueeze(0)])


def newton_correction(
    swimmer: Swimmer,
    x: Tensor,
    x_dot: Tensor,
    phase: Tensor,
    u: Tensor,
    omega: Tensor,
    rate: Tensor,
) -> tuple[Tensor, Tensor]:
    """One Newton correction (δx, δu) of the balance.

    Args:
        x, x_dot: free nodes and their velocity in the disc frame, (n, 3, N, B).
        phase: φ, (B,).
        u: (v_x, v_z, ω_yr, ω_h), (4, B).
        omega: motor speed, (B,).
        rate: ∂ẋ/∂x of the time step, 1/(γ dt), (B,); also ∂φ/∂ω_h = 1/rate.

    Returns:
        δx (n, 3, N, B) and δu (4, B).
    """
    n = swimmer.n
    e_x, e_y = body_axes(phase)
    nodes = torch.cat([swimmer.root, x])
    shape = rod.geometry(nodes, swimmer.root_tangent)
    elastic = rod.respond(shape, swimmer.axial_stiffness)
    G = _directions(nodes, e_x, e_y)
    w = _body_velocity(u, omega)
    velocity = (G * w.reshape(4, 1, 1, 1, -1)).sum(0)
    velocity[1:] += x_dot
    drag_ = _node_drag(swimmer, shape, velocity)
    residual = drag_.force[1:] + rod.node_forces(elastic.edge_force)

    matrix = BlockBanded(n, (swimmer.tails, swimmer.robots), x)
    _add_elastic(matrix, elastic.stiffness)
    _add_drag(matrix, shape, drag_, velocity, w, e_y, rate)

    # Columns: how the body's velocities, and through ω_h the phase, move the drag.
    turned = -w[0] * e_y + w[2] * cross(e_x.expand_as(nodes), nodes)  # ∂v/∂φ
    G_total = G.clone()
    G_total[3] += turned / rate
    border = -drag_.resist(G_total)

    foot, corner, total = _body_rows(swimmer, elastic, drag_, G, e_x, e_y, border[:, 0], rate, u)
    return matrix.solve_bordered(-residual, border[:, 1:], foot, corner, -total)


def _add_elastic(matrix: BlockBanded, stiffness: rod.EdgeStiffness) -> None:
    """Derivative of f_k = E_{e_k} − E_{e_{k−1}} in the node positions."""
    H, U = stiffness
    L = U.transpose(1, 2)
    diagonal = matrix.diagonal(0)
    diagonal -= H
    diagonal[:-1] += L + U - H[1:]
    first = H[1:].clone()
    first[:-1] -= U[1:]
    first -= U
    matrix.diagonal(1).add_(first)
    matrix.diagonal(-1).add_(first.transpose(1, 2))
    matrix.diagonal(2).add_(U[1:])
    matrix.diagonal(-2).add_(L[1:])


def _add_drag(
    matrix: BlockBanded,
    shape: rod.Stretching,
    drag_: _Drag,
    velocity: Tensor,
    w: Tensor,
    e_y: Tensor,
    rate: Tensor,
) -> None:
    """Derivative of q_k in the node positions: through ẋ, through Ω × x and through the tangents."""
    t, perp, excess = drag_.tangent[1:], drag_.perp[1:], drag_.excess[1:]
    spin = w[2] * e_y
    spin[2] += w[3]
    spin = spin.expand(3, *t.shape[2:])
    block = outer(-excess * t, rate * t + cross(t, spin.expand_as(t)))
    torch.diagonal(block, dim1=1, dim2=2).sub_((perp * rate).squeeze(1).unsqueeze(-1))
    weighted = perp * spin  # (n, 3, N, B)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        block[:, i, j] += weighted[:, k]
        block[:, j, i] -= weighted[:, k]

    # q depends on t through (t·v) t; t = S/|S| with S the sum of the adjacent edge tangents.
    along, scale = drag_.along[1:], excess / drag_.spread[1:]
    tilt = outer(scale * t, velocity[1:] - 2 * along * t)
    torch.diagonal(tilt, dim1=1, dim2=2).add_((scale * along).squeeze(1).unsqueeze(-1))
    before = _through_tangent(tilt, shape.tangent[1:], shape.length)
    after = _through_tangent(tilt[:-1], shape.tangent[2:], shape.length[1:])
    block -= before
    block[:-1] += after
    matrix.diagonal(0).add_(block)
    matrix.diagonal(-1).add_(before[1:])
    matrix.diagonal(1).sub_(after)


def _through_tangent(tilt: Tensor, tangent: Tensor, length: Tensor) -> Tensor:
    """tilt (I − t tᵀ)/|e|: chain rule from an edge's tangent to its vector."""
    along = (tilt * tangent.unsqueeze(1)).sum(2)
    return (tilt - outer(along, tangent)) / length.unsqueeze(1)


def _body_rows(
    swimmer: Swimmer,
    elastic: rod.ElasticResponse,
    drag_: _Drag,
    G: Tensor,
    e_x: Tensor,
    e_y: Tensor,
    root_border: Tensor,
    rate: Tensor,
    u: Tensor,
) -> tuple[Tensor, Tensor, Tensor]:
    """Rows of the body: foot C (4, 6, N, B), corner D (4, 4, B) and the wrench T (4, B)."""
    root = swimmer.root[0]
    through = elastic.edge_force[0] + drag_.force[0]  # force that each tail puts on the disc
    force = through.sum(1)
    moment = (torch.linalg.cross(root, through, dim=0) + elastic.clamp_moment).sum(1)
    ex, ey = e_x.squeeze(1), e_y.squeeze(1)
    head = (swimmer.head_resistance * u.unsqueeze(0)).sum(1)
    total = torch.stack([(force * ex).sum(0), force[2], (moment * ey).sum(0), moment[2]]) - head

    H, U = elastic.stiffness
    by_node = torch.stack([H[0] - U[0], U[0]], 1)  # ∂(edge force)/∂x_1, ∂x_2: (3, 2, 3, N, B)
    arm = root.reshape(3, 1, 1, *root.shape[1:])
    moment_by_node = torch.linalg.cross(arm.expand_as(by_node), by_node, dim=0)
    moment_by_node[:, 0] += elastic.clamp_moment_by_edge
    foot = torch.stack(
        [
            (ex.reshape(3, 1, 1, 1, -1) * by_node).sum(0),
            by_node[2],
            (ey.reshape(3, 1, 1, 1, -1) * moment_by_node).sum(0),
            moment_by_node[2],
        ]
    ).reshape(4, 6, *root.shape[1:])

    corner = (G[:, 0].unsqueeze(1) * root_border.unsqueeze(0)).sum((2, 3))
    corner -= swimmer.head_resistance
    corner[0, 3] -= (force * ey).sum(0) / rate
    corner[2, 3] += (moment * ex).sum(0) / rate
    return foot, corner, total


def fluid_wrench(
    swimmer: Swimmer, x: Tensor, x_dot: Tensor, phase: Tensor, u: Tensor, omega: Tensor
) -> tuple[Tensor, Tensor]:
    """Wrench (F_x, F_z, M_y, M_z) about J of the fluid on the tails and on the head, each (4, B).

    Their sum is zero at every instant for a robot in balance.
    """
    e_x, e_y = body_axes(phase)
    nodes = torch.cat([swimmer.root, x])
    shape = rod.geometry(nodes, swimmer.root_tangent)
    G = _directions(nodes, e_x, e_y)
    velocity = (G * _body_velocity(u, omega).reshape(4, 1, 1, 1, -1)).sum(0)
    velocity[1:] += x_dot
    loads = _node_drag(swimmer, shape, velocity).force
    return (G * loads).sum((1, 2, 3)), -(swimmer.head_resistance * u.unsqueeze(0)).sum(1)
