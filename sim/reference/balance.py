"""Force balance of the whole robot with tensors: residual and Newton matrix in the disc frame.

Frames. Body: origin J (disc centre), e_z forward along the axis, e_y up, e_x = e_y × e_z. Disc: body
turned about e_z by the phase φ, φ' = ω_t. Positions are in the disc frame. There the clamps do not move, and the
shape is almost steady at constant motor speed. Components below are in the disc frame:

    e_x = (cos φ, −sin φ, 0),   e_y = (sin φ, cos φ, 0),   e_z = (0, 0, 1).

A node moves in the lab with v_k = ẋ_k + G_k w, where w = (v_x, v_z, ω_yr, ω_t) is the velocity of J and

    G_k = [e_x, e_z, e_y × x_k, e_z × x_k].

The motor sets ω = ω_t − ω_h, so the unknown body velocity is u = (v_x, v_z, ω_yr, ω_h), and ω_t = ω + gain ω_h
(gain 1: the motor holds its speed). At low Reynolds number (no inertia):

    tails, each free node:   r_k = q_k(x, ẋ, u, φ) + f_k(x) + l_k b(φ) = 0   (drag + elastic force + load)
    body, total wrench:      T = Gᵀ-projection of the loads at the clamps − R (u, ω_t) = 0

T contains the force and moment at each clamp (edge 0, its bending spring, drag on node 0), not the sum of drag
over the tail. If r = 0, the two are equal. But the derivative of the force at the clamp depends only on the first
two nodes. `fluid_wrench` is the sum over the loads of the fluid.

The numbers of the robots, local effects included, come from `sim.solve.assembly`. Left out: inertia, contact
between tails, the non-local effects. Units: length l, time μ0 l⁴/EI, force EI/l². Arrays (n, 3, N, B), see
`sim.reference.elastic`. Source: Du, Miller, Jawed (arXiv 2103.05712), force balance; disc-frame formulation is
ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from sim.linear.vectors import Vector, projected, turned
from sim.mechanics.balance import motor_gain
from sim.mechanics.drag import drag_by_tangents, node_drag, node_resistance
from sim.model.body import Body
from sim.model.groups import Groups
from sim.reference import elastic
from sim.reference.banded import BlockBanded
from sim.reference.elastic import EdgeStiffness, ElasticResponse, Shape, components, stacked, stacked_matrix
from sim.solve.assembly import assemble


@dataclass(frozen=True)
class TensorRobots:
    """A batch of B robots with N tails of n edges (dimensionless)."""

    n: int
    root: Tensor  # (1, 3, N, B): clamps in the disc frame
    root_tangent: Tensor  # (1, 3, N, B)
    body: Body  # its numbers, each (…, B)

    @property
    def tails(self) -> int:
        """N."""
        return self.root.shape[2]

    @property
    def robots(self) -> int:
        """B."""
        return self.root.shape[3]

    def omega_t(self, u: Tensor, omega: Tensor) -> Tensor:
        """Compute the spin of the tails, (B,), for velocities u (4, B) and motor speeds (B,)."""
        return omega + motor_gain(self.body) * u[3]

    def voronoi(self) -> Tensor:
        """Return the lengths l_k that belong to nodes 0..n, (n + 1, 1, 1)."""
        lengths = torch.full((self.n + 1, 1, 1), 1 / self.n, dtype=self.root.dtype, device=self.root.device)
        lengths[0] = lengths[-1] = 0.5 / self.n
        return lengths

    def straight(self) -> Tensor:
        """Return the free nodes 1..n of straight tails, (n, 3, N, B)."""
        arc = torch.arange(1, self.n + 1, dtype=self.root.dtype, device=self.root.device) / self.n
        return self.root + arc.reshape(-1, 1, 1, 1) * self.root_tangent

    def select(self, robots: Tensor) -> TensorRobots:
        """Return the robots at `robots`, (K,) indices."""
        terms = self.body.nonlocal_terms
        picked = {name: getattr(self.body, name)[..., robots] for name in Body._fields[:-1]}
        body = Body(**picked, nonlocal_terms=terms._make(value[..., robots] for value in terms))
        return TensorRobots(self.n, self.root[..., robots], self.root_tangent[..., robots], body)


def tensor_robots(groups: Groups, *, edges: int) -> TensorRobots:
    """Describe the robots of `groups` (B of one N) with `edges` edges a tail."""
    body = assemble(groups)
    terms = body.nonlocal_terms._make(torch.as_tensor(value) for value in body.nonlocal_terms)
    parts = {name: torch.as_tensor(getattr(body, name)) for name in Body._fields[:-1]}
    body = Body(**parts, nonlocal_terms=terms)
    like = body.offset
    angle = 2 * math.pi * torch.arange(groups.N, dtype=like.dtype, device=like.device) / groups.N
    ring = torch.stack([torch.cos(angle), torch.sin(angle), torch.zeros_like(angle)])
    root = (ring.unsqueeze(-1) * body.offset).unsqueeze(0)
    root_tangent = torch.zeros_like(root)
    root_tangent[:, 2] = -1.0
    return TensorRobots(edges, root, root_tangent, body)


def body_axes(phase: Tensor) -> tuple[Tensor, Tensor]:
    """Compute e_x and e_y in the disc frame, each (3, 1, B), for phases (B,)."""
    c, s, none = torch.cos(phase), torch.sin(phase), torch.zeros_like(phase)
    return torch.stack([c, -s, none]).unsqueeze(1), torch.stack([s, c, none]).unsqueeze(1)


def _directions(nodes: Tensor, e_x: Tensor, e_y: Tensor) -> Tensor:
    """Assemble G as (4, n + 1, 3, N, B)."""
    G = torch.zeros(4, *nodes.shape, dtype=nodes.dtype, device=nodes.device)
    G[0] = e_x
    G[1, :, 2] = 1.0
    G[2] = torch.linalg.cross(e_y.expand_as(nodes), nodes, dim=1)
    G[3, :, 0] = -nodes[:, 1]
    G[3, :, 1] = nodes[:, 0]
    return G


@dataclass(frozen=True)
class _Drag:
    """Drag on every node and what its derivatives need; arrays lead with nodes 0..n."""

    tangent: Vector  # unit node tangents, components (n + 1, N, B)
    spread: Tensor  # |t_{k−1} + t_k|, (n + 1, N, B)
    perp: Tensor  # l_k ζ⊥, (n + 1, 1, B)
    excess: Tensor  # l_k (ζ∥ − ζ⊥)
    force: Tensor  # q, (n + 1, 3, N, B)

    def on(self, directions: Tensor) -> Tensor:
        """Compute the drag for velocities (4, n + 1, 3, N, B)."""
        x, y, z = directions.unbind(2)
        return torch.stack(node_drag(self.tangent, (x, y, z), self.perp, self.excess), 2)

    def of(self, nodes: slice) -> tuple[Vector, Tensor, Tensor, Tensor]:
        """Return tangent, spread, perp and excess of some nodes."""
        x, y, z = (t[nodes] for t in self.tangent)
        return (x, y, z), self.spread[nodes], self.perp[nodes], self.excess[nodes]


def _node_drag(robots: TensorRobots, shape: Shape, velocity: Tensor) -> _Drag:
    total = torch.cat([shape.tangent[:-1] + shape.tangent[1:], shape.tangent[-1:]])
    spread = total.square().sum(1).sqrt()
    tangent = components(total / spread.unsqueeze(1))
    voronoi = robots.voronoi()
    perp = voronoi * robots.body.zeta_perp
    excess = voronoi * (robots.body.zeta_parallel - robots.body.zeta_perp)
    return _Drag(tangent, spread, perp, excess, stacked(node_drag(tangent, components(velocity), perp, excess)))


def _body_velocity(robots: TensorRobots, u: Tensor, omega: Tensor) -> Tensor:
    """Compute w = (v_x, v_z, ω_yr, ω_t), (4, B)."""
    return torch.cat([u[:3], robots.omega_t(u, omega).unsqueeze(0)])


def _node_load(robots: TensorRobots, e_x: Tensor, e_y: Tensor) -> Tensor:
    """Compute the force of the load on every node, (n + 1, 3, N, B)."""
    load = robots.body.tail_load[0] * e_x + robots.body.tail_load[1] * e_y
    load[2] = load[2] + robots.body.tail_load[2]
    return robots.voronoi().unsqueeze(1) * load.expand(3, *robots.root.shape[2:])


def _body_load(robots: TensorRobots, u: Tensor, omega: Tensor) -> Tensor:
    """Compute the wrench (4, B) about J of the fluid on head and disc."""
    all_five = torch.cat([u, robots.omega_t(u, omega).unsqueeze(0)])
    return -(robots.body.resistance * all_five).sum(1)


def newton_correction(
    robots: TensorRobots, x: Tensor, x_dot: Tensor, phase: Tensor, u: Tensor, omega: Tensor, rate: Tensor
) -> tuple[Tensor, Tensor]:
    """Compute one Newton correction (δx, δu) of the balance.

    Args:
        x, x_dot: free nodes and their velocity in the disc frame, (n, 3, N, B).
        phase: φ, (B,).
        u: (v_x, v_z, ω_yr, ω_h), (4, B).
        omega: motor speed, (B,).
        rate: ∂ẋ/∂x of the time step, 1/(γ dt), (B,); also ∂φ/∂ω_h = gain/rate.

    Returns:
        δx (n, 3, N, B) and δu (4, B).
    """
    n = robots.n
    e_x, e_y = body_axes(phase)
    nodes = torch.cat([robots.root, x])
    shape = elastic.geometry(nodes, robots.root_tangent)
    response = elastic.respond(shape, robots.body.axial_stiffness)
    G = _directions(nodes, e_x, e_y)
    w = _body_velocity(robots, u, omega)
    velocity = (G * w.reshape(4, 1, 1, 1, -1)).sum(0)
    velocity[1:] += x_dot
    drag_ = _node_drag(robots, shape, velocity)
    load = _node_load(robots, e_x, e_y)
    residual = drag_.force[1:] + elastic.node_forces(response.edge_force) + load[1:]

    matrix = BlockBanded(n, (robots.tails, robots.robots), x)
    _add_elastic(matrix, response.stiffness)
    _add_drag(matrix, shape, drag_, velocity, w, e_y, rate)

    # Columns: derivative of the drag in the body's velocities; ω_h changes the phase, too.
    by_phase = -w[0] * e_y + w[2] * torch.linalg.cross(e_x.expand_as(nodes), nodes, dim=1)  # ∂v/∂φ
    G_total = G.clone()
    G_total[3] = motor_gain(robots.body) * (G[3] + by_phase / rate)
    border = drag_.on(G_total)

    by_root = _drag_by_first_edge(shape, drag_, velocity)
    foot, corner, total = _body_rows(
        robots, response, drag_, load[0], by_root, G, e_x, e_y, border[:, 0], rate, u, omega
    )
    return matrix.solve_bordered(-residual, border[:, 1:], foot, corner, -total)


def _add_elastic(matrix: BlockBanded, stiffness: EdgeStiffness) -> None:
    """Add the derivative of f_k = E_{e_k} − E_{e_{k−1}} in the node positions."""
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
    matrix: BlockBanded, shape: Shape, drag_: _Drag, velocity: Tensor, w: Tensor, e_y: Tensor, rate: Tensor
) -> None:
    """Add the derivative of q_k in the node positions: through ẋ, through Ω × x and through the tangents."""
    tangent, spread, perp, excess = drag_.of(slice(1, None))
    resistance = node_resistance(tangent, perp, excess)
    spin = (w[2] * e_y[0], w[2] * e_y[1], w[3])
    block = -stacked_matrix(turned(resistance, spin)) - rate * stacked_matrix(resistance)

    tilt = drag_by_tangents(tangent, spread, components(velocity[1:]), excess)
    before = stacked_matrix(projected(tilt, components(shape.tangent[1:]), 1 / shape.length))
    inner = tuple(tuple(entry[:-1] for entry in row) for row in tilt)
    after = stacked_matrix(projected(inner, components(shape.tangent[2:]), 1 / shape.length[1:]))  # type: ignore[arg-type]
    block -= before
    block[:-1] += after
    matrix.diagonal(0).add_(block)
    matrix.diagonal(-1).add_(before[1:])
    matrix.diagonal(1).sub_(after)


def _drag_by_first_edge(shape: Shape, drag_: _Drag, velocity: Tensor) -> Tensor:
    """Compute −∂q_0/∂e_0 through the clamp's node tangent, (3, 3, N, B)."""
    tangent, spread, _, excess = drag_.of(slice(1))
    tilt = drag_by_tangents(tangent, spread, components(velocity[:1]), excess)
    return stacked_matrix(projected(tilt, components(shape.tangent[1:2]), 1 / shape.length[:1]))[0]


def _body_rows(
    robots: TensorRobots,
    response: ElasticResponse,
    drag_: _Drag,
    load: Tensor,
    by_root: Tensor,
    G: Tensor,
    e_x: Tensor,
    e_y: Tensor,
    root_border: Tensor,
    rate: Tensor,
    u: Tensor,
    omega: Tensor,
) -> tuple[Tensor, Tensor, Tensor]:
    """Assemble the rows of the body: foot C (4, 6, N, B), corner D (4, 4, B) and the wrench T (4, B)."""
    root = robots.root[0]
    through = response.edge_force[0] + drag_.force[0] + load  # force that each tail puts on the disc
    force = through.sum(1)
    moment = (torch.linalg.cross(root, through, dim=0) + response.clamp_moment).sum(1)
    ex, ey = e_x.squeeze(1), e_y.squeeze(1)
    on_tails = torch.stack([(force * ex).sum(0), force[2], (moment * ey).sum(0), moment[2]])
    total = on_tails + _body_load(robots, u, omega)

    H, U = response.stiffness
    by_node = torch.stack([H[0] - U[0] - by_root, U[0]], 1)  # ∂(edge force)/∂x_1, ∂x_2: (3, 2, 3, N, B)
    arm = root.reshape(3, 1, 1, *root.shape[1:])
    moment_by_node = torch.linalg.cross(arm.expand_as(by_node), by_node, dim=0)
    moment_by_node[:, 0] += response.clamp_moment_by_edge
    foot = torch.stack(
        [
            (ex.reshape(3, 1, 1, 1, -1) * by_node).sum(0),
            by_node[2],
            (ey.reshape(3, 1, 1, 1, -1) * moment_by_node).sum(0),
            moment_by_node[2],
        ]
    ).reshape(4, 6, *root.shape[1:])

    corner = (G[:, 0].unsqueeze(1) * root_border.unsqueeze(0)).sum((2, 3))
    corner -= robots.body.resistance[:, :4]
    corner[:, 3] -= motor_gain(robots.body) * robots.body.resistance[:, 4]
    corner[0, 3] -= (force * ey).sum(0) * motor_gain(robots.body) / rate
    corner[2, 3] += (moment * ex).sum(0) * motor_gain(robots.body) / rate
    return foot, corner, total


def fluid_wrench(
    robots: TensorRobots, x: Tensor, x_dot: Tensor, phase: Tensor, u: Tensor, omega: Tensor
) -> tuple[Tensor, Tensor]:
    """Compute the wrench (F_x, F_z, M_y, M_z) about J of the fluid on the tails and on the head, each (4, B).

    Their sum is zero at every instant for a robot in balance.
    """
    e_x, e_y = body_axes(phase)
    nodes = torch.cat([robots.root, x])
    shape = elastic.geometry(nodes, robots.root_tangent)
    G = _directions(nodes, e_x, e_y)
    velocity = (G * _body_velocity(robots, u, omega).reshape(4, 1, 1, 1, -1)).sum(0)
    velocity[1:] += x_dot
    loads = _node_drag(robots, shape, velocity).force
    return (G * loads).sum((1, 2, 3)), _body_load(robots, u, omega)
