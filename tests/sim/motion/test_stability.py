"""Stable motions are those that perturbed robots return to, as fast as time steps and the monodromy say."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from sim.linear.spectral import differentiation, interpolation
from sim.mechanics.balance import tail_spin
from sim.model.body import Body
from sim.motion import stability
from sim.motion import steady as steady_module
from sim.motion.batches import steady_columns
from sim.motion.stability import DOUBTFUL, growths_on_more_phases, is_doubtful
from sim.motion.steady import orbits, steady
from sim.motion.steady_motion import DIRECT, STABILITY_COLUMNS, STEPPING
from sim.solve.assembly import row
from sim.solve.orbit import mean_motion
from sim.solve.rates import FIRST_PHASE
from sim.solve.refinement import PHASES, SOLVED, OrbitOnMeshes, refined_orbit
from tests.oracles.stepped_growth import stepped_growth
from tests.sim import lanes
from tests.sim.robots import CONTROL_VALUES, control, first_body, growth, growth_of_orbit

TOP = {"C_t": 0.55, "C_r": 0.54, "C_yr": 4.1, "l_over_R": 3.82, "L_over_R": 4.24, "l_over_r0": 16.2}
UNSTABLE = {**TOP, "N": 6, "omega_bar": 117.0}  # yaws nearly as fast as its tails spin
PRESSED = {
    "C_t": 4.629, "C_r": 1.438, "C_yr": 6.05, "l_over_R": 5.487, "L_over_R": 4.505, "l_over_r0": 26.299, "N": 5,
    "tail_contact": 1.0,
}  # fmt: skip
UNRESOLVED = {
    "C_t": 0.8386, "C_r": 0.6482, "C_yr": 4.3827, "l_over_R": 7.888, "L_over_R": 5.2725, "l_over_r0": 16.1815,
    "omega_bar": 160.783, "N": 5,
}  # fmt: skip

SPURIOUS = {
    "C_t": 5.5826, "C_r": 2.27309, "C_yr": 1.90152, "l_over_R": 4.95686, "L_over_R": 3.28364, "l_over_r0": 36.1076,
    "omega_bar": 7.21687,
}  # fmt: skip


def orbit_of(robot: dict[str, float]) -> OrbitOnMeshes:
    orbit = refined_orbit(first_body(control(**robot)), int(robot["N"]), PHASES)
    assert orbit.status == SOLVED
    return orbit


@pytest.mark.parametrize(
    ("robot", "revolutions"),
    [
        ({"N": 2, "omega_bar": 10.0}, 2.5),
        ({"N": 3, "omega_bar": 100.0, "C_yr": 6.0}, 25.0),
        ({"N": 3, "omega_bar": 30.0, "natural_curvature": 1.5}, 10.0),
        ({"N": 2, "omega_bar": 30.0, "natural_twist": 3.0}, 10.0),
    ],
)
def test_stable_motions_are_returned_to_at_the_stated_rate(robot: dict[str, float], revolutions: float) -> None:
    tails, body, orbit = int(robot["N"]), first_body(control(**robot)), orbit_of(robot)
    found = growth(body, tails, orbit.x[1], orbit.u[1])
    assert found < DOUBTFUL
    assert growth_of_orbit(body, tails, orbit) == found
    assert found == pytest.approx(stepped_growth(body, tails, revolutions), rel=0.05)


def test_an_unstable_motion_is_left_at_the_stated_rate() -> None:
    body, orbit = first_body(control(**UNSTABLE)), orbit_of(UNSTABLE)
    found = growth(body, 6, orbit.x[1], orbit.u[1])
    assert found > 0.3
    assert growth_of_orbit(body, 6, orbit) > 0.3
    assert found == pytest.approx(stepped_growth(body, 6, 8.0), rel=0.1)  # several perturbations grow


def test_phases_that_do_not_resolve_a_perturbation_do_not_make_a_motion_unstable() -> None:
    body, orbit = first_body(control(**UNRESOLVED)), orbit_of(UNRESOLVED)
    assert growth(body, 5, orbit.x[1], orbit.u[1]) > 0.1
    found = growth_of_orbit(body, 5, orbit)
    assert found == pytest.approx(stepped_growth(body, 5, 40.0, edges=12), abs=0.01)
    assert found < DOUBTFUL


@pytest.mark.rest
@pytest.mark.parametrize(("omega_bar", "stable"), [(40.0, True), (70.0, False)])
def test_a_ring_of_tails_in_contact_is_unstable_above_a_speed(omega_bar: float, stable: bool) -> None:
    """Contact presses the five tails together; time steps with contact agree, on the mesh of the growth."""
    body = first_body(control(**PRESSED, omega_bar=omega_bar))
    orbit = refined_orbit(body, 5, PHASES)
    assert orbit.status == SOLVED
    found = growth_of_orbit(body, 5, orbit)
    assert (found < -0.2) if stable else (found > 0.2)
    assert found == pytest.approx(stepped_growth(body, 5, 4.0), abs=0.15)


def test_an_unstable_row_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Time steps from straight tails reach another motion; without them the row keeps the unstable one."""
    groups = control(1, **UNSTABLE)
    monkeypatch.setattr(steady_module, "SAME", np.inf)
    motion = steady(groups)
    assert motion.method.tolist() == [DIRECT]
    assert motion.converged.all()
    assert not motion.stable.any()
    assert motion.note[0].startswith("unstable: small perturbations grow by ")


def test_time_steps_that_settle_are_stable() -> None:
    motion = steady(control(N=1.0, omega_bar=10.0))
    stepped = steady_module.stepped(control(1), ["a reason"])
    assert motion.stable.all()
    assert stepped.method.tolist() == [STEPPING]
    assert stepped.stable.all()
    assert np.isnan(stepped.growth).all()


def test_the_growth_can_be_left_out() -> None:
    points = {name: np.full(2, value) for name, value in CONTROL_VALUES.items()}
    points["omega_bar"] = np.array([10.0, 20.0])
    with_growth, without = steady_columns(points, title=""), steady_columns(points, stability=False, title="")
    assert set(with_growth) - set(without) == set(STABILITY_COLUMNS)
    assert without["omega_yr_bar"].tolist() == with_growth["omega_yr_bar"].tolist()
    assert with_growth["stable"].all()
    assert np.isnan(orbits(control()).growth).all()


def test_a_growth_without_a_converged_exponent_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    orbit = orbit_of({"N": 2, "omega_bar": 10.0})
    body = first_body(control(N=2, omega_bar=10.0))
    assert growths_on_more_phases(row(body), 2, [orbit])[0] < 0
    monkeypatch.setattr(stability, "_CONVERGED", 0.0)
    assert np.isnan(growths_on_more_phases(row(body), 2, [orbit])[0])


def test_which_growths_are_computed_again() -> None:
    """Those near zero and above, unknown ones, and those of robots that yaw fast, to either side."""
    slow, fast = np.array([30.0, -10.0, 5.0, 0.1, 0.1]), np.array([30.0, -10.0, -13.0, 0.1, 0.1])
    means = np.array([slow, slow, slow, slow, fast])
    values = np.array([-1.0, -0.01, 0.5, np.nan, -1.0])
    assert is_doubtful(means, values).tolist() == [False, True, True, True, True]
    assert not is_doubtful(slow, -1.0)


def test_unconverged_eigenvalues_do_not_make_a_motion_unstable(monkeypatch: pytest.MonkeyPatch) -> None:
    """One eigenvalue of this robot of the sweep is close to zero; its inverse would be a growth of 6900."""
    body, orbit = first_body(control(**SPURIOUS, N=2)), orbit_of({**SPURIOUS, "N": 2})
    monkeypatch.setattr(stability, "few_vectors", lambda _: 14)  # however many a growth takes
    found = growth(body, 2, orbit.x[1], orbit.u[1])
    assert found == pytest.approx(growths_on_more_phases(row(body), 2, [orbit])[0], rel=0.05)
    monkeypatch.setattr(stability, "_SIGN_KNOWN", np.inf)
    assert growth(body, 2, orbit.x[1], orbit.u[1]) > 1000


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
