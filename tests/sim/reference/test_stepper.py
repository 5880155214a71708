"""Steps with tensors: balance, order, the compiled steps, and robots that break down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from sim.linear.spectral import differentiation
from sim.reference.balance import fluid_wrench, newton_correction, tensor_robots
from sim.reference.banded import BlockBanded
from sim.reference.stepper import PHASE, at_rest, step
from sim.solve.march import TOLERANCE, advance, new_state
from sim.solve.orbit import FIRST_PHASE
from sim.solve.refinement import FEW, SOLVED, refined_orbit
from tests.sim.robots import control, first_body


@pytest.mark.parametrize("tails", [1, 5])
def test_total_force_and_moment_vanish_to_round_off(tails: int) -> None:
    """Also in the middle of a transient, where nothing is steady."""
    groups = control(3, N=tails, omega_bar=[3.0, 10.0, -60.0])
    robots = tensor_robots(groups, edges=12)
    state = at_rest(robots)
    dt = torch.full((3,), 0.004, dtype=torch.float64)
    for _ in range(12):
        state = step(robots, state, robots.body.omega, dt, tolerance=1e-12)
    tail, head = fluid_wrench(robots, state.x, state.x_dot, state.pose[PHASE], state.u, robots.body.omega)
    assert (tail + head).abs().max() < 1e-11 * tail.abs().max()
    assert tail.abs().max() > 0.1


@pytest.mark.parametrize(("tails", "omega"), [(1, 8.0), (2, 40.0), (5, -15.0)])
def test_compiled_steps_equal_steps_with_tensors(tails: int, omega: float) -> None:
    """The same scheme on the same equations, from rest, with motor droop, drag on the disc and loads."""
    groups, steps, edges = control(N=tails, omega_bar=omega, C_yr=5.0), 15, 10
    robots = tensor_robots(groups, edges=edges)
    load = torch.tensor([[0.3], [-0.6], [0.2]], dtype=torch.float64)
    droop = 0.2 / robots.body.resistance[3, 3]
    robots = replace(robots, body=robots.body._replace(droop=droop, tail_load=load))
    robots.body.resistance[3, 4] = 0.02
    body = first_body(groups)
    body.resistance[3, 4] = 0.02
    body = body._replace(droop=float(droop), tail_load=(0.3, -0.6, 0.2))
    dt = 0.15 / abs(omega)
    state, poses = new_state(tails, edges, body.offset), np.empty((steps, 6))
    assert advance(body, state, dt, steps, 1e-10, poses, np.empty((0, *state.x.shape)))
    tensors = at_rest(robots)
    for i in range(steps):
        tensors = step(
            robots, tensors, robots.body.omega, torch.tensor([dt], dtype=torch.float64), tolerance=1e-10
        )
        assert poses[i] == pytest.approx(tensors.pose[:, 0].numpy(), rel=1e-8, abs=1e-10)
    assert state.u == pytest.approx(tensors.u[:, 0].numpy(), rel=1e-8, abs=1e-9)
    assert state.x[:, 0] == pytest.approx(tensors.x[:, :, 0, 0].numpy(), abs=1e-9)


def test_a_step_that_breaks_down_is_reported() -> None:
    body = first_body(control())._replace(zeta_parallel=np.nan)
    state = new_state(2, 8, body.offset)
    steps = np.empty((3, 6))
    assert not advance(body, state, 0.01, 3, TOLERANCE, steps, np.empty((0, *state.x.shape)))


@pytest.mark.parametrize("tails", [1, 2, 3, 5])
def test_tensors_find_the_compiled_orbit_in_balance(tails: int) -> None:
    """At every phase, all N tails in place: no net wrench, and a Newton correction that changes nothing."""
    groups = control(N=tails, omega_bar=-40.0, C_yr=5.0)
    orbit = refined_orbit(first_body(groups), tails, FEW)
    assert orbit.ended == SOLVED
    x, u = orbit.x[2], orbit.u[2]
    n, phases, _ = x.shape
    derivative = np.einsum("ml,klc->kmc", differentiation(phases), x)
    instants = torch.zeros(phases // tails, dtype=torch.long)
    robots = tensor_robots(groups, edges=n).select(instants)
    shape = np.empty((n, 3, tails, len(instants)))
    rate = np.empty_like(shape)
    for j in range(tails):
        later = (np.arange(len(instants)) + j * len(instants)) % phases
        angle = 2 * np.pi * j / tails
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        shape[:, :, j] = np.einsum("ab,kmb->kam", turn, x[:, later])
        rate[:, :, j] = np.einsum("ab,kmb->kam", turn, derivative[:, later])
    omega = robots.body.omega
    velocity = torch.tensor(u.T)
    x_dot = torch.tensor(rate) * robots.omega_t(velocity, omega)
    phase = torch.tensor(FIRST_PHASE + 2 * np.pi * np.arange(len(instants)) / phases)
    balanced = (robots, torch.tensor(shape), x_dot, phase, velocity, omega)
    on_tails, on_head = fluid_wrench(*balanced)
    assert (on_tails + on_head).abs().max() < 1e-6 * on_tails.abs().max()
    dx, du = newton_correction(*balanced, torch.full_like(omega, 1e3))
    assert dx.abs().max() < 1e-7
    assert du.abs().max() < 1e-6


@pytest.mark.parametrize("n", [3, 8])
def test_banded_and_dense_solves_agree(n: int) -> None:
    generator = torch.Generator().manual_seed(n)

    def noise(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    batch = (2, 3)
    blocks = {m: noise(n - abs(m), 3, 3, *batch) for m in range(-2, 3)}
    blocks[0] += 30 * torch.eye(3, dtype=torch.float64).reshape(3, 3, 1, 1)
    r, border, foot = noise(n, 3, *batch), noise(4, n, 3, *batch), noise(4, 6, *batch)
    corner = noise(4, 4, 3) + 20 * torch.eye(4, dtype=torch.float64).unsqueeze(-1)
    s = noise(4, 3)
    answers = []
    for dense in (True, False):
        matrix = BlockBanded(n, batch, r, dense=dense)
        for m, block in blocks.items():
            matrix.diagonal(m).add_(block)
        answers.append(matrix.solve_bordered(r, border, foot, corner, s))
    for a, b in zip(*answers, strict=True):
        assert torch.allclose(a, b, rtol=1e-10, atol=1e-12)
