"""One clamped rotating filament against boundary-value solutions, linear and beam theory."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.mechanics.drag import tail_coefficients
from sim.mechanics.linear_theory import linear_filament, linear_motion
from sim.model.presets import PRESETS
from sim.motion.steady import steady
from sim.solve.march import new_state
from sim.solve.rates import FIRST_PHASE
from sim.solve.residual import fluid_forces
from tests.reference.cases import BEAM_K4, FILAMENT, FILAMENT_TIP, LINEAR_FILAMENT
from tests.sim.robots import (
    advance,
    control,
    extrapolated_loads,
    held_filament,
    held_loads,
    solve_orbit,
    straight_start,
)

ROBOT = PRESETS["paper-control"]
SLENDERNESS, OFFSET = ROBOT.tail_length / ROBOT.tail_radius, 0.016 / 0.11


def stepped_loads(edges: int) -> tuple[float, float]:
    """Compute |F_z| [N] and |M_z| [N m] of the fluid on the filament at 8 rad/s, stepped to its lasting shape."""
    body = held_filament(8.0 * ROBOT.time_scale, SLENDERNESS, OFFSET)
    state, steps = new_state(1, edges, body.offset), math.ceil(8.0 * body.omega)
    assert advance(body, state, 2.0 / steps, steps, 1e-8).solved
    forces = fluid_forces(body, state.x, state.x_dot, state.u, state.pose[0])[0][:, 0]
    nodes = np.concatenate([[[body.offset, 0.0, 0.0]], state.x[:, 0]])
    force, moment = forces.sum(0), np.cross(nodes, forces).sum(0)
    scale = ROBOT.bending_stiffness / ROBOT.tail_length**2
    return abs(force[2]) * scale, abs(moment[2]) * scale * ROBOT.tail_length


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
    body = held_filament(1e-5, SLENDERNESS, 0.1)._replace(tail_load=(0.0, -0.08, 0.0))
    x, u = straight_start(body, 32, 6, 1)
    u[:] = 0.0
    size = solve_orbit(body, x, u, 1e-9)
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
    found = np.array([stepped_loads(edges) for edges in (4, 8, 16)])
    assert found[2, 0] == pytest.approx(FILAMENT[8.0][0], rel=6e-3)
    assert found[2, 1] == pytest.approx(FILAMENT[8.0][1], rel=1e-3)
    assert (np.log2((found[0] - found[1]) / (found[1] - found[2])) > 1.8).all()


@pytest.mark.parametrize("drag_number", [1.0, 10.0, 30.0, 100.0])
def test_thrust_matches_linear_theory(drag_number: float) -> None:
    """A small offset a: thrust/[(ζ⊥ − ζ∥) ω a²], torque/(ζ⊥ ω a²) and tip offset/a depend on S = ζ⊥ ω alone."""
    offset, slenderness = 1e-3, 34.375
    parallel, perp = (v.item() for v in tail_coefficients(np.array([slenderness])))
    omega = drag_number / perp
    wrench, x = held_loads(omega, slenderness, offset, edges=24)
    thrust = abs(wrench[1]) / ((perp - parallel) * omega * offset**2)
    assert thrust == pytest.approx(LINEAR_FILAMENT[drag_number][0], rel=0.02, abs=2e-3)
    assert abs(wrench[3]) / (perp * omega * offset**2) == pytest.approx(linear_filament(drag_number)[1], rel=0.02)
    assert math.hypot(*x[-1, :2]) / offset == pytest.approx(LINEAR_FILAMENT[drag_number][1], rel=0.01)


def test_a_bent_tail_relaxes_at_the_rate_of_the_first_mode() -> None:
    """Clamped-free beam in a viscous fluid: amplitude decays as exp(−k⁴ t/ζ⊥)."""
    body = held_filament(1e-9, 34.375, 0.1)
    k = BEAM_K4[0] ** 0.25
    arc = np.arange(1, 25) / 24
    ratio = (math.sinh(k) - math.sin(k)) / (math.cosh(k) + math.cos(k))
    state = new_state(1, 24, body.offset)
    state.x[:, 0, 1] += 1e-4 * (np.cosh(k * arc) - np.cos(k * arc) - ratio * (np.sinh(k * arc) - np.sin(k * arc)))
    shapes = advance(body, state, 0.002, 100, 1e-10, shapes=100).shapes
    rate = math.log(shapes[19, -1, 0, 1] / shapes[99, -1, 0, 1]) / (80 * 0.002)
    assert rate == pytest.approx(BEAM_K4[0] / body.zeta_perp, rel=0.01)


def test_a_rod_across_the_axis_has_the_drag_of_a_rigid_one() -> None:
    """Turned about its root: torque ζ⊥ ω l³/3."""
    body, x = held_filament(0.5, 34.375, 1e-9), np.zeros((48, 1, 3))
    x[:, 0, 0] = np.arange(1, 49) / 48
    forces = fluid_forces(body, x, np.zeros_like(x), np.zeros(4), 0.0)[0][1:]
    torque = np.cross(x, forces)[..., 2].sum()
    assert -torque == pytest.approx(body.zeta_perp * 0.5 / 3, rel=1e-3)


@pytest.mark.parametrize("drag_number", list(LINEAR_FILAMENT))
def test_thrust_and_tip_of_one_filament(drag_number: float) -> None:
    thrust, torque, tip = linear_filament(drag_number)
    assert thrust == pytest.approx(LINEAR_FILAMENT[drag_number][0], abs=5.1e-4)
    assert tip == pytest.approx(LINEAR_FILAMENT[drag_number][1], abs=5.1e-4)
    assert linear_filament(0.0) == (0.0, 1.0, 1.0)
    assert 0 < torque < 1


@pytest.mark.parametrize("tails", [2, 3, 5])
@pytest.mark.parametrize("omega", [2.0, -12.0, 60.0])
def test_close_to_the_axis_the_robot_moves_as_linear_theory_says(tails: int, omega: float) -> None:
    """Spins and surge to the order of the deflection; yaw, whose bending is left out, to a tenth."""
    groups = control(N=tails, omega_bar=omega, a_over_R=0.2)
    motion, theory = steady(groups), linear_motion(groups)
    assert motion.omega_t[0] == pytest.approx(theory.omega_t, rel=2e-3)
    assert motion.v_z[0] == pytest.approx(theory.v_z, rel=1e-2)
    assert motion.omega_yr[0] == pytest.approx(theory.omega_yr, rel=0.1)
    assert np.sign(motion.v_x[0]) == np.sign(theory.v_x)
