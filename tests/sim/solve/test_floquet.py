"""Perturbations of an orbit: exponents agree with the monodromy, which is integrated step by step."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from sim.linear.spectral import differentiation, interpolation
from sim.mechanics.balance import tail_spin
from sim.model.body import Body
from sim.solve.orbit import mean_motion
from sim.solve.rates import FIRST_PHASE
from sim.solve.refinement import SOLVED, refined_orbit
from tests.sim import lanes
from tests.sim.robots import control, first_body, growth

RATE = 100.0  # any: it cancels


def residual_at(body: Body, phase: float, x: np.ndarray, slope: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Compute (r, t) of N tails at one phase, where ẋ = ω_t dx/dφ."""
    omega_t = tail_spin(body, u)
    rates = lanes.Plain(RATE, phase - omega_t / RATE, np.zeros((0, 0)), x - omega_t * slope / RATE)
    r, t = lanes.residual(body, rates, x, u[None])
    return np.concatenate([r.ravel(), t[0]])


def evolution(body: Body, phase: float, x: np.ndarray, slope: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Compute the matrix K of d(δx)/dφ = K δx, with the robot's velocities eliminated, by differences."""
    parts = (x, slope, u)
    blocks = []
    for i, step in enumerate((1e-6, 1e-6, 1e-6 * (1 + abs(body.omega)))):
        columns = []
        for k in range(parts[i].size):
            ends = []
            for sign in (1, -1):
                moved = [part.copy() for part in parts]
                moved[i].reshape(-1)[k] += sign * step
                ends.append(residual_at(body, phase, *moved))
            columns.append((ends[0] - ends[1]) / (2 * step))
        blocks.append(np.array(columns).T)
    by_place, by_slope, by_velocity = blocks
    return np.linalg.solve(np.hstack([by_slope, by_velocity]), -by_place)[: x.size]


def monodromy_growth(body: Body, tails: int, x: np.ndarray, u: np.ndarray, steps: int) -> float:
    """Integrate perturbations over an N-th of a turn, shift them by one tail, and take the largest factor."""
    columns, sense = x.shape[1], int(np.sign(body.omega))
    turn = sense * 2 * np.pi / tails / steps
    matrix = np.eye(3 * len(x) * tails)
    for i in range(steps):
        phase = FIRST_PHASE + (i + 0.5) * turn
        weights = interpolation(columns, phase - FIRST_PHASE + 2 * np.pi * np.arange(tails) / tails)
        shape, slope = (np.einsum("jm,kmc->kjc", w, x) for w in (weights, weights @ differentiation(columns)))
        velocity = weights[0] @ np.tile(u, (tails, 1))
        step = evolution(body, phase, np.ascontiguousarray(shape), np.ascontiguousarray(slope), velocity)
        matrix = scipy.linalg.expm(turn * step) @ matrix
    shifted = np.roll(matrix.reshape(len(x), tails, 3, -1), sense, axis=1).reshape(matrix.shape)
    omega_t, omega_h = mean_motion(body, u)[:2]
    factor = np.abs(np.linalg.eigvals(shifted)).max()
    return float(tails * np.log(factor) * abs(omega_t / (omega_t - omega_h)))


@pytest.mark.parametrize(
    ("robot", "steps"),
    [
        ({"N": 2, "omega_bar": 100.0}, 24),
        ({"N": 3, "omega_bar": 10.0}, 4),
        ({"N": 4, "omega_bar": -60.0, "C_yr": 6.0}, 4),
        ({"N": 3, "omega_bar": 30.0, "natural_curvature": 0.5}, 4),
        ({"N": 2, "omega_bar": 20.0, "rate_dependent_modulus": 0.1}, 24),
        ({"N": 3, "tail_interaction": 1.0}, 4),
        ({"N": 3, "shear_thinning": 0.3}, 4),
        ({"N": 5, "omega_bar": 25.0, "tail_contact": 1.0}, 12),
    ],
)
def test_growth_is_that_of_the_monodromy(robot: dict[str, float], steps: int) -> None:
    """On the coarsest mesh; the tails of the perturbed robot move differently."""
    tails, body = int(robot["N"]), first_body(control(**robot))
    orbit = refined_orbit(body, tails, 3)
    assert orbit.status == SOLVED
    x, u = orbit.x[0], orbit.u[0]
    assert growth(body, tails, x, u) == pytest.approx(monodromy_growth(body, tails, x, u, steps), rel=0.03)
