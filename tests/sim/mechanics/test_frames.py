"""Tails with material frames: against Kirchhoff's rod, the framed rod by automatic differentiation, and power."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import torch
from scipy.integrate import solve_bvp
from torch.autograd.functional import hessian, jacobian

from sim.mechanics.balance import motion_at
from sim.mechanics.frames import add_frames
from sim.mechanics.geometry import measure, new_geometry
from sim.model.presets import PRESETS
from tests.oracles.framed_rod import FramedRod, Frames
from tests.sim.robots import control, extrapolated_loads, first_body, held_loads

ROBOT = PRESETS["paper-control"]
SLENDERNESS, OFFSET = ROBOT.tail_length / ROBOT.tail_radius, 0.016 / 0.11


def kirchhoff_loads(
    omega_bar: float, spin_drag: float, across: float, out: float, natural_twist: float
) -> np.ndarray:
    """Solve for the wrench of one filament on its held disc: Kirchhoff's rod as a boundary-value problem.

    r' = t (1 + F·t/EA),  frame' = κ × frame,  F' = −f,  M' = −r' × F − m,  M = (κ − κ⁰) + ⅔ twist;
    κ⁰ = out d2 − across d1 with d1 away from the axis at the clamp.
    """
    parallel = 2 * np.pi / (np.log(SLENDERNESS) - 0.5)
    perp = 4 * np.pi / (np.log(SLENDERNESS) + 0.5)
    roll = spin_drag * 4 * np.pi / SLENDERNESS**2
    solution = None
    for share in (0.25, 0.5, 0.75, 1.0):
        spin = np.array([0, 0, share * omega_bar])[:, None]

        def slope(_: np.ndarray, y: np.ndarray, spin: np.ndarray = spin) -> np.ndarray:
            r, t, d, F, M = y[:3], y[3:6], y[6:9], y[9:12], y[12:15]
            second_director = np.cross(t, d, axis=0)
            velocity = np.cross(spin, r, axis=0)
            f = -(parallel - perp) * (t * velocity).sum(0) * t - perp * velocity
            m = -roll * (spin * t).sum(0) * t
            twist = natural_twist + 1.5 * (M * t).sum(0)
            turn = (
                ((M * d).sum(0) - across) * d + ((M * second_director).sum(0) + out) * second_director + twist * t
            )
            tangent = t * (1 + (F * t).sum(0) * 0.25 / SLENDERNESS**2)
            turned = [np.cross(turn, t, axis=0), np.cross(turn, d, axis=0)]
            return np.vstack([tangent, *turned, -f, -np.cross(tangent, F, axis=0) - m])

        def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            return np.concatenate([a[:3] - [OFFSET, 0, 0], a[3:6] - [0, 0, -1], a[6:9] - [1, 0, 0], b[9:]])

        arc = np.linspace(0, 1, 101) if solution is None else solution.x
        start = np.zeros((15, len(arc))) if solution is None else solution.y
        if solution is None:
            start[0], start[2], start[5], start[6] = OFFSET, -arc, -1, 1
        solution = solve_bvp(slope, ends, arc, start, tol=1e-6, max_nodes=5000)
        assert solution.success
    force, moment = solution.y[9:12, 0], solution.y[12:15, 0]
    return np.array([force[2], (np.cross([OFFSET, 0, 0], force) + moment)[2]])


@pytest.mark.parametrize(
    ("effects", "spin", "across", "out"),
    [
        ({}, 0.0, 0.0, 0.0),
        ({"tail_spin_drag": 1.0}, 1.0, 0.0, 0.0),
        ({"natural_curvature": 0.5}, 0.0, 0.5, 0.0),
        ({"natural_splay": -0.5}, 0.0, 0.0, -0.5),
        ({"tail_spin_drag": 1.0, "natural_curvature": -0.6, "natural_splay": 0.3}, 1.0, -0.6, 0.3),
        ({"natural_splay": 0.5, "natural_twist": 2.0}, 0.0, 0.0, 0.5),
    ],
)
def test_thrust_and_moment_of_framed_filaments(
    effects: dict[str, float], spin: float, across: float, out: float
) -> None:
    omega_bar = 8.0 * ROBOT.time_scale
    twist = effects.get("natural_twist", 0.0)
    found = extrapolated_loads(omega_bar, SLENDERNESS, OFFSET, **effects)
    assert found[[1, 3]] == pytest.approx(kirchhoff_loads(omega_bar, spin, across, out, twist), rel=1e-3)


def tail_forces(
    effects: dict[str, float], x: np.ndarray, x_dot: np.ndarray, natural_twist: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Compute edge forces (n, 3) and further clamp moment (3,) of one tail whose disc stands still."""
    body = first_body(control(1, N=1, natural_twist=natural_twist, **effects))
    n = len(x)
    geometry, moments = new_geometry(np.empty(0), n, 1), np.zeros((1, 3))
    measure(geometry, x[:, None], body.offset, body.axial_stiffness)
    motion = motion_at(body, np.array([0.0, 0.0, 0.0, -body.omega]), 0.0)
    add_frames(body, geometry, motion, 0, x_dot[:, None], moments)
    return geometry.force[:, 0], moments[0]


def bent(n: int, seed: int = 0) -> np.ndarray:
    """Bend a tail out of a plane: free nodes (n, 3)."""
    rng = np.random.default_rng(seed)
    edges = np.array([0.0, 0.0, -1.0]) + np.cumsum(0.25 * rng.normal(size=(n, 3)), 0)
    lengths = (1 + 0.01 * rng.normal(size=(n, 1))) / n
    return np.array([1 / 6.875, 0, 0]) + np.cumsum(edges / np.linalg.norm(edges, axis=1)[:, None] * lengths, 0)


def test_forces_are_those_of_the_framed_rod() -> None:
    """Energy with frames carried by parallel transport in time, differentiated automatically, θ in balance."""
    n, across, out, twist = 7, 0.8, -0.5, 1.1
    x = bent(n)
    force, _ = tail_forces({"natural_curvature": across, "natural_splay": out}, x, np.zeros_like(x), twist)
    weight = torch.full((n,), 1 / n, dtype=torch.float64)
    weight[0] = 0.5 / n
    rod = FramedRod(
        4 * 34.375**2, weight, torch.tensor([[out, across]]).double() * weight[:, None], twist * weight
    )
    clamp, free = torch.tensor([[1 / 6.875, 0.0, 0.0]]).double(), torch.as_tensor(x)
    edge = torch.diff(torch.cat([clamp, free]), dim=0)
    tangent = edge / edge.norm(dim=-1, keepdim=True)
    root = Frames(torch.tensor([[0.0, 0.0, -1.0]]).double(), torch.tensor([[1.0, 0.0, 0.0]]).double())
    frames = Frames.along(torch.cat([root.tangent, tangent]), root.director[0])
    frames = Frames(frames.tangent[1:], frames.director[1:])

    def energy(free: torch.Tensor, theta: torch.Tensor) -> torch.Tensor:
        return rod.clamped_energy(torch.cat([clamp, free]), theta, root, frames)

    theta = torch.zeros(n, dtype=torch.float64)
    for _ in range(10):
        by_theta = jacobian(partial(energy, free), theta)
        curvature = hessian(partial(energy, free), theta)
        theta = theta - torch.linalg.solve(curvature, by_theta)
    assert by_theta.abs().max() < 1e-9
    assert torch.linalg.eigvalsh(curvature).min() > 0
    on_nodes = -force
    on_nodes[:-1] += force[1:]
    found = -jacobian(lambda free: energy(free, theta), free).numpy()
    assert found == pytest.approx(on_nodes, abs=1e-6 * np.abs(on_nodes).max())


def test_the_rod_puts_no_force_and_no_moment_on_itself() -> None:
    """Forces of all edges on nodes and disc cancel, and so do their moments."""
    x = bent(9, seed=3)
    x_dot = np.random.default_rng(4).normal(size=x.shape)
    effects = {"natural_curvature": 0.4, "natural_splay": 0.7, "rate_dependent_modulus": 0.3}
    with_, moment = tail_forces(effects, x, x_dot, natural_twist=2.0)
    without, _ = tail_forces({}, x, x_dot)
    nodes = np.concatenate([[[1 / 6.875, 0, 0]], x])
    force = with_ - without
    assert np.cross(np.diff(nodes, axis=0), force).sum(0) == pytest.approx(moment, abs=1e-9)


def test_bending_viscosity_takes_power_and_gives_none() -> None:
    """Power = η Σ |κ̇|²/l_k; a turn of the whole tail, clamp and all, costs none."""
    for seed in range(5):
        x = bent(8, seed)
        x_dot = np.random.default_rng(seed).normal(size=x.shape)
        viscous = tail_forces({"rate_dependent_modulus": 0.3}, x, x_dot)[0] - tail_forces({}, x, x_dot)[0]
        rates = np.diff(np.concatenate([np.zeros((1, 3)), x_dot]), axis=0)
        assert (viscous * rates).sum() > 0
    straight = np.array([1 / 6.875, 0, 0]) + np.outer(np.arange(1, 9) / 8, [0, 0, -1.0])
    swing = np.zeros_like(straight)
    swing[:, 0] = -straight[:, 2] * 0.1
    hinge = tail_forces({"rate_dependent_modulus": 0.3}, straight, swing)[0] - tail_forces({}, straight, swing)[0]
    assert np.abs(hinge[1:]).max() < 1e-12  # only the joint at the clamp bends
    assert hinge[0, 0] == pytest.approx(0.3 * 16 * 8 * 0.1, rel=1e-9)  # η w κ̇/|e|, κ̇ = 0.1


def test_a_natural_arc_is_what_a_free_tail_takes() -> None:
    """A motor that hardly turns leaves the tail on its natural arc of angle ε, against the turn of the disc."""
    _, x = held_loads(1e-4, SLENDERNESS, OFFSET, edges=24, natural_curvature=0.5)
    assert x[-1] == pytest.approx([OFFSET, -2 * (1 - np.cos(0.5)), -2 * np.sin(0.5)], abs=2e-4)
