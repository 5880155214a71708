"""Discrete elastic rod: derivatives, elastica, and the twist that may be condensed out."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from torch.autograd.functional import hessian, jacobian

from sim.reference import elastic
from sim.reference.framed_rod import FramedRod, Frames
from tests.reference.cases import ELASTICA


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


@pytest.mark.parametrize("seed", [0, 2])
def test_forces_and_stiffness_are_the_derivatives_of_the_energy(seed: int) -> None:
    x, down = random_tail(seed)
    n = x.shape[0]
    stiffness = torch.tensor([4 * 34.375**2], dtype=torch.float64)
    exact = -jacobian(lambda x: elastic_energy(x, down, stiffness), x)
    response = elastic.respond(elastic.geometry(torch.cat([torch.zeros_like(down), x]), down), stiffness)
    forces = elastic.node_forces(response.edge_force)
    assert torch.allclose(forces, exact, rtol=1e-10, atol=1e-8)

    def edge_energy(edges: torch.Tensor) -> torch.Tensor:
        return elastic_energy(torch.cumsum(edges, 0), down, stiffness)

    edges = torch.diff(torch.cat([torch.zeros_like(down), x]), dim=0)
    blocks = hessian(edge_energy, edges).reshape(n, 3, n, 3)
    for j in range(n):
        assert torch.allclose(response.stiffness.diagonal[j, :, :, 0, 0], blocks[j, :, j], atol=1e-7)
    for j in range(n - 1):
        assert torch.allclose(response.stiffness.upper[j, :, :, 0, 0], blocks[j, :, j + 1], atol=1e-7)


def test_clamp_moment_balances_the_tail() -> None:
    """Turning tail and clamp together costs nothing: inner forces and clamp moment have no net moment."""
    x, down = random_tail(3)
    response = elastic.respond(
        elastic.geometry(torch.cat([torch.zeros_like(down), x]), down), torch.tensor([4000.0], dtype=torch.float64)
    )
    forces = elastic.node_forces(response.edge_force)
    moment = torch.linalg.cross(x, forces, dim=1).sum(0) + response.clamp_moment
    assert moment.abs().max() < 1e-9 * forces.abs().max()


def cantilever(loads: list[float], n: int) -> list[tuple[float, float]]:
    """Compute deflection and shortening of a cantilever under dead tip loads, which grow."""
    stiffness = torch.tensor([4 * 500.0**2], dtype=torch.float64)
    down = torch.tensor([0.0, 0.0, -1.0], dtype=torch.float64).reshape(1, 3, 1, 1)
    difference = np.kron(np.eye(n) - np.eye(n, k=-1), np.eye(3))  # of nodes, to edges

    def forces_and_slope(x: np.ndarray, load: float) -> tuple[np.ndarray, np.ndarray]:
        nodes = torch.cat([torch.zeros_like(down), torch.tensor(x).reshape(n, 3, 1, 1)])
        response = elastic.respond(elastic.geometry(nodes, down), stiffness)
        force = elastic.node_forces(response.edge_force)
        force[-1, 0] += load
        blocks = np.zeros((n, 3, n, 3))
        for j in range(n):
            blocks[j, :, j] = response.stiffness.diagonal[j, :, :, 0, 0]
            if j < n - 1:
                blocks[j, :, j + 1] = response.stiffness.upper[j, :, :, 0, 0]
                blocks[j + 1, :, j] = blocks[j, :, j + 1].T
        return force.reshape(-1).numpy(), -difference.T @ blocks.reshape(3 * n, 3 * n) @ difference

    x = np.zeros((n, 3))
    x[:, 2] = -np.arange(1, n + 1) / n
    x, found, before = x.reshape(-1), [], 0.0
    for load in loads:
        for part in np.linspace(before, load, max(6, math.ceil(4 * (load - before))))[1:]:
            for _ in range(60):
                force, slope = forces_and_slope(x, part)
                step = np.linalg.solve(slope, -force)
                x = x + step * min(1.0, 0.02 / np.abs(step).max())
                if np.abs(step).max() < 1e-11:
                    break
        assert np.abs(forces_and_slope(x, load)[0]).max() < 1e-5
        found.append((float(x[-3]), float(1 + x[-1])))
        before = load
    return found


@pytest.mark.slow
def test_elastica() -> None:
    found = cantilever(sorted(ELASTICA), 16)
    assert found == [pytest.approx(ELASTICA[load], rel=5e-3) for load in sorted(ELASTICA)]


@pytest.mark.slow
def test_elastica_converges_at_second_order() -> None:
    errors = [abs(cantilever([2.0], n)[0][0] - ELASTICA[2.0][0]) for n in (6, 12)]
    assert math.log2(errors[0] / errors[1]) > 1.8


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

    stiffness = hessian(energy, torch.cat([nodes.reshape(-1), theta]))
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
