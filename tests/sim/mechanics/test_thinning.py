"""Thinning: the drag on every node, against Carreau's law written out."""

from __future__ import annotations

import numpy as np
import pytest

from sim.model.presets import CONTROL
from sim.motion.steady import steady
from sim.solve.orbit import residual_on_orbit, straight_start
from tests.sim.robots import control, first_body

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
    drag = residual_on_orbit(_thicker(plain), x, u)[0] - r
    share = np.linalg.norm(changed - r, axis=-1) / np.linalg.norm(drag, axis=-1)
    speeds = _speeds(plain, x, u)
    rate = speeds / plain.tail_radius
    control_rate = CONTROL.omega_bar / CONTROL.l_over_R * CONTROL.l_over_r0
    factor = (1 + (np.exp(time) * rate / control_rate) ** 2) ** ((n - 1) / 2)
    assert share == pytest.approx(1 - factor, rel=1e-6)
    assert (factor.min(), factor.max()) != pytest.approx((1.0, 1.0), abs=0.02)
    assert not np.allclose(wrench, t)


def _thicker(body):  # type: ignore[no-untyped-def]
    """Double the drag on the tails."""
    return body._replace(zeta_parallel=2 * body.zeta_parallel, zeta_perp=2 * body.zeta_perp)


def _speeds(body, x, u):  # type: ignore[no-untyped-def]
    """Compute |v| of the free nodes in the lab, (n, M)."""
    from sim.linear.spectral import differentiation
    from sim.mechanics.balance import motion_at
    from sim.solve.orbit import FIRST_PHASE

    D = differentiation(x.shape[1])
    speeds = np.empty(x.shape[:2])
    for m in range(x.shape[1]):
        now = u[m % len(u)]
        motion = motion_at(body, now, FIRST_PHASE + 2 * np.pi * m / x.shape[1])
        omega_t = body.omega + now[3]
        for k in range(x.shape[0]):
            v = np.array(motion.linear) + np.cross(motion.spin, x[k, m]) + omega_t * D[m] @ x[k]
            speeds[k, m] = np.linalg.norm(v)
    return speeds


def test_a_time_of_its_own_shows_only_in_a_fluid_that_thins() -> None:
    alone, none = (steady(control(shear_thinning_time=t)).omega_yr[0] for t in (2.0, 0.0))
    assert alone == pytest.approx(none, rel=1e-8)
    quick, slow = (steady(control(shear_thinning=0.4, shear_thinning_time=t)).omega_yr[0] for t in (-2.5, 2.5))
    assert quick == pytest.approx(none, rel=2e-3)
    assert slow < 0.9 * none
