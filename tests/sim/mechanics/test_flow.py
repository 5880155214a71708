"""Flow of segments, images and tails, and laws that depend on speed: a shear-thinning fluid, the contact line."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad_vec

from sim.linear.spectral import differentiation
from sim.mechanics.balance import motion_at
from sim.mechanics.drag import CREEP, add_contact_line
from sim.mechanics.flow import stokeslets
from sim.model.body import Body
from sim.model.presets import CONTROL
from sim.motion.steady import steady
from sim.solve.rates import FIRST_PHASE
from sim.solve.refinement import orbit_on_mesh
from tests.sim.robots import control, first_body, mean_tail_wrench, residual_on_orbit, straight_start


@pytest.mark.parametrize("where", [(0.3, 0.1, -0.2), (0.02, 0.01, -0.5), (0.0, 0.0, -0.5), (0.1, 0.0, 0.9)])
def test_flow_of_a_straight_piece_is_the_integral_of_stokeslets(where: tuple[float, float, float]) -> None:
    start, end, force, spread = np.array([0.0, 0, 0]), np.array([0.05, 0, -1.0]), np.array([0.3, -1.0, 0.7]), 0.03

    def point(share: float) -> np.ndarray:
        r = np.array(where) - start - share * (end - start)
        R = np.sqrt(r @ r + spread**2)
        return ((1 / R + spread**2 / R**3) * force + (r @ force) * r / R**3) / (8 * np.pi)

    expected = quad_vec(point, 0, 1, epsabs=1e-10, points=(0.5,))[0]
    found = stokeslets(where, tuple(start), tuple(end), tuple(force), spread)
    assert np.array(found) == pytest.approx(expected, rel=1e-7)


def test_nothing_flows_through_the_surface() -> None:
    """A segment and its image together: no normal velocity and no shear on the plane y = H."""
    start, end, force, height = (0.1, 0.2, 0.0), (0.3, -0.1, -0.8), (0.5, 0.9, -0.3), 0.6
    image = [(v[0], 2 * height - v[1], v[2]) for v in (start, end)]

    def velocity(y: float) -> np.ndarray:
        at = (0.4, y, -0.3)
        mirrored = (force[0], -force[1], force[2])
        direct = np.array(stokeslets(at, start, end, force, 0.03))
        return direct + np.array(stokeslets(at, *image, mirrored, 0.03))

    assert velocity(height)[1] == pytest.approx(0, abs=1e-15)
    shear = (velocity(height + 1e-4) - velocity(height - 1e-4))[[0, 2]] / 2e-4
    assert shear == pytest.approx([0, 0], abs=1e-8)


@pytest.mark.parametrize("tails", [2, 3, 4, 5])
def test_slow_tails_drag_each_other_as_much_as_rigid_rods(tails: int) -> None:
    """Torque against the closed form for evenly loaded rods on a ring (ours are loaded as the flow asks)."""
    few = {"N": tails, "omega_bar": 0.01}
    moments = []
    for share in (0.0, 1.0):
        body = first_body(control(**few, tail_interaction=share))
        solved, x, u = orbit_on_mesh(body, tails, 24)
        assert solved
        wrench = mean_tail_wrench(body, x, u)
        moments.append(wrench[3] / (0.01 + u[:, 3].mean()))
    j = np.arange(1, tails)
    distance = 2 / 6.875 * np.sin(np.pi * j / tails)
    s, e = np.arcsinh(1 / (2 * distance)), (1 + 4 * distance**2) ** -0.5
    more = (np.cos(2 * np.pi * j / tails) * s + np.cos(np.pi * j / tails) ** 2 * e).sum()
    alone = np.log(34.375) + 0.5
    assert moments[1] / moments[0] == pytest.approx(alone / (alone + more), rel=0.05)


EDGES, PHASES = 10, 4


def test_each_node_loses_the_share_that_its_own_speed_says() -> None:
    rng = np.random.default_rng(2)
    n, time = 0.6, 0.8
    plain = first_body(control())
    thinning = first_body(control(shear_thinning=1 - n, shear_thinning_time=time))
    x, u = straight_start(plain, EDGES, PHASES, 2)
    x += 0.01 * rng.normal(size=x.shape)
    u += rng.normal(size=u.shape)
    r, t = residual_on_orbit(plain, x, u)
    changed, wrench = residual_on_orbit(thinning, x, u)
    # The drag alone is what viscosity changes in the residual.
    thicker = plain._replace(zeta_parallel=2 * plain.zeta_parallel, zeta_perp=2 * plain.zeta_perp)
    drag = residual_on_orbit(thicker, x, u)[0] - r
    share = np.linalg.norm(changed - r, axis=-1) / np.linalg.norm(drag, axis=-1)
    speeds = _speeds(plain, x, u)
    rate = speeds / plain.tail_radius
    control_rate = CONTROL.omega_bar / CONTROL.l_over_R * CONTROL.l_over_r0
    factor = (1 + (np.exp(time) * rate / control_rate) ** 2) ** ((n - 1) / 2)
    assert share == pytest.approx(1 - factor, rel=1e-6)
    assert (factor.min(), factor.max()) != pytest.approx((1.0, 1.0), abs=0.02)
    assert not np.allclose(wrench, t)


def _speeds(body: Body, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Compute |v| of the free nodes in the lab, (n, M)."""
    slopes = np.einsum("ml,klc->kmc", differentiation(x.shape[1]), x)
    speeds = np.empty(x.shape[:2])
    for m in range(x.shape[1]):
        now = u[m % len(u)]
        motion = motion_at(body, now, FIRST_PHASE + 2 * np.pi * m / x.shape[1])
        velocity = np.array(motion.linear) + np.cross(motion.spin, x[:, m]) + (body.omega + now[3]) * slopes[:, m]
        speeds[:, m] = np.linalg.norm(velocity, axis=-1)
    return speeds


def test_a_time_of_its_own_shows_only_in_a_fluid_that_thins() -> None:
    alone, none = (steady(control(shear_thinning_time=t)).omega_yr[0] for t in (2.0, 0.0))
    assert alone == pytest.approx(none, rel=1e-8)
    quick, slow = (steady(control(shear_thinning=0.4, shear_thinning_time=t)).omega_yr[0] for t in (-2.5, 2.5))
    assert quick == pytest.approx(none, rel=2e-3)
    assert slow < 0.9 * none


def force(speed: float, **effects: float) -> np.ndarray:
    """Compute the force on a head that surges."""
    wrench = np.zeros(4)
    add_contact_line(first_body(control(contact_line=0.5, **effects)), np.array([0.0, speed, 0.0, 0.0]), wrench)
    return wrench


@pytest.mark.parametrize("size", [0.0, 4.0])
def test_above_its_speed_it_is_constant_and_below_proportional(size: float) -> None:
    creep = CREEP * np.exp(size)
    high, higher = (force(factor * creep, contact_line_speed=size)[1] for factor in (100.0, 200.0))
    low, lower = (force(factor * creep, contact_line_speed=size)[1] for factor in (0.02, 0.01))
    assert higher == pytest.approx(high, rel=1e-3)
    assert low == pytest.approx(2 * lower, rel=1e-3)
    assert high < low < 0
    assert force(creep, contact_line_speed=size)[1] == pytest.approx(high / np.sqrt(2), rel=1e-3)


def test_a_fast_line_is_felt_less() -> None:
    speeds = ((0.1, {}), (0.1, {"contact_line_speed": 0.0}), (0.1, {"contact_line_speed": 5.0}), (0.0, {}))
    plain, null, fast, free = (steady(control(contact_line=size, **e)).v_z[0] for size, e in speeds)
    assert plain == null < fast < free
