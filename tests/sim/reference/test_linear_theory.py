"""Linear theory against published values, and the simulator against linear theory for small deflections."""

from __future__ import annotations

import numpy as np
import pytest

from sim.motion.steady import steady
from sim.reference.linear_theory import linear_filament, linear_motion
from tests.reference.cases import LINEAR_FILAMENT
from tests.sim.robots import control


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
