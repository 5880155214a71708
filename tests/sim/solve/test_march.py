"""Time steps: balance at every instant, second order, and robots that break down."""

from __future__ import annotations

import numpy as np
import pytest

from sim.mechanics.balance import motion_at
from sim.model.body import Body
from sim.motion.shapes import state_from_orbit
from sim.solve.march import PHASE, TOLERANCE, State, advance, new_state
from sim.solve.rates import FIRST_PHASE
from sim.solve.refinement import PHASES, SOLVED, refined_orbit
from sim.solve.residual import fluid_forces
from tests.oracles.clamped_rod import ClampedRod, dead_load
from tests.sim.robots import CONTROL_VALUES, control, first_body


def unbalanced(body: Body, state: State) -> tuple[float, float]:
    """Sum the forces on each free node, and those of the fluid and of loads on the whole robot.

    The rod's forces are those of an energy, without the compiled loops. Returns the largest of each, over the
    largest force.
    """
    phase, (n, tails, _) = float(state.pose[PHASE]), state.x.shape
    forces, on_head = fluid_forces(body, state.x, state.x_dot, state.u, phase)
    rod, root, total, worst = (
        ClampedRod(n, CONTROL_VALUES["l_over_r0"]),
        [body.offset, 0.0, 0.0],
        on_head.copy(),
        0.0,
    )
    cells = np.full(n + 1, 1 / n)
    cells[[0, -1]] /= 2
    for m in range(tails):
        motion = motion_at(body, state.u, phase + 2 * np.pi * m / tails)
        x, loads = state.x[:, m], cells[:, None] * motion.load
        on_nodes = forces[1:, m] + loads[1:] + rod.forces(x - root, dead_load(0, 0, 0))
        worst = max(worst, np.abs(on_nodes).max())
        acting = forces[:, m] + loads
        force, moment = acting.sum(0), np.cross(np.concatenate([[root], x]), acting).sum(0)
        total += [motion.e_x @ force, force[2], motion.e_y @ moment, moment[2]]
    return worst / np.abs(forces).max(), np.abs(total).max() / np.abs(forces).max()


@pytest.mark.parametrize(("tails", "omega"), [(1, 3.0), (2, 40.0), (5, -60.0)])
def test_all_forces_vanish_in_the_middle_of_a_transient(tails: int, omega: float) -> None:
    """With motor droop, drag on the disc and loads."""
    body = first_body(control(N=tails, omega_bar=omega, C_yr=5.0))
    body.resistance[3, 4] = 0.02
    body = body._replace(droop=0.2 / body.resistance[3, 3], tail_load=(0.3, -0.6, 0.2))
    state = new_state(tails, 10, body.offset)
    assert advance(body, state, 0.15 / abs(omega), 15, 1e-12).solved
    on_node, on_robot = unbalanced(body, state)
    assert on_node < 1e-8
    assert on_robot < 1e-8


@pytest.mark.parametrize("tails", [1, 2, 3, 5])
def test_all_forces_vanish_on_an_orbit(tails: int) -> None:
    body = first_body(control(N=tails, omega_bar=-40.0, C_yr=5.0))
    orbit = refined_orbit(body, tails, PHASES)
    assert orbit.status == SOLVED
    on_node, on_robot = unbalanced(body, state_from_orbit(body, orbit.x[2], orbit.u[2], FIRST_PHASE))
    assert on_node < 1e-5
    assert on_robot < 1e-5


def test_steps_are_of_second_order() -> None:
    body, ends = first_body(control()), []
    for count in (20, 40, 80):
        ends.append(advance(body, new_state(2, 8, body.offset), 0.4 / count, count, 1e-10).poses[-1])
    ratio = np.abs(ends[0] - ends[1]).max() / np.abs(ends[1] - ends[2]).max()
    assert 3 < ratio < 5.5


def test_a_step_that_breaks_down_is_reported() -> None:
    body = first_body(control())._replace(zeta_parallel=np.nan)
    state = new_state(2, 8, body.offset)
    assert not advance(body, state, 0.01, 3, TOLERANCE).solved
