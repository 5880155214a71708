"""Torque of a held head, and linear theory, against the exact filament, the simulator and each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.mechanics.drag import tail_coefficients
from sim.mechanics.linear_theory import linear_filament, linear_motion
from sim.model.presets import PRESETS
from sim.motion.steady import steady
from tests.oracles.held_head import held_torque, linear_torque
from tests.reference.cases import LINEAR_FILAMENT
from tests.sim.robots import control

ROBOT = PRESETS["paper-control"]  # l = 11 cm, a = R = 16 mm


def test_the_torque_is_that_of_the_exact_filament() -> None:
    """Of a boundary-value solver, for motor speeds of 2, 4, 8, 12 and 16 rad/s."""
    groups = ROBOT.groups()
    speed = np.array([2.0, 4.0, 8.0, 12.0, 16.0]) * ROBOT.time_scale
    S = speed * tail_coefficients(groups.l_over_r0)[1]
    exact = np.array([1.732e-4, 2.571e-4, 4.32812e-4, 6.183e-4, 8.036e-4])  # N m
    torque = held_torque(groups, S) * ROBOT.bending_stiffness / ROBOT.tail_length
    assert torque == pytest.approx(exact, rel=2e-3)


def test_close_to_the_axis_the_torque_is_that_of_linear_theory() -> None:
    offset = 0.01
    groups = replace(ROBOT.groups(), a_over_R=np.array([offset * ROBOT.tail_length / ROBOT.head_radius]))
    S = np.array([1.0, 10.0, 40.0])
    assert held_torque(groups, S) == pytest.approx([linear_torque(s, offset, 0.0) for s in S], rel=0.01)
    assert [linear_torque(s, 1.0, 0.0) / s for s in S] == pytest.approx(
        [linear_filament(s)[1] for s in S], rel=1e-3
    )


def test_a_slowly_turning_tilted_rod_is_rigid() -> None:
    """∫ (a + θ s)² ds."""
    assert linear_torque(1e-3, 0.3, 0.5) / 1e-3 == pytest.approx(0.09 + 0.15 + 0.25 / 3, rel=1e-4)


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
