"""One clamped rotating filament against its boundary-value solution, linear theory and beam theory."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from sim.mechanics.drag import tail_coefficients
from sim.model.presets import PRESETS
from sim.reference.balance import TensorRobots, fluid_wrench
from sim.reference.stepper import PHASE, TensorState, at_rest, step
from sim.solve.orbit import FIRST_PHASE, solve_orbit, straight_start
from tests.reference.cases import BEAM_K4, FILAMENT, FILAMENT_TIP, LINEAR_FILAMENT
from tests.sim.robots import extrapolated_loads, first_body, held_loads, single_filament

ROBOT = PRESETS["paper-control"]
SLENDERNESS, OFFSET = ROBOT.tail_length / ROBOT.tail_radius, 0.016 / 0.11


def relaxed(robots: TensorRobots, omega_bar: float, *, time: float = 2.0) -> TensorState:
    """Relax to the shape at rest in the disc frame, for eight times of the slowest mode."""
    omega = torch.tensor([omega_bar], dtype=torch.float64)
    state = at_rest(robots)
    dt = torch.tensor([min(0.05, 0.25 / omega_bar)], dtype=torch.float64)
    while float(state.time) < time:
        state = step(robots, state, omega, dt)
    return step(robots, state, omega, dt, tolerance=1e-11)


def loads(edges: int) -> tuple[float, float]:
    """Compute |F_z| [N] and |M_z| [N m] of the fluid on the filament at 8 rad/s, by time steps."""
    omega_bar = 8.0 * ROBOT.time_scale
    robots, _ = single_filament(edges, omega_bar, SLENDERNESS, OFFSET)
    tail = tail_wrench(robots, relaxed(robots, omega_bar), omega_bar)
    force = ROBOT.bending_stiffness / ROBOT.tail_length**2
    return abs(float(tail[1])) * force, abs(float(tail[3])) * force * ROBOT.tail_length


def tail_wrench(robots: TensorRobots, state: TensorState, omega_bar: float) -> torch.Tensor:
    """Compute the wrench of the fluid on a tail at rest in the disc frame."""
    bar = torch.tensor([omega_bar], dtype=torch.float64)
    return fluid_wrench(robots, state.x, torch.zeros_like(state.x), state.pose[PHASE], state.u, bar)[0]


@pytest.mark.parametrize("omega", list(FILAMENT))
def test_force_and_moment_match_the_boundary_value_solution(omega: float) -> None:
    """The direct route, as it solves by default: within 0.1 %."""
    wrench = extrapolated_loads(omega * ROBOT.time_scale, SLENDERNESS, OFFSET)
    force = ROBOT.bending_stiffness / ROBOT.tail_length**2
    assert abs(wrench[1]) * force == pytest.approx(FILAMENT[omega][0], rel=1e-3)
    assert abs(wrench[3]) * force * ROBOT.tail_length == pytest.approx(FILAMENT[omega][1], rel=1e-3)


def test_the_filament_s_tip() -> None:
    _, x = held_loads(8.0 * ROBOT.time_scale, SLENDERNESS, OFFSET, edges=32)
    assert np.abs(x[-1]) == pytest.approx(np.abs(FILAMENT_TIP), abs=2e-4)


def test_a_slow_tail_sags_like_a_cantilever_at_every_phase() -> None:
    """q l⁴/(8 EI), downwards in the body frame, while the tail turns with the disc."""
    _, groups = single_filament(2, 1e-5, SLENDERNESS, 0.1)
    body = first_body(groups)
    body.resistance[:, :4] += 1e9 * np.eye(4)
    body = body._replace(tail_load=(0.0, -0.08, 0.0))
    x, u = straight_start(body, 32, 6, 1)
    u[:] = 0.0
    _, size = solve_orbit(body, x, u, 1e-9)
    assert size < 1e-9
    for m in range(6):
        phase = FIRST_PHASE + 2 * np.pi * m / 6
        tip = x[-1, m] - np.array([body.offset, 0.0, -1.0])
        down = -(np.sin(phase) * tip[0] + np.cos(phase) * tip[1])
        across = np.cos(phase) * tip[0] - np.sin(phase) * tip[1]
        assert down == pytest.approx(0.01, rel=2e-3)
        assert abs(across) < 1e-6


@pytest.mark.slow
def test_time_stepping_reaches_the_same_loads_at_second_order_in_edges() -> None:
    """Differences between successive meshes fall by four."""
    found = np.array([loads(edges) for edges in (4, 8, 16)])
    assert found[2, 0] == pytest.approx(FILAMENT[8.0][0], rel=6e-3)
    assert found[2, 1] == pytest.approx(FILAMENT[8.0][1], rel=1e-3)
    assert (np.log2((found[0] - found[1]) / (found[1] - found[2])) > 1.8).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "drag_number", [1.0, 30.0, *(pytest.param(S, marks=pytest.mark.rest) for S in (10.0, 100.0))]
)
def test_thrust_matches_linear_theory(drag_number: float) -> None:
    """A small offset a: thrust/[(ζ⊥ − ζ∥) ω a²] and tip offset/a depend on S = ζ⊥ ω alone."""
    offset, slenderness = 1e-3, 34.375
    parallel, perp = (v.item() for v in tail_coefficients(np.array([slenderness])))
    omega = drag_number / perp
    robots, _ = single_filament(24, omega, slenderness, offset)
    state = relaxed(robots, omega)
    tail = tail_wrench(robots, state, omega)
    thrust = abs(float(tail[1])) / ((perp - parallel) * omega * offset**2)
    reach = math.hypot(float(state.x[-1, 0]), float(state.x[-1, 1])) / offset
    assert thrust == pytest.approx(LINEAR_FILAMENT[drag_number][0], rel=0.02, abs=2e-3)
    assert reach == pytest.approx(LINEAR_FILAMENT[drag_number][1], rel=0.01)


def test_a_bent_tail_relaxes_at_the_rate_of_the_first_mode() -> None:
    """Clamped-free beam in a viscous fluid: amplitude decays as exp(−k⁴ t/ζ⊥)."""
    slenderness = 34.375
    robots, _ = single_filament(24, 1e-9, slenderness, 0.1)
    perp = float(robots.body.zeta_perp)
    k = BEAM_K4[0] ** 0.25
    arc = torch.arange(1, 25, dtype=torch.float64) / 24
    ratio = (math.sinh(k) - math.sin(k)) / (math.cosh(k) + math.cos(k))
    mode = torch.cosh(k * arc) - torch.cos(k * arc) - ratio * (torch.sinh(k * arc) - torch.sin(k * arc))
    state = at_rest(robots)
    state.x[:, 1, 0, 0] += 1e-4 * mode
    omega, dt = torch.tensor([1e-9], dtype=torch.float64), torch.tensor([0.002], dtype=torch.float64)
    tips = []
    for _ in range(100):
        state = step(robots, state, omega, dt, tolerance=1e-10)
        tips.append(float(state.x[-1, 1]))
    rate = math.log(tips[19] / tips[99]) / (80 * 0.002)
    assert rate == pytest.approx(BEAM_K4[0] / perp, rel=0.01)


def test_a_stiff_tail_is_a_rigid_rod() -> None:
    """A tail clamped across the axis and turned slowly about its root: torque ζ⊥ ω l³/3."""
    slenderness, omega = 34.375, 1e-4
    robots, _ = single_filament(48, omega, slenderness, 1e-9)
    across = torch.zeros_like(robots.root_tangent)
    across[:, 0] = 1.0
    robots = replace(robots, root_tangent=across)
    tail = tail_wrench(robots, relaxed(robots, omega, time=1.0), omega)
    assert abs(float(tail[3])) == pytest.approx(float(robots.body.zeta_perp) * omega / 3, rel=1e-3)
