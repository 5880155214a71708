"""Discrete elastic rod: derivatives, elastica, buckling, whirling, and the twist that may be condensed out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import torch
from scipy.optimize import brentq
from torch.autograd.functional import hessian

from sim.mechanics import rod
from sim.mechanics.geometry import measure, new_geometry
from tests.oracles.clamped_rod import DOWN, ClampedRod, dead_load
from tests.oracles.framed_rod import FramedRod, Frames
from tests.oracles.twirled_rod import whirling
from tests.reference.cases import ELASTICA

NO_LOAD = dead_load(0, 0, 0)


def random_tail(seed: int, n: int = 8) -> np.ndarray:
    """Draw a bent, slightly stretched tail, (n, 3)."""
    rng = np.random.default_rng(seed)
    steps = 0.35 * rng.normal(size=(n, 3)) + DOWN
    stretch = 1 + 0.02 * rng.normal(size=(n, 1))
    return np.cumsum(steps / np.linalg.norm(steps, axis=1)[:, None] * stretch / n, 0)


@pytest.mark.parametrize("seed", [0, 2])
def test_forces_are_the_derivatives_of_the_energy(seed: int) -> None:
    """Those of the formulas of one node, and those that the compiled loop sums up."""
    tail, x = ClampedRod(8, 34.375), random_tail(seed)
    steps = x[..., None] + 1e-30j * np.eye(x.size).reshape(*x.shape, x.size)
    exact = -tail.energy(steps).imag.reshape(x.shape) / 1e-30
    assert tail.forces(x, NO_LOAD) == pytest.approx(exact, rel=1e-10, abs=1e-8)
    geometry = new_geometry(np.empty(0), 8, 1)
    measure(geometry, x[:, None], 0.0, tail.axial_stiffness)
    carried = geometry.force[:, 0]
    assert np.concatenate([carried[1:], np.zeros((1, 3))]) - carried == pytest.approx(exact, rel=1e-10, abs=1e-8)
    slope = tail.slope(x, NO_LOAD)
    assert slope == pytest.approx(slope.T, abs=1e-9 * np.abs(slope).max())


def test_clamp_moment_balances_the_tail() -> None:
    """Turning tail and clamp together costs nothing: inner forces and clamp moment have no net moment."""
    tail, x = ClampedRod(8, 31.6), random_tail(3)
    before, after, length_before, length, weight = tail.measured(x)
    _, first, *_ = rod.bend(before, after, length_before, length, weight)
    forces = tail.forces(x, NO_LOAD)
    clamp = rod.clamp_moment((0.0, 0.0, -1.0), (after[0][0], after[1][0], after[2][0]), first[0])
    assert np.abs(np.cross(x, forces).sum(0) + clamp).max() < 1e-9 * np.abs(forces).max()


def cantilever(load: float, n: int) -> tuple[float, float]:
    """Compute deflection and shortening of a cantilever under a dead load at its tip."""
    at_tip = np.zeros((n, 3))
    at_tip[-1, 1] = 2 * n * load

    def force(tangents: Any) -> Any:
        return 0 * tangents + at_tip.reshape(n, 3, *[1] * (tangents.ndim - 2))

    tip = ClampedRod(n).balanced(force, np.linspace(0.1, 1, 10).tolist())[-1]
    return float(tip[1]), float(1 + tip[2])


@pytest.mark.parametrize("load", ELASTICA)
def test_elastica(load: float) -> None:
    assert cantilever(load, 16) == pytest.approx(ELASTICA[load], rel=5e-3)


def test_elastica_converges_at_second_order() -> None:
    errors = [abs(cantilever(2.0, n)[0] - ELASTICA[2.0][0]) for n in (6, 12)]
    assert math.log2(errors[0] / errors[1]) > 1.8


def test_a_column_buckles_under_its_weight_where_greenhill_found() -> None:
    def critical(n: int) -> float:
        return float(brentq(lambda weight: ClampedRod(n).least_stiffness(dead_load(0, 0, weight)), 6, 9))

    assert (4 * critical(16) - critical(8)) / 3 == pytest.approx(7.8373, rel=1e-3)


def test_a_follower_load_makes_a_rod_swing_in_a_viscous_fluid() -> None:
    """−h'''' − σ (1 − s) h'' = ζ⊥ λ h begins to grow at σ = 76.1, and it swings there."""

    def fastest(n: int, load: float) -> complex:
        def follower(tangents: Any) -> Any:
            return -load * tangents

        rates = ClampedRod(n).growths(follower)
        return complex(rates[np.argmax(rates.real)])

    coarse, fine = (float(brentq(lambda f, n=n: fastest(n, f).real, 60, 90, xtol=1e-4)) for n in (8, 16))
    assert (4 * fine - coarse) / 3 == pytest.approx(76.1, rel=3e-3)
    assert abs(fastest(16, fine).imag) > 10


def test_a_twirled_rod_whirls_where_linear_theory_says() -> None:
    """Growth, twist and spin drag together: ω ξ_r l²/EI = 8.865 and χ ζ⊥ l⁴/EI = 22.85."""
    coarse, fine = (np.array(whirling(n)) for n in (8, 16))
    assert (4 * fine - coarse) / 3 == pytest.approx([8.865, 22.85], rel=5e-3)


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
