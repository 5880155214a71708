"""The direct route to the steady motion: against time stepping, tensors, finite differences and its own error."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dataset.design import load_design
from sim import direct, elimination, orbit
from sim.balance import assemble, fluid_wrench, newton_correction
from sim.batches import steady_columns, stepped_columns
from sim.motion import DIRECT, STEPPING
from sim.robot import PRESETS, Groups
from sim.shapes import tails_over_a_revolution
from sim.steady import QUICK, orbits, steady
from sim.tail import Body, new_geometry
from sim.tail import body_of as body_of_row
from tests.sim.robots import control

Floats = np.ndarray


def sweep_points(count: int) -> dict[str, Floats]:
    points = load_design("sweep.toml").with_rows(count).points()
    return {name: values for name, values in points.items() if name != "dwell_bar"}


def body_of(groups: Groups) -> tuple[Body, Floats]:
    row = direct.bodies(groups)[0]
    return body_of_row(row), row


def test_time_stepping_from_rest_reaches_the_same_motion() -> None:
    """Over the sweep's domain; the tolerance is the error of stepping on 24 edges."""
    points = sweep_points(32)
    found = steady_columns(points, title="")
    stepped = stepped_columns(points, finer=2, title="")
    assert (found["method"] == DIRECT).all()
    assert found["converged"].all()
    assert stepped["converged"].all()
    speed = np.hypot(stepped["v_x"], stepped["v_z"])
    for name in ("omega_t_bar", "omega_h_bar", "omega_yr_bar"):
        assert np.abs(found[name] / stepped[name] - 1).max() < 4e-3, name
    for name in ("v_x", "v_z"):
        assert (np.abs(found[name] - stepped[name]) / speed).max() < 4e-3, name
    assert np.abs(found["tail_gap"] / stepped["tail_gap"] - 1).max() < 0.05


@pytest.mark.parametrize("tails", [1, 2, 3, 5])
def test_tensors_find_the_compiled_orbit_in_balance(tails: int) -> None:
    """At every phase, all N tails in place: no net wrench, and a Newton correction that changes nothing."""
    groups = control(N=tails, omega_bar=-40.0, C_yr=5.0)
    _, row = body_of(groups)
    found = direct.solve(row, tails, direct.FEW)
    assert found.ended == direct.SOLVED
    x, u = found.x[2], found.u[2]
    n, phases, _ = x.shape
    derivative = np.einsum("ml,klc->kmc", direct.differentiation(phases), x)
    lanes = torch.zeros(phases // tails, dtype=torch.long)
    swimmer = assemble(groups, edges=n).select(lanes)
    shape = np.empty((n, 3, tails, len(lanes)))
    rate = np.empty_like(shape)
    for j in range(tails):
        later = (np.arange(len(lanes)) + j * len(lanes)) % phases
        angle = 2 * np.pi * j / tails
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        shape[:, :, j] = np.einsum("ab,kmb->kam", turn, x[:, later])
        rate[:, :, j] = np.einsum("ab,kmb->kam", turn, derivative[:, later])
    omega = groups.omega_bar[lanes]
    velocity = torch.tensor(u.T)
    x_dot = torch.tensor(rate) * swimmer.omega_t(velocity, omega)
    phase = torch.tensor(orbit.FIRST_PHASE + 2 * np.pi * np.arange(len(lanes)) / phases)
    balanced = (swimmer, torch.tensor(shape), x_dot, phase, velocity, omega)
    on_tails, on_head = fluid_wrench(*balanced)
    assert (on_tails + on_head).abs().max() < 1e-6 * on_tails.abs().max()
    dx, du = newton_correction(*balanced, torch.full_like(omega, 1e3))
    assert dx.abs().max() < 1e-7
    assert du.abs().max() < 1e-6


def test_newton_s_matrix_is_the_derivative_of_the_residual() -> None:
    """Every block, by central differences; motor droop and drag on the disc included."""
    n, phases, tails = 4, 6, 2
    groups = control(N=tails, omega_bar=12.0, C_yr=6.0)
    body, _ = body_of(groups)
    body.resistance[:] += 0.3 * np.random.default_rng(0).normal(size=(4, 5))
    body = body._replace(gain=1.3, load=(0.2, -0.5, 0.1))
    rng = np.random.default_rng(1)
    x, u = direct._start(body, n, phases, tails)
    x += 0.02 * rng.normal(size=x.shape)
    u += rng.normal(size=u.shape)
    matrix = direct.differentiation(phases)

    def residual(z: Floats) -> Floats:
        system = elimination.new_system(n, phases, u.size, 1)
        geometry = new_geometry(n, phases)
        orbit.linearise(body, z[: x.size].reshape(x.shape), z[x.size :].reshape(u.shape), matrix, geometry, system)
        return np.concatenate([-system.rows[:, :, -1].ravel(), -system.corner[:, -1]])

    z = np.concatenate([x.ravel(), u.ravel()])
    system = elimination.new_system(n, phases, u.size, 1)
    orbit.linearise(body, x, u, matrix, new_geometry(n, phases), system)
    m = 3 * phases
    jacobian = np.zeros((len(z), len(z)))
    for k in range(n):
        rows = slice(k * m, (k + 1) * m)
        jacobian[rows, rows] = system.rows[k, :, :m]
        jacobian[rows, x.size :] = system.rows[k, :, 2 * m : -1]
        if k > 0:
            before = slice((k - 1) * m, k * m)
            jacobian[rows, before], jacobian[before, rows] = system.rows[k, :, m : 2 * m], system.upper[k]
        for lane in range(phases) if k > 1 else ():
            here, there = k * m + 3 * lane + np.arange(3), (k - 2) * m + 3 * lane + np.arange(3)
            jacobian[np.ix_(here, there)] = system.lower2[k, lane]
            jacobian[np.ix_(there, here)] = system.upper2[k, lane]
    jacobian[x.size :, : 2 * m] = np.concatenate([system.foot[0], system.foot[1]], 1)
    jacobian[x.size :, x.size :] = system.corner[:, :-1]
    for i in range(len(z)):
        step = 1e-6 * np.eye(len(z))[i]
        slope = (residual(z + step) - residual(z - step)) / 2e-6
        assert slope == pytest.approx(jacobian[:, i], rel=1e-5, abs=1e-4)
    # And the elimination solves it.
    dx, du = np.zeros((n, m, 1)), np.zeros((u.size, 1))
    right = -residual(z)
    elimination.solve(system, dx, du)
    assert jacobian @ np.concatenate([dx.ravel(), du.ravel()]) == pytest.approx(right, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("size", [6, 18, 48])
def test_inverse(size: int) -> None:
    matrix = np.random.default_rng(size).normal(size=(size, size)) + size * np.eye(size)
    inverse = matrix.copy()
    elimination.invert(inverse)
    assert inverse @ matrix == pytest.approx(np.eye(size), abs=1e-11)


def test_dense_equations_need_row_exchanges() -> None:
    matrix = np.array([[0.0, 2.0, 1.0], [1.0, 1.0, 0.0], [3.0, 0.0, 1.0]])
    right = np.array([[1.0, 2.0], [2.0, 0.0], [3.0, 1.0]])
    found = right.copy()
    elimination.solve_dense(matrix.copy(), found)
    assert matrix @ found == pytest.approx(right, abs=1e-14)


@pytest.mark.parametrize("phases", [3, 4, 5, 8])
def test_phases_are_resampled_and_differentiated_exactly(phases: int) -> None:
    """For what M phases can resolve."""
    at = 2 * np.pi * np.arange(phases) / phases
    finer = 2 * np.pi * np.arange(12) / 12
    for k in range(1, (phases - 1) // 2 + 1):
        values = np.cos(k * at + 0.3)
        assert direct.differentiation(phases) @ values == pytest.approx(-k * np.sin(k * at + 0.3), abs=1e-12)
        assert direct.interpolation(phases, finer) @ values == pytest.approx(np.cos(k * finer + 0.3), abs=1e-12)


def test_the_stated_error_covers_a_much_finer_mesh() -> None:
    """Against 24 and 36 edges, extrapolated: nine rows in ten are within it, all within twice."""
    points = sweep_points(24)
    ratios = []
    for i in range(24):
        groups = Groups.from_columns({name: values[i : i + 1] for name, values in points.items()})
        body, row = body_of(groups)
        found = direct.solve(row, groups.N, direct.FEW)
        assert found.ended == direct.SOLVED
        x, u = found.x[2], found.u[2]
        phases = 2 * x.shape[1]
        x, u = direct.with_phases(x, phases), direct.with_phases(u.reshape(1, -1, 4), phases // groups.N)[0]
        fine = []
        for n in (24, 36):
            x = direct.with_edges(x, body.offset, n)
            _, size = orbit.newton(body, x, u, direct.differentiation(phases), 1e-7, 20)
            assert size < 1e-7
            fine.append(direct.means(body, u, row[6]))
        truth = (36**2 * fine[1] - 24**2 * fine[0]) / (36**2 - 24**2)
        assert direct.difference(found.means, truth) < 2e-3
        ratios.append(direct.difference(found.means, truth) / found.error)
    assert np.quantile(ratios, 0.9) < 1
    assert max(ratios) < 2


def test_a_row_without_an_orbit_is_stepped_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    groups = control(2, omega_bar=[10.0, 14.0])
    plain = steady(groups)

    def lose_the_first(rows: Floats, tails: int, *, phases: int) -> direct.Orbits:
        found = solve_all(rows, tails, phases=phases)
        found.ended[0] = direct.LOST
        found.means[0] = np.nan
        return found

    solve_all = direct.solve_all
    monkeypatch.setattr(direct, "solve_all", lose_the_first)
    assert orbits(groups).failed.tolist() == [True, False]
    motion = steady(groups)
    assert motion.method.tolist() == [STEPPING, DIRECT]
    assert motion.note.tolist() == [direct.REASONS[direct.LOST], ""]
    assert motion.converged.all()
    assert motion.omega_yr == pytest.approx(plain.omega_yr, rel=5e-3)
    assert 0 < motion.error[0] < 0.01


def test_a_quick_turn_is_followed_from_rest() -> None:
    """Both robots turn fast beside their discs; straight tails take one of them to another motion."""
    size = {"l_over_R": 3.82, "L_over_R": 4.24, "l_over_r0": 16.2, "omega_bar": 117.0}
    groups = control(2, N=6, C_t=0.55, C_r=0.54, C_yr=[4.1, 2.5], **size)
    alike = orbits(groups)
    assert alike.converged.all()
    assert (np.abs(alike.omega_yr) > QUICK * np.abs(alike.omega_t)).all()
    motion = steady(groups)
    assert motion.method.tolist() == [STEPPING, DIRECT]
    assert motion.converged.all()
    assert "another motion" in motion.note[0]
    assert abs(motion.v_z[0] / alike.v_z[0] - 1) > 0.1
    assert motion.v_z[1] == alike.v_z[1]


def test_tails_over_a_revolution_hang_on_their_clamps() -> None:
    robot = PRESETS["paper-triangle"]
    phases, tails = tails_over_a_revolution(robot, 8)
    assert tails.shape == (8, 4, 13, 3)
    radius = robot.head_radius / robot.tail_length
    for j in range(4):
        angle = phases + 2 * np.pi * j / 4
        clamp = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], 1)
        assert tails[:, j, 0] == pytest.approx(clamp, abs=1e-12)
    lengths = np.linalg.norm(np.diff(tails, axis=2), axis=-1).sum(-1)
    assert lengths == pytest.approx(1.0, abs=1e-2)
    # After a quarter turn tail 1 is where tail 0 was.
    assert tails[2, 0] == pytest.approx(tails[0, 1], abs=1e-9)
