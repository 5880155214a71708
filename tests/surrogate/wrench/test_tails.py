"""The tails' mean wrench: its form is right, and what is learned is what the simulator has."""

from __future__ import annotations

import numpy as np
import pytest

from sim.model.groups import Groups
from sim.reference.linear_theory import linear_filament
from sim.solve.assembly import bodies
from sim.solve.refinement import orbit_on_mesh
from surrogate.wrench.heads import heads_and_tails
from surrogate.wrench.tails import linear_thrust, linear_torque, straight_wrench
from tests.sim.robots import mean_tail_wrench
from tests.surrogate.small import rows


def test_the_fits_to_linear_theory_are_near_it() -> None:
    for S in (0.1, 1.0, 10.0, 100.0):
        thrust, torque, _ = linear_filament(S)
        assert linear_thrust(S) == pytest.approx(thrust, rel=0.5)
        assert linear_torque(S) == pytest.approx(torque, rel=0.35)


def test_straight_tails_have_the_drag_of_their_nodes() -> None:
    """Force and moment of a straight rod from 0 to −l that moves sideways and turns."""
    robots = rows().at(np.arange(4)).robots
    _, tails = heads_and_tails(robots)
    motion = np.tile([0.3, 0.2, 0.5, -1.0, 2.0], (4, 1))
    z = np.linspace(-1, 0, 4001)
    side = 0.3 + 0.5 * z
    force, moment = -np.trapezoid(side, z), -np.trapezoid(z * side, z)
    found = straight_wrench(tails, motion) / tails.number[:, None]
    assert np.allclose(found[:, 0], force * tails.zeta_perp, rtol=1e-6)
    assert np.allclose(found[:, 2], moment * tails.zeta_perp, rtol=1e-6)
    assert np.allclose(found[:, 1], -0.2 * tails.zeta_parallel)


def test_the_wrench_from_the_robots_own_motion_is_that_of_the_tails() -> None:
    """R (v_x, v_z, ω_yr, ω_h, ω_t) is the mean wrench that the simulator's tails have, mesh by mesh."""
    robots = {name: values[:3] for name, values in rows().robots.items()}
    heads, _ = heads_and_tails(robots)
    for i in range(3):
        one = {name: values[i : i + 1] for name, values in robots.items()}
        body = bodies(Groups.from_columns(one))[0]
        solved, x, u = orbit_on_mesh(body, int(one["N"][0]), 8)
        assert solved
        mean = u.mean(0)
        motion = np.append(mean, body.omega + heads.gain[i] * mean[3])
        wrench = heads.resistance[i] @ motion
        assert wrench == pytest.approx(mean_tail_wrench(body, x, u), rel=1e-4, abs=1e-6 * np.abs(wrench).max())


def test_an_effect_on_the_head_leaves_the_tails_table_alone() -> None:
    """Rows of robots with and without effects on the head lie on one function: the same network serves both."""
    robots = {name: values[:1].copy() for name, values in rows().robots.items()}
    plain, _ = heads_and_tails({**robots, "end_over_end_drag": np.zeros(1)})
    turning, _ = heads_and_tails({**robots, "end_over_end_drag": np.full(1, 5.0)})
    change = turning.resistance - plain.resistance
    assert float(change[0, 2, 2]) == pytest.approx(5 * 8 * np.pi / robots["l_over_R"][0] ** 3)
    assert int((np.abs(change) > 1e-12).sum()) == 1
