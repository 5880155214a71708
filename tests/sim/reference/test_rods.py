"""Discrete elastic rod: derivatives, elastica, and the twist that may be condensed out."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from sim.reference import elastic
from sim.reference.framed_rod import FramedRod, Frames
from tests.reference.cases import ELASTICA

N_EDGES = 16


def random_tail(seed: int, n: int = 8) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw a bent, slightly stretched tail (n, 3, 1, 1) and its root tangent."""
    generator = torch.Generator().manual_seed(seed)
    steps = torch.randn(n, 3, generator=generator, dtype=torch.float64) * 0.35
    steps[:, 2] -= 1.0
    tangent = steps / steps.norm(dim=1, keepdim=True)
    stretch = 1 + 0.02 * torch.randn(n, 1, generator=generator, dtype=torch.float64)
    x = torch.cumsum(tangent * stretch / n, 0).reshape(n, 3, 1, 1)
    down = torch.tensor([0.0, 0.0, -1.0], dtype=torch.float64).reshape(1, 3, 1, 1)
    return x, down


def elastic_energy(x: torch.Tensor, down: torch.Tensor, stiffness: torch.Tensor) -> torch.Tensor:
    return elastic.energy(elastic.geometry(torch.cat([torch.zeros_like(down), x]), down), stiffness).sum()


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_forces_and_stiffness_are_the_derivatives_of_the_energy(seed: int) -> None:
    x, down = random_tail(seed)
    n = x.shape[0]
    stiffness = torch.tensor([4 * 34.375**2], dtype=torch.float64)
    exact = -torch.func.grad(elastic_energy)(x, down, stiffness)
    response = elastic.respond(elastic.geometry(torch.cat([torch.zeros_like(down), x]), down), stiffness)
    forces = elastic.node_forces(response.edge_force)
    assert torch.allclose(forces, exact, rtol=1e-10, atol=1e-8)

    def edge_energy(edges: torch.Tensor) -> torch.Tensor:
        return elastic_energy(torch.cumsum(edges, 0), down, stiffness)

    edges = torch.diff(torch.cat([torch.zeros_like(down), x]), dim=0)
    hessian = torch.func.hessian(edge_energy)(edges).reshape(n, 3, n, 3)
    for j in range(n):
        assert torch.allclose(response.stiffness.diagonal[j, :, :, 0, 0], hessian[j, :, j], atol=1e-7)
    for j in range(n - 1):
        assert torch.allclose(response.stiffness.upper[j, :, :, 0, 0], hessian[j, :, j + 1], atol=1e-7)


def test_clamp_moment_balances_the_tail() -> None:
    """Turning tail and clamp together costs nothing: inner forces and clamp moment have no net moment."""
    x, down = random_tail(3)
    response = elastic.respond(
        elastic.geometry(torch.cat([torch.zeros_like(down), x]), down), torch.tensor([4000.0], dtype=torch.float64)
    )
    forces = elastic.node_forces(response.edge_force)
    moment = torch.linalg.cross(x, forces, dim=1).sum(0) + response.clamp_moment
    assert moment.abs().max() < 1e-9 * forces.abs().max()


def cantilever(alpha: float, n: int) -> tuple[float, float]:
    """Compute deflection and shortening of a cantilever under a dead tip load."""
    stiffness = torch.tensor([4 * 500.0**2], dtype=torch.float64)
    down = torch.tensor([0.0, 0.0, -1.0], dtype=torch.float64).reshape(1, 3, 1, 1)
    straight = torch.zeros(n, 3, 1, 1, dtype=torch.float64)
    straight[:, 2, 0, 0] = -torch.arange(1, n + 1, dtype=torch.float64) / n

    def residual(flat: np.ndarray, load: float) -> np.ndarray:
        x = torch.tensor(flat).reshape(n, 3, 1, 1)
        shape = elastic.geometry(torch.cat([torch.zeros_like(down), x]), down)
        force = elastic.node_forces(elastic.edge_forces(shape, stiffness))
        force[-1, 0] += load
        return force.reshape(-1).numpy()

    def slope(flat: np.ndarray) -> np.ndarray:
        x = torch.tensor(flat).reshape(n, 3, 1, 1)
        hessian = torch.func.hessian(elastic_energy)(x, down, stiffness)
        return -hessian.reshape(3 * n, 3 * n).numpy()

    flat = straight.reshape(-1).numpy()
    for load in np.linspace(0, alpha, max(6, math.ceil(4 * alpha)))[1:]:
        for _ in range(60):
            step = np.linalg.solve(slope(flat), -residual(flat, load))
            flat = flat + step * min(1.0, 0.02 / np.abs(step).max())
            if np.abs(step).max() < 1e-11:
                break
    assert np.abs(residual(flat, alpha)).max() < 1e-5
    tip = flat.reshape(n, 3)[-1]
    return float(tip[0]), float(1 + tip[2])


@pytest.mark.slow
@pytest.mark.parametrize("alpha", list(ELASTICA))
def test_elastica(alpha: float) -> None:
    w, u = cantilever(alpha, N_EDGES)
    assert w == pytest.approx(ELASTICA[alpha][0], rel=5e-3)
    assert u == pytest.approx(ELASTICA[alpha][1], rel=5e-3)


@pytest.mark.slow
def test_elastica_converges_at_second_order() -> None:
    exact = ELASTICA[2.0][0]
    errors = [abs(cantilever(2.0, n)[0] - exact) for n in (6, 12)]
    assert math.log2(errors[0] / errors[1]) > 1.8


def framed(n: int, axial: float) -> FramedRod:
    voronoi = torch.full((n,), 1 / n, dtype=torch.float64)
    voronoi[0] /= 2
    zero = torch.zeros(n, dtype=torch.float64)
    return FramedRod(axial, voronoi, torch.zeros(n, 2, dtype=torch.float64), zero)


@pytest.mark.parametrize("seed", [0, 5])
def test_twist_of_a_straight_tail_is_inert(seed: int) -> None:
    """With material frames the twist relaxes to zero from any start, and the forces are those without it."""
    x, down = random_tail(seed)
    n, axial = x.shape[0], 4 * 34.375**2
    material = framed(n, axial)
    straight = down.reshape(1, 3).expand(n, 3).clone()
    first = torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64)
    frames = Frames.along(straight, first)
    root_frame = Frames(down.reshape(1, 3), first.reshape(1, 3))
    nodes = x.reshape(n, 3)

    def energy(free: torch.Tensor, theta: torch.Tensor) -> torch.Tensor:
        nodes = torch.cat([torch.zeros(1, 3, dtype=free.dtype), free])
        return material.clamped_energy(nodes, theta, root_frame, frames)

    theta = torch.linspace(0.1, 1.5, n, dtype=torch.float64)
    assert float(energy(nodes, theta)) > float(elastic_energy(x, down, torch.tensor([axial]))) + 0.1
    for _ in range(2):  # quadratic in θ: one Newton step is exact
        slope = torch.func.grad(energy, 1)(nodes, theta)
        theta = theta - torch.linalg.solve(torch.func.hessian(energy, 1)(nodes, theta), slope)
    stiffness = torch.tensor([axial], dtype=torch.float64)
    forces = -torch.func.grad(energy)(nodes, theta)
    exact = -torch.func.grad(elastic_energy)(x, down, stiffness).reshape(n, 3)
    assert float(energy(nodes, theta)) == pytest.approx(float(elastic_energy(x, down, stiffness)), rel=1e-12)
    assert torch.allclose(forces, exact, atol=1e-8)


def ring_stability(twist: float, n: int) -> float:
    """Compute the smallest stiffness of a twisted ring against shapes out of its plane (beyond rigid motions)."""
    angle = 2 * math.pi * torch.arange(n, dtype=torch.float64) / n
    radius = 1 / n / (2 * math.sin(math.pi / n))
    nodes = radius * torch.stack([torch.cos(angle), torch.sin(angle), torch.zeros_like(angle)], 1)
    tangent = torch.roll(nodes, -1, 0) - nodes
    tangent = tangent / tangent.norm(dim=1, keepdim=True)
    up = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    weld = torch.zeros(n, dtype=torch.float64)
    weld[0] = -twist
    material = FramedRod(
        1e5, torch.full((n,), 1 / n, dtype=torch.float64), torch.zeros(n, 2, dtype=torch.float64), weld
    )
    frames = Frames(tangent, up.expand(n, 3).clone())
    theta = twist * torch.arange(n, dtype=torch.float64) / n

    def energy(flat: torch.Tensor) -> torch.Tensor:
        return material.ring_energy(flat[: 3 * n].reshape(n, 3), flat[3 * n :], frames)

    stiffness = torch.func.hessian(energy)(torch.cat([nodes.reshape(-1), theta]))
    # Condense the twist angles (their uniform shift is free), then look beyond the six rigid motions.
    inner = stiffness[3 * n :, 3 * n :]
    coupling = stiffness[3 * n :, : 3 * n]
    shape = stiffness[: 3 * n, : 3 * n] - coupling.T @ torch.linalg.pinv(inner, hermitian=True) @ coupling
    values = torch.linalg.eigvalsh((shape + shape.T) / 2)
    order = torch.argsort(values.abs())
    return float(values[order[6:]].min())


def test_twisted_ring_buckles_where_michell_found() -> None:
    """θ_c = 2π√3 EI/GJ; the ring's polygon approaches it at second order."""
    critical = 2 * math.pi * math.sqrt(3) * 1.5
    assert ring_stability(0.95 * critical, 36) > 0
    assert ring_stability(1.05 * critical, 36) < 0


def test_natural_curvature_is_the_shape_at_rest() -> None:
    """A rod bent to its natural curvature carries no moment."""
    n = 12
    bend = 0.08
    material = framed(n, 1e4)
    natural = torch.zeros(n, 2, dtype=torch.float64)
    angle = torch.arange(1, n + 1, dtype=torch.float64) * bend
    tangent = torch.stack([torch.sin(angle), torch.zeros_like(angle), -torch.cos(angle)], 1)
    natural[:, 0] = 2 * math.tan(bend / 2)
    down = torch.tensor([[0.0, 0.0, -1.0]], dtype=torch.float64)
    first = torch.tensor([[0.0, 1.0, 0.0]], dtype=torch.float64)
    frames = Frames(tangent, first.expand(n, 3).clone())
    nodes = torch.cat([torch.zeros(1, 3, dtype=torch.float64), torch.cumsum(tangent / n, 0)])
    energies = []
    for sign in (1.0, -1.0):
        for column in (0, 1):
            curved = torch.zeros_like(natural)
            curved[:, column] = sign * natural[:, 0]
            rod_of = FramedRod(1e4, material.voronoi, curved, material.natural_twist)
            theta = torch.zeros(n, dtype=torch.float64)
            energies.append(float(rod_of.clamped_energy(nodes, theta, Frames(down, first), frames)))
    assert min(energies) < 1e-12
    assert sorted(energies)[1] > 0.1
