"""Wrench of the tails and balance of the head: formulas against the simulator, differences and another method."""

from __future__ import annotations

import numpy as np
import pytest

from sim.effects import catalogue
from sim.mechanics.linear_theory import linear_filament
from sim.model.groups import Groups
from sim.motion.batches import steady_columns
from sim.solve.assembly import bodies
from sim.solve.refinement import orbit_on_mesh
from surrogate.domain import INSIDE, ROBOT
from surrogate.table_file import load
from surrogate.tails import (
    linear_thrust,
    linear_torque,
    needs_no_learning,
    pack_robots,
    packed_robots,
    robots_of,
    straight_resistance,
    unpack_robots,
)
from surrogate.training.fits import wrench_samples
from surrogate.training.simulated import draw_robots
from tests.oracles import query
from tests.sim.robots import mean_tail_wrench
from tests.surrogate.small import rows


@pytest.mark.parametrize("effect", [name for name in catalogue() if needs_no_learning(name)])
def test_effects_on_head_disc_and_motor_need_no_learning(effect: str) -> None:
    """The shipped table is right with the effect, in both directions of the motor."""
    robot = {"C_t": 3.0, "C_r": 2.8, "C_yr": 2.0, "l_over_R": 6.875, "L_over_R": 3.75, "l_over_r0": 34.375,
             "omega_bar": 10.0, "N": 4.0}  # fmt: skip
    both = {name: np.array([value, value]) for name, value in robot.items()}
    both["omega_bar"] = both["omega_bar"] * [1.0, -1.0]
    both[effect] = np.full(2, catalogue()[effect].typical)
    truth, answer = steady_columns(both, title="", jobs=1), load().query(both)
    for name in ("omega_yr_bar", "omega_t_bar", "v_x", "R_yr_over_l"):
        assert answer[name] == pytest.approx(truth[name], rel=0.005), name
    if catalogue()[effect].symmetry == "odd":
        assert abs(truth["omega_yr_bar"].sum()) > 1e-3 * abs(truth["omega_yr_bar"][0])


def test_straight_tails_have_the_drag_of_their_nodes() -> None:
    """Force and moment of a straight rod from 0 to −l that moves sideways and turns."""
    robots = rows().at(np.arange(4)).robots
    tails = robots_of(robots)
    motion = np.tile([0.3, 0.2, 0.5, -1.0, 2.0], (4, 1))
    z = np.linspace(-1, 0, 4001)
    side = 0.3 + 0.5 * z
    force, moment = -np.trapezoid(side, z), -np.trapezoid(z * side, z)
    resisted = (straight_resistance(tails) @ motion[:, :3, None])[..., 0]
    found = -resisted / tails.number[:, None]
    assert np.allclose(found[:, 0], force * tails.perp, rtol=1e-6)
    assert np.allclose(found[:, 2], moment * tails.perp, rtol=1e-6)
    assert np.allclose(found[:, 1], -0.2 * tails.parallel)


def test_the_wrench_from_the_robots_own_motion_is_that_of_the_tails() -> None:
    """R (v_x, v_z, ω_yr, ω_h, ω_t) is the mean wrench that the simulator's tails have, mesh by mesh."""
    robots = {name: values[:3] for name, values in rows().robots.items()}
    heads = robots_of(robots)
    for i in range(3):
        one = {name: values[i : i + 1] for name, values in robots.items()}
        body = bodies(Groups.from_columns(one))[0]
        solved, x, u = orbit_on_mesh(body, int(one["N"][0]), 8)
        assert solved
        mean = u.mean(0)
        motion = np.append(mean, body.omega + heads.gain[i] * mean[3])
        wrench = heads.resistance[i] @ motion
        assert wrench == pytest.approx(mean_tail_wrench(body, x, u), rel=1e-4, abs=1e-6 * np.abs(wrench).max())


def test_forces_are_in_balance() -> None:
    robots = {name: values[:300] for name, values in draw_robots(2000, 31, wide=False).items() if name in ROBOT}
    robots["N"] = np.full(300, 4.0)
    found, r = load().solve(robots), query.robots_of(robots)
    known, u = found.outside == INSIDE, found.motion.T
    assert known.mean() > 0.9
    network = load().tails.wrench[2]
    assert network is not None
    left = query.residual(r, u, query.members(network, query.tail_inputs(r, u)).mean(0))
    size = np.einsum("ijm,jm->im", np.abs(r.drag), np.abs(u))
    assert np.abs(left / size)[:, known].max() < 1e-9


def test_robots_are_alike_in_loops_and_with_arrays() -> None:
    robots = {name: values for name, values in draw_robots(50, 3, wide=False).items() if name in ROBOT}
    robots["omega_bar"] = robots["omega_bar"] * np.tile([1.0, -1.0], 25)
    for part, other in zip(unpack_robots(packed_robots(robots)[1]), robots_of(robots), strict=True):
        assert part == pytest.approx(other, rel=1e-13)
    assert pack_robots(robots_of(robots)) == pytest.approx(packed_robots(robots)[1], rel=1e-13)


def test_linear_theory_is_a_good_start() -> None:
    some = rows(256, 13, wide=False)
    found = wrench_samples(some.robots, some.motion)
    guess = query.first_guess(query.robots_of(some.robots)).T
    assert np.median(np.abs(guess[:, 3] / found.motion[:, 3] - 1)) < 0.1
    assert np.median(np.abs(guess[:, 2] / found.motion[:, 2] - 1)) < 0.3
    for S in (0.1, 1.0, 10.0, 100.0):
        thrust, torque, _ = linear_filament(S)
        assert linear_thrust(S) == pytest.approx(thrust, rel=0.5)
        assert linear_torque(S) == pytest.approx(torque, rel=0.35)
