"""Laws that depend on speed: a shear-thinning fluid, and friction of the contact line."""

from __future__ import annotations

import numpy as np
import pytest

from sim.linear.spectral import differentiation
from sim.mechanics.balance import motion_at
from sim.mechanics.drag import CREEP, add_contact_line
from sim.model.body import Body
from sim.model.presets import CONTROL
from sim.motion.steady import steady
from sim.solve.rates import FIRST_PHASE
from tests.sim.robots import control, first_body, residual_on_orbit, straight_start

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
