"""Newton's method on an orbit and in a stage, and time steps: the matrix is the derivative, and forces balance.

A wrong matrix is only slower, so the numbers of corrections are held to what quadratic convergence gives.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sim.effects import catalogue
from sim.linear.chains import Chains
from sim.linear.spectral import differentiation
from sim.mechanics.balance import motion_at
from sim.model.body import Body
from sim.motion.shapes import state_from_orbit
from sim.solve.march import PHASE, TOLERANCE, State, new_state
from sim.solve.rates import FIRST_PHASE
from sim.solve.refinement import PHASES, SOLVED, refined_orbit
from sim.solve.residual import fluid_forces
from tests.oracles.clamped_rod import ClampedRod, dead_load
from tests.sim import lanes
from tests.sim.lanes import Plain, corrections, linear
from tests.sim.robots import CONTROL_VALUES, advance, control, first_body, straight_start

Unknowns = tuple[np.ndarray, np.ndarray]


def strange(tails: int) -> Body:
    """Make a robot with every local number in play: motor droop, drag on the disc, loads, odd resistances."""
    body = first_body(control(N=tails, omega_bar=12.0, C_yr=6.0))
    body.resistance[:] += 0.3 * np.random.default_rng(0).normal(size=(4, 5))
    return body._replace(droop=0.3 / body.resistance[3, 3], tail_load=(0.2, -0.5, 0.1))


def somewhere(body: Body, tails: int, phases: int, n: int) -> Unknowns:
    """Return bent tails and unsteady velocities."""
    rng = np.random.default_rng(1)
    x, u = straight_start(body, n, phases, tails)
    return x + 0.02 * rng.normal(size=x.shape), u + rng.normal(size=u.shape)


def on_orbit(phases: int) -> Plain:
    return Plain(0.0, FIRST_PHASE, differentiation(phases), np.empty((0, 0, 0)))


def orbit_case() -> tuple[Body, Plain, Unknowns]:
    body = strange(2)
    return body, on_orbit(6), somewhere(body, 2, 6, 4)


def stage_case() -> tuple[Body, Plain, Unknowns]:
    body = strange(3)
    x, u = somewhere(body, 3, 3, 5)
    start = x + 0.01 * np.random.default_rng(2).normal(size=x.shape)
    return body, Plain(40.0, 0.7, np.zeros((0, 0)), start), (x, u)


def transient_case() -> tuple[Body, Plain, Unknowns]:
    body = strange(2)
    x, u = somewhere(body, 2, 6, 4)
    start = x + 0.01 * np.random.default_rng(2).normal(size=x.shape)
    return body, Plain(30.0, FIRST_PHASE, differentiation(x.shape[1]), start), (x, u)


def residual(body: Body, rates: Plain, z: np.ndarray, like: Unknowns, noise: float = 0.0) -> np.ndarray:
    x, u = z[: like[0].size].reshape(like[0].shape), z[like[0].size :].reshape(like[1].shape)
    return np.concatenate([part.ravel() for part in lanes.residual(body, rates, x, u, noise)])


def dense_matrix(chains: Chains) -> np.ndarray:
    """Assemble the matrix in (n, M, 3) and (P, 4), flattened; column m belongs to instant m mod P."""
    n, count = chains.diagonal.shape[:2]
    instants = len(chains.corner)
    nodes = 3 * n * count
    matrix = np.zeros((nodes + 4 * instants, nodes + 4 * instants))

    def place(k: int, m: int) -> slice:
        return slice(3 * (k * count + m), 3 * (k * count + m) + 3)

    for m in range(count):
        body = slice(nodes + 4 * (m % instants), nodes + 4 * (m % instants) + 4)
        for k in range(n):
            matrix[place(k, m), place(k, m)] = chains.diagonal[k, m]
            matrix[place(k, m), body] = chains.border[k, m].T
            if k > 0:
                matrix[place(k, m), place(k - 1, m)] = chains.lower[k, m]
                matrix[place(k - 1, m), place(k, m)] = chains.upper[k, m]
            if k > 1:
                matrix[place(k, m), place(k - 2, m)] = chains.lower2[k, m]
                matrix[place(k - 2, m), place(k, m)] = chains.upper2[k, m]
        for k in (0, 1):
            matrix[body, place(k, m)] = chains.foot[k, m]
    for p in range(instants):
        body = slice(nodes + 4 * p, nodes + 4 * p + 4)
        matrix[body, body] += chains.corner[p]
    return matrix


def joined_matrix(
    chains: Chains, resistance: np.ndarray, speed: np.ndarray, differentiation: np.ndarray
) -> np.ndarray:
    """Assemble the same with the chains joined in time by −ω_m D_mj R_m."""
    matrix = dense_matrix(chains)
    n, count = chains.diagonal.shape[:2]
    for k in range(n):
        for m in range(count):
            for j in range(count):
                rows, columns = 3 * (k * count + m), 3 * (k * count + j)
                matrix[rows : rows + 3, columns : columns + 3] -= (
                    speed[m] * differentiation[m, j] * resistance[k, m]
                )
    return matrix


@pytest.mark.parametrize("case", [orbit_case, stage_case, transient_case])
def test_the_matrix_is_the_derivative_of_the_residual_and_a_correction_solves_with_it(
    case: Callable[[], tuple[Body, Plain, Unknowns]],
) -> None:
    """Every entry, by central differences."""
    body, rates, (x, u) = case()
    rng = np.random.default_rng(3)
    dx, du = rng.normal(size=x.shape), rng.normal(size=u.shape)
    equations = linear(body, rates, x, u, dx, du)
    matrix = dense_matrix(equations.chains)
    if len(rates.differentiation):
        gain = 1 + body.droop * body.resistance[3, 3]
        speed = np.array([body.omega + gain * u[m % len(u), 3] for m in range(x.shape[1])])
        matrix = joined_matrix(equations.chains, equations.resistance, speed, rates.differentiation)
    z = np.concatenate([x.ravel(), u.ravel()])
    assert np.concatenate([equations.r.ravel(), equations.t.ravel()]) == pytest.approx(
        residual(body, rates, z, (x, u)), abs=1e-12
    )
    for i in range(len(z)):
        step = 1e-6 * np.eye(len(z))[i]
        slope = (residual(body, rates, z + step, (x, u)) - residual(body, rates, z - step, (x, u))) / 2e-6
        assert slope == pytest.approx(matrix[:, i], rel=1e-5, abs=1e-4)
    right = np.concatenate([dx.ravel(), du.ravel()])
    assert matrix @ np.concatenate([equations.dx.ravel(), equations.du.ravel()]) == pytest.approx(
        right, rel=1e-7, abs=1e-7
    )


@pytest.mark.parametrize("name", ["none", *(e.name for e in catalogue().values() if e.reach == "nonlocal")])
def test_a_used_room_gives_the_residual_of_a_new_one(name: str) -> None:
    body = first_body(control(**{} if name == "none" else {name: catalogue()[name].typical}))
    x, u = somewhere(body, 2, 6, 5)
    rates, z = on_orbit(6), np.concatenate([x.ravel(), u.ravel()])
    assert np.array_equal(residual(body, rates, z, (x, u), 0.7), residual(body, rates, z, (x, u)))


@pytest.mark.parametrize(("tails", "omega", "most"), [(2, 10.0, 5), (3, 10.0, 5), (2, 60.0, 7), (5, -100.0, 8)])
def test_orbits_from_straight_tails_take_few_corrections(tails: int, omega: float, most: int) -> None:
    """Quadratic convergence: one correction more takes the last one from 1e-4 to below 1e-8."""
    body = first_body(control(N=tails, omega_bar=omega))
    phases = tails * -(-4 // tails)
    rates = on_orbit(phases)
    x, u = straight_start(body, 8, phases, tails)
    count, size = corrections(body, rates, x, u, 1e-4)
    assert size < 1e-4
    assert count <= most
    more, size = corrections(body, rates, x, u, 1e-8)
    assert more <= 2
    assert size < 1e-8


def test_a_robot_that_is_no_number_ends_at_once() -> None:
    body = first_body(control())._replace(zeta_perp=np.nan)
    rates = on_orbit(4)
    x, u = straight_start(body, 6, 4, 2)
    count, size = corrections(body, rates, x, u, 1e-6)
    assert (count, size) == (1, np.inf)


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
